"""Skies of the known answers: the CIE general skies written out apart from the engine's, and their closed forms.

Only the standard's table of parameters is shared with `transom.daylight`; it is held by published sums over the sky.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.daylight.cie_sky import STANDARD_PARAMETERS

Float64 = NDArray[np.float64]

UNIFORM, TRADITIONAL = 5, 16
"""Sky types with closed forms through rectangles: uniform, and traditional overcast (1 + 2 sin altitude) / 3."""

HEMISPHERE_ORDER = 96
"""Gauss-Legendre points in each of two ranges of altitude and in azimuth, for the illuminance of the open horizon."""


@dataclass(frozen=True)
class KnownSky:
    """A CIE sky: type 1..16, unit vector towards the sun (its altitude above 0), luminance of the zenith [cd/m²]."""

    type: int
    sun: tuple[float, float, float]
    zenith_cd_m2: float

    def luminance(self, directions: Float64) -> Float64:
        """Luminance [cd/m²] in unit directions (..., 3) above the horizon.

        L / Lz = f(chi) phi(Z) / (f(Zs) phi(0)), phi(Z) = 1 + a exp(b / cos Z),
        f(chi) = 1 + c (exp(d chi) - exp(d pi / 2)) + e cos² chi [CIE S 011/E:2003, equations 1 to 4];
        type 16: Lz (1 + 2 cos Z) / 3 [Moon & Spencer 1942].
        """
        height = np.asarray(directions[..., 2])
        if self.type == TRADITIONAL:
            return np.asarray(self.zenith_cd_m2 * (1 + 2 * height) / 3)
        a, b, c, d, e = STANDARD_PARAMETERS[self.type]

        def gradation(cos_zenith: Float64) -> Float64:
            return np.asarray(1 + a * np.exp(b / np.maximum(cos_zenith, 1e-9)))

        def indicatrix(cos_sun: Float64) -> Float64:
            chi = np.arccos(np.clip(cos_sun, -1, 1))
            return np.asarray(1 + c * (np.exp(d * chi) - math.exp(d * math.pi / 2)) + e * np.cos(chi) ** 2)

        towards = np.asarray(directions @ np.array(self.sun))
        at_zenith = indicatrix(np.array(self.sun[2])) * gradation(np.array(1.0))
        return np.asarray(self.zenith_cd_m2 * indicatrix(towards) * gradation(height) / at_zenith)

    def horizontal_illuminance(self) -> float:
        """Of an unobstructed horizontal plane [lx]: closed for types 5 and 16, else a product of Gauss rules.

        Altitudes are split at the sun and azimuths counted from it: the cusp of f at the sun falls on a corner.
        """
        if self.type == UNIFORM:
            return math.pi * self.zenith_cd_m2
        if self.type == TRADITIONAL:
            return 7 * math.pi / 9 * self.zenith_cd_m2
        node, weight = np.polynomial.legendre.leggauss(HEMISPHERE_ORDER)
        node, weight = 0.5 * (node + 1), 0.5 * weight
        altitude_of_sun = math.asin(self.sun[2])
        azimuth_of_sun = math.atan2(self.sun[1], self.sun[0])
        azimuth = azimuth_of_sun + math.pi * node
        total = 0.0
        for low, high in ((0.0, altitude_of_sun), (altitude_of_sun, math.pi / 2)):
            altitude = low + (high - low) * node
            across, up = np.cos(altitude)[:, None], np.sin(altitude)[:, None]
            directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), up + 0 * azimuth], axis=-1)
            values = self.luminance(directions) * up * across
            total += float((high - low) * 2 * math.pi * (weight @ values @ weight))
        return total


def roof_corner_integrals(a: float, b: float, h: float) -> tuple[float, float]:
    """Solid-angle integrals of cos and cos² over a horizontal rectangle a x b at height h, point under a corner.

    By Stokes' theorem along its edges; cos of the angle from the zenith.
    """
    x, y, r = a / h, b / h, math.sqrt(a * a + b * b + h * h)
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    first = 0.5 * (x / p * math.atan(y / p) + y / q * math.atan(x / q))
    second = (math.atan(a * b / (h * r)) + h * a * b / r * (1 / (a * a + h * h) + 1 / (b * b + h * h))) / 3
    return first, second


def facade_corner_integrals(w: float, z: float, d: float) -> tuple[float, float]:
    """The same over an upright rectangle of width w and height z at distance d, point opposite its lower corner."""
    s = math.hypot(d, z)
    beta, inner, gamma = math.atan(w / d), math.atan(w / s), math.atan(z / d)
    first = 0.5 * (beta - inner * math.cos(gamma))
    second = (math.asin(math.sin(beta) * math.sin(gamma)) - 0.5 * math.sin(2 * gamma) * math.sin(inner)) / 3
    return first, second


def closed_form_illuminance(sky: KnownSky, cos_integral: float, cos2_integral: float) -> float:
    """Horizontal illuminance [lx] through an unglazed hole, from its integrals of cos and cos²: types 5 and 16 only.

    Traditional overcast: (Lz / 3) (integral of cos + 2 integral of cos²), so that a facade's share of 7 pi Lz / 9 is
    Walsh's sky component [Walsh 1961; Tregenza & Sharples 1993]. Raises ValueError for other skies.
    """
    if sky.type == UNIFORM:
        return sky.zenith_cd_m2 * cos_integral
    if sky.type == TRADITIONAL:
        return sky.zenith_cd_m2 / 3 * (cos_integral + 2 * cos2_integral)
    raise ValueError(f"CIE sky {sky.type} has no closed form through a rectangle")

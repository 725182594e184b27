"""A sky with a level: luminance [cd/m²] as a function of direction, for any of the patterns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Vector = tuple[float, float, float]
Formula = tuple[float, float, float, float, float, float]
"""a, b, c, d, e, k of a luminance (1 + a exp(b / sin h)) (k + c exp(d x) + e cos² x), at least 0, at altitude h and
angle x from the sun."""

QUADRATURE_ORDER = 64  # In each of two altitude panels and in azimuth: CIE skies to better than 1e-8.


NODES, WEIGHTS = np.polynomial.legendre.leggauss(QUADRATURE_ORDER)
"""Of Gauss-Legendre quadrature over -1..1; a plot of many hours would spend as long to find them as to relight."""


class SkyPattern(Protocol):
    """A sky's relative luminance; its scale is arbitrary."""

    @property
    def depends_on_sun(self) -> bool:
        """Whether the luminance changes with the position of the sun."""

    def relative_luminance(self, sin_altitude: Floats, cos_sun_angle: Floats) -> Floats:
        """Relative luminance at altitudes above 0 and cosines of the angle from the sun (equal shapes and precision in
        and out)."""

    def formula(self) -> Formula | None:
        """The same as parameters; None where they would not say all of it."""


@dataclass(frozen=True)
class SkyModel:
    """`scale` [cd/m²] times a pattern, around the sun at the unit vector `sun_direction`. No beam is part of it."""

    pattern: SkyPattern
    sun_direction: Vector
    scale: float

    def luminance(self, directions: Floats) -> Floats:
        """Luminance [cd/m²] in unit directions (N, 3) -> (N,), in their precision; 0 below the horizon."""
        if self.scale == 0:
            return np.zeros(len(directions), dtype=directions.dtype)
        is_up = directions[:, 2] >= 0
        if is_up.all():
            return self._luminance_above(directions)
        result = np.zeros(len(directions), dtype=directions.dtype)
        result[is_up] = self._luminance_above(directions[is_up])
        return result

    def _luminance_above(self, directions: Floats) -> Floats:
        cos_sun_angle = directions @ np.array(self.sun_direction, dtype=directions.dtype)
        relative: Floats = self.pattern.relative_luminance(directions[:, 2], cos_sun_angle)
        return self.scale * relative

    def formula(self) -> Formula | None:
        """The luminance as parameters, its level in k, c and e; None: the pattern has none."""
        relative = self.pattern.formula()
        if relative is None:
            return None
        a, b, c, d, e, k = relative
        return a, b, self.scale * c, d, self.scale * e, self.scale * k

    def horizontal_illuminance(self) -> float:
        """Illuminance of the unobstructed horizontal plane by the sky alone [lx]."""
        return self.scale * relative_horizontal_illuminance(self.pattern, math.asin(self.sun_direction[2]))


def relative_zenith_luminance(pattern: SkyPattern, sun_altitude_rad: float) -> float:
    """The pattern's value at the zenith."""
    return float(pattern.relative_luminance(np.array([1.0]), np.array([math.sin(sun_altitude_rad)]))[0])


def relative_horizontal_illuminance(pattern: SkyPattern, sun_altitude_rad: float) -> float:
    """Integral of the pattern x sin(altitude) over the hemisphere [sr], by Gauss-Legendre quadrature.

    The altitude range is split at the sun and azimuth counted from it, so that the cusp of the indicatrix falls on a
    corner of the panels, where the nodes crowd.
    """
    node, weight = (NODES + 1) / 2, WEIGHTS / 2
    split = min(max(sun_altitude_rad, 0.0), math.pi / 2)
    altitude = np.concatenate([split * node, split + (math.pi / 2 - split) * node])
    altitude_weight = np.concatenate([split * weight, (math.pi / 2 - split) * weight])
    sine, cosine = np.sin(altitude)[:, None], np.cos(altitude)[:, None]
    cos_sun_angle = sine * math.sin(sun_altitude_rad) + cosine * math.cos(sun_altitude_rad) * np.cos(math.pi * node)
    relative = pattern.relative_luminance(np.broadcast_to(sine, cos_sun_angle.shape), cos_sun_angle)
    return float(2 * math.pi * (altitude_weight @ (relative * sine * cosine) @ weight))

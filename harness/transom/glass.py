"""Glass: the one angular transmittance and reflectance of a clear pane that every renderer uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError

if TYPE_CHECKING:
    from transom.scene.model import Opening

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

REFRACTIVE_INDEX = 1.52
"""Soda-lime float glass in the visible, relative to air, unitless."""

NORMAL_REFLECTANCE = ((REFRACTIVE_INDEX - 1.0) / (REFRACTIVE_INDEX + 1.0)) ** 2
"""Fresnel reflectance of one surface at normal incidence."""

MAX_TRANSMITTANCE = (1.0 - NORMAL_REFLECTANCE) / (1.0 + NORMAL_REFLECTANCE)
"""Visible transmittance at normal incidence of a pane that absorbs nothing, 0.9183: no single pane passes more."""

TABLE_SIZE = 1025
"""Entries of the transmittance table: cos(theta) = i / 1024."""


def pane(transmittance: float, cos_theta: Float64) -> tuple[Float64, Float64]:
    """Transmittance and reflectance of a single pane for unpolarised light, all inter-reflections included.

    transmittance: normal-hemispherical, at normal incidence, 0..MAX_TRANSMITTANCE; it fixes the internal absorption.
    cos_theta: cosines of the angle of incidence, any shape, 0..1. Returns two arrays of that shape.
    With r the Fresnel reflectance of one surface and a the internal transmittance of one crossing, each of the two
    polarisations has T = (1 - r)² a / (1 - r² a²) and R = r (1 + a T); a = a0^(1 / cos(refracted angle)).
    Raises InputError when no pane of this refractive index can have that transmittance.
    """
    absorption_base = _internal_transmittance(transmittance)
    cosine = np.asarray(cos_theta, dtype=np.float64)
    refracted = np.sqrt(1.0 - (1.0 - cosine**2) / REFRACTIVE_INDEX**2)
    crossing = absorption_base ** (1.0 / refracted)
    r_s = ((cosine - REFRACTIVE_INDEX * refracted) / (cosine + REFRACTIVE_INDEX * refracted)) ** 2
    r_p = ((REFRACTIVE_INDEX * cosine - refracted) / (REFRACTIVE_INDEX * cosine + refracted)) ** 2
    passed, returned = np.zeros_like(cosine), np.zeros_like(cosine)
    for r in (r_s, r_p):
        # At grazing incidence r = 1, and T is 0 also where a = 1 makes the quotient 0 / 0.
        denominator = 1.0 - (r * crossing) ** 2
        share = np.where(denominator > 0.0, (1.0 - r) ** 2 * crossing / np.where(denominator > 0, denominator, 1), 0.0)
        passed += 0.5 * share
        returned += 0.5 * r * (1.0 + crossing * share)
    return passed, returned


def transmittance_table(opening: Opening) -> Float32:
    """Directional transmittance of the opening at cos(theta) = i / 1024, shape (1025,), 0..1.

    theta is the angle of incidence outside the pane. Every renderer interpolates linearly (`transmittance`).
    Unglazed openings pass everything, products nothing straight: what they pass is in transom.fenestration.
    Raises InputError for a transmittance that a pane cannot have.
    """
    if opening.glazing == "product":
        return np.zeros(TABLE_SIZE, dtype=np.float32)
    if opening.glazing == "none":
        return np.ones(TABLE_SIZE, dtype=np.float32)
    cosine = np.linspace(0.0, 1.0, TABLE_SIZE)
    return pane(opening.visible_transmittance, cosine)[0].astype(np.float32)


def transmittance(table: Float32, cos_theta: Float64) -> Float64:
    """Linear interpolation of `transmittance_table` at cosines of any shape; values outside 0..1 are clamped."""
    position = np.linspace(0.0, 1.0, len(table))
    return np.asarray(np.interp(np.asarray(cos_theta, dtype=np.float64), position, table.astype(np.float64)))


def diffuse_transmittance(opening: Opening) -> float:
    """Hemispherical-hemispherical transmittance of the opening, 2 ∫ T(c) c dc over its table, 0..1."""
    cosine = np.linspace(0.0, 1.0, TABLE_SIZE)
    table = transmittance_table(opening).astype(np.float64)
    # The table is linear between its entries and c is linear too: Simpson's rule is exact for their product.
    middle_table, middle_cosine = 0.5 * (table[1:] + table[:-1]), 0.5 * (cosine[1:] + cosine[:-1])
    simpson = table[1:] * cosine[1:] + table[:-1] * cosine[:-1] + 4.0 * middle_table * middle_cosine
    return float(2.0 * simpson.sum() / (6.0 * (TABLE_SIZE - 1)))


def diffuse_reflectance(opening: Opening) -> float:
    """Hemispherical-hemispherical reflectance of the pane, 2 ∫ R(c) c dc, 0..1; 0 for an unglazed opening.

    The room side reflects this much, diffusely, in the engine and in the matched reference.
    """
    if opening.glazing == "none":
        return 0.0
    node, weight = np.polynomial.legendre.leggauss(256)
    cosine = 0.5 * (node + 1.0)
    reflectance = pane(opening.visible_transmittance, cosine)[1]
    return float(np.sum(weight * reflectance * cosine))


def _internal_transmittance(transmittance: float) -> float:
    """Share of light that one crossing at normal incidence leaves: a0 from T(0), a quadratic in a."""
    if not 0.0 <= transmittance <= MAX_TRANSMITTANCE:
        raise InputError(
            f"is outside 0..{MAX_TRANSMITTANCE:.4f}: a single pane of refractive index {REFRACTIVE_INDEX} "
            "passes no more at normal incidence",
            field="visible_transmittance",
            value=transmittance,
            remedy='Use at most 0.918, or glazing = "none" for an unglazed hole',
        )
    surface = (1.0 - NORMAL_REFLECTANCE) ** 2
    root = np.sqrt(surface**2 + 4.0 * (transmittance * NORMAL_REFLECTANCE) ** 2)
    return float(min(2.0 * transmittance / (root + surface), 1.0))

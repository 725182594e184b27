"""Colour: linear RGB with Rec. 709 primaries and white D65, whose Y carries lx, cd/m² or cd."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from transom.errors import InputError

Float64 = NDArray[np.float64]

LUMINANCE_WEIGHTS: Float64 = np.array([0.2126390058715103, 0.7151686787677559, 0.0721923153607337])
"""Y of linear Rec. 709 RGB: the middle row of colour-science's derived RGB-to-XYZ matrix of "ITU-R BT.709". Sums to 1.

Stated here because importing colour-science takes seconds; a test holds the two equal.
"""
LUMINANCE_WEIGHTS.setflags(write=False)

MIN_TEMPERATURE_K, MAX_TEMPERATURE_K = 1000.0, 25000.0
DAYLIGHT_LOCUS_FROM_K = 4000.0  # CIE 015: the D illuminants are defined from 4000 K to 25,000 K.


def luminance(rgb: ArrayLike) -> Float64:
    """Y of linear RGB, shape (..., 3) -> (...), in the unit that the RGB carries."""
    weighted: Float64 = np.asarray(rgb, dtype=np.float64) @ LUMINANCE_WEIGHTS
    return weighted


def rgb_of_temperature(kelvin: float, field: str = "colour temperature") -> Float64:
    """Linear RGB (3,) with Y = 1 of a light of that correlated colour temperature [K, 1000 to 25,000].

    A blackbody below 4000 K, the CIE daylight locus from 4000 K up (CIE 015; through colour-science). The two curves do
    not meet: the chromaticity steps at 4000 K. A colour outside the gamut (below about 1900 K) is clipped at zero and
    scaled back to Y = 1, so that luminance is kept and only saturation is lost. Raises InputError, naming `field`,
    outside the range.
    """
    if not MIN_TEMPERATURE_K <= kelvin <= MAX_TEMPERATURE_K:
        raise InputError(
            f"is outside {MIN_TEMPERATURE_K:.0f} to {MAX_TEMPERATURE_K:.0f} K",
            field=field,
            value=kelvin,
            remedy="A low sun is about 3500 K, noon sun about 5500 K, an overcast sky about 6500 K",
        )
    return np.array(_rgb_of_temperature(float(kelvin)))


@lru_cache(maxsize=64)
def _rgb_of_temperature(kelvin: float) -> tuple[float, float, float]:
    with np.printoptions():  # colour-science changes them on import.
        import colour  # Takes seconds: imported by those who ask for a colour temperature only.

    if kelvin < DAYLIGHT_LOCUS_FROM_K:
        xyz = colour.sd_to_XYZ(colour.sd_blackbody(kelvin, colour.SPECTRAL_SHAPE_DEFAULT))
    else:
        xyz = colour.xy_to_XYZ(colour.temperature.CCT_to_xy_CIE_D(kelvin))
    rgb = np.linalg.inv(colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ) @ np.asarray(xyz)
    rgb = np.maximum(rgb, 0.0)
    red, green, blue = (rgb / luminance(rgb)).tolist()
    return red, green, blue

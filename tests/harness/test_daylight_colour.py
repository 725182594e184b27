"""Colour: luminance weights, and lights of a colour temperature with unit luminance."""

from __future__ import annotations

import colour
import numpy as np
import pytest

from transom.colour import LUMINANCE_WEIGHTS, luminance, rgb_of_temperature
from transom.errors import InputError


def test_luminance_weights_are_those_of_rec_709() -> None:
    matrix = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ
    assert pytest.approx(matrix[1], abs=1e-12) == LUMINANCE_WEIGHTS
    assert LUMINANCE_WEIGHTS.sum() == pytest.approx(1.0, abs=1e-12)


def test_luminance_keeps_the_leading_shape() -> None:
    image = np.ones((4, 5, 3), dtype=np.float32)
    assert luminance(image).shape == (4, 5)
    assert luminance([2.0, 2.0, 2.0]) == pytest.approx(2.0)


@pytest.mark.parametrize("kelvin", [1000, 1800, 2500, 3999, 4000, 5500, 6500, 12000, 25000])
def test_every_colour_temperature_has_unit_luminance_and_no_negative_part(kelvin: float) -> None:
    rgb = rgb_of_temperature(kelvin)
    assert luminance(rgb) == pytest.approx(1.0, abs=1e-12)
    assert (rgb >= 0).all()


def test_6504_kelvin_is_white() -> None:
    """D65 is the daylight illuminant of 6504 K; the standard's rounded chromaticity differs by 1e-4."""
    assert rgb_of_temperature(6504) == pytest.approx([1.0, 1.0, 1.0], abs=2e-3)
    assert rgb_of_temperature(6500) == pytest.approx([1.0, 1.0, 1.0], abs=3e-3)


def test_lower_is_warmer() -> None:
    red_over_blue = [
        rgb[0] / max(rgb[2], 1e-9) for rgb in map(rgb_of_temperature, (2500, 3500, 4500, 6500, 10000, 20000))
    ]
    assert red_over_blue == sorted(red_over_blue, reverse=True)


def test_blackbody_has_the_published_chromaticity() -> None:
    """Illuminant A, 2856 K: x = 0.44758, y = 0.40745 (CIE 015); blackbody and c2 of today differ by 1e-4."""
    matrix = colour.RGB_COLOURSPACES["ITU-R BT.709"].matrix_RGB_to_XYZ
    xyz = matrix @ rgb_of_temperature(2856)
    assert xyz[:2] / xyz.sum() == pytest.approx([0.44758, 0.40745], abs=3e-4)


@pytest.mark.parametrize("kelvin", [0, 999, 25001, float("nan")])
def test_a_temperature_outside_the_curves_is_refused(kelvin: float) -> None:
    with pytest.raises(InputError, match=r"sun_colour_temperature_k = .* 1000 to 25000 K"):
        rgb_of_temperature(kelvin, "sun_colour_temperature_k")

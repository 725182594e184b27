"""The sky patterns: closed forms and tabulated integrals, rotation, clamps, and the short names of skies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from transom.daylight.cie_sky import CieSky
from transom.daylight.perez_sky import (
    clearness_and_brightness,
    distance_factor,
    luminous_efficacies,
    perez_sky,
)
from transom.daylight.sky_choice import SkyChoice, parse_sky
from transom.daylight.sky_model import SkyModel, relative_horizontal_illuminance, relative_zenith_luminance
from transom.errors import InputError

ALTITUDES_DEG = (15, 30, 45, 60, 75)
HORIZONTAL_OVER_ZENITH = {
    1: (2.4495, 2.4495, 2.4495, 2.4495, 2.4495),
    2: (2.6615, 2.5566, 2.3635, 2.0860, 1.7464),
    3: (2.7700, 2.7700, 2.7700, 2.7700, 2.7700),
    4: (3.0298, 2.8901, 2.6467, 2.3154, 1.9268),
    5: (math.pi, math.pi, math.pi, math.pi, math.pi),
    6: (3.4558, 3.2778, 2.9775, 2.5842, 2.1385),
    7: (3.9021, 3.6730, 3.1431, 2.4212, 1.6713),
    8: (4.4211, 4.1231, 3.3387, 2.3284, 1.4030),
    9: (4.8652, 4.5528, 4.0587, 3.4593, 2.8266),
    10: (5.5937, 5.1449, 4.2534, 3.1703, 2.1391),
    11: (6.4517, 5.8176, 4.4854, 2.9891, 1.7468),
    12: (7.2048, 6.3941, 4.8485, 3.1906, 1.8505),
    13: (8.0730, 6.9952, 4.9827, 3.0259, 1.6309),
    14: (9.1176, 7.7081, 5.3753, 3.2170, 1.7195),
    15: (10.3380, 8.1160, 5.2711, 3.0159, 1.5926),
}
"""Horizontal illuminance over zenith luminance [sr], by a 720 x 1440 midpoint rule of a separate program."""


def sky_around(pattern: CieSky, altitude_deg: float, azimuth_deg: float = 0.0, scale: float = 1.0) -> SkyModel:
    altitude, azimuth = math.radians(altitude_deg), math.radians(azimuth_deg)
    across = math.cos(altitude)
    return SkyModel(pattern, (across * math.cos(azimuth), across * math.sin(azimuth), math.sin(altitude)), scale)


@pytest.mark.parametrize("cie_type", HORIZONTAL_OVER_ZENITH)
def test_horizontal_illuminance_over_zenith_luminance_is_the_tabulated(cie_type: int) -> None:
    """Four decimals: half a unit of the last, and as much again for the table's midpoint rule at the sun's cusp."""
    for altitude_deg, expected in zip(ALTITUDES_DEG, HORIZONTAL_OVER_ZENITH[cie_type], strict=True):
        altitude = math.radians(altitude_deg)
        ratio = relative_horizontal_illuminance(CieSky(cie_type), altitude) / relative_zenith_luminance(
            CieSky(cie_type), altitude
        )
        assert ratio == pytest.approx(expected, abs=1e-4)


def test_traditional_overcast_sky_gives_seven_ninths_pi() -> None:
    ratio = relative_horizontal_illuminance(CieSky(16), 0.5)
    assert ratio == pytest.approx(7 * math.pi / 9, rel=1e-10)


@pytest.mark.parametrize("cie_type", [1, 3, 5, 16])
def test_overcast_and_uniform_skies_know_no_sun(cie_type: int) -> None:
    directions = np.array([[0.6, 0.0, 0.8], [0.0, -0.8, 0.6], [0.0, 0.0, 1.0]])
    low, high = (sky_around(CieSky(cie_type), degrees).luminance(directions) for degrees in (-20, 60))
    assert not CieSky(cie_type).depends_on_sun
    assert np.array_equal(low, high)


def test_sky_is_black_below_the_horizon_and_lit_on_it() -> None:
    sky = sky_around(CieSky(12), 30, scale=1000.0)
    level, below, nadir = sky.luminance(np.array([[1.0, 0.0, 0.0], [1.0, 0.0, -1e-6], [0.0, 0.0, -1.0]]))
    assert level == pytest.approx(
        1000 * (1 + 10 * (math.exp(-math.pi / 2) - math.exp(-1.5 * math.pi)) + 0.45 * math.cos(math.pi / 6) ** 2)
    )
    assert (below, nadir) == (0.0, 0.0)


@pytest.mark.parametrize("cie_type", [2, 8, 12, 15])
def test_luminance_turns_with_the_sun(cie_type: int) -> None:
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    turn = math.radians(77.0)
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1.0]])
    before = sky_around(CieSky(cie_type), 25, 40).luminance(directions)
    after = sky_around(CieSky(cie_type), 25, 40 + 77).luminance(directions @ rotation.T)
    assert after == pytest.approx(before, rel=1e-12)


def test_brightest_point_of_a_clear_sky_is_at_the_sun() -> None:
    sky = sky_around(CieSky(14), 35, 120)
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    at_sun = sky.luminance(np.array([sky.sun_direction]))[0]
    away = directions @ np.array(sky.sun_direction) < math.cos(math.radians(10))
    assert at_sun > sky.luminance(directions[away & (directions[:, 2] > 0.2)]).max()


def test_clearness_and_brightness_are_those_of_perez() -> None:
    """At the zenith: epsilon = (Ed + Es) / Ed, air mass 1 / (1 + 0.15 x 93.885^-1.253) = 0.99949."""
    clearness, brightness = clearness_and_brightness(300.0, 200.0, 0.0, 94)
    assert clearness == pytest.approx(2.5)
    assert brightness == pytest.approx(0.99949 * 200 / (1367 * distance_factor(94)), rel=1e-4)


def test_distance_factor_is_largest_in_early_january() -> None:
    """Perihelion at 0.98329 au: factor 1.0343 by Spencer's fit, good to 1e-3."""
    assert distance_factor(3) == pytest.approx(1 / 0.98329**2, abs=1.5e-3)
    assert distance_factor(185) == pytest.approx(1 / 1.01671**2, abs=1.5e-3)


def test_clearness_and_brightness_are_clamped_to_the_model() -> None:
    assert clearness_and_brightness(1300.0, 5.0, 0.3, 100)[0] < 12.01
    assert clearness_and_brightness(0.0, 1.0, 0.3, 100) == (1.0, 0.01)
    assert clearness_and_brightness(0.0, 1300.0, 0.3, 100) == (1.0, 0.6)


def test_a_thin_intermediate_sky_is_that_of_brightness_one_fifth() -> None:
    assert perez_sky(1.3, 0.05, 0.8) == perez_sky(1.3, 0.2, 0.8)
    assert perez_sky(3.0, 0.05, 0.8) != perez_sky(3.0, 0.2, 0.8)


def test_perez_luminance_is_never_negative() -> None:
    """In the second bin a < -1 for a bright sky, and the formula dips below zero at the zenith."""
    sine = np.linspace(0.01, 1.0, 50)
    for clearness in (1.03, 1.15, 1.4, 1.7, 2.3, 3.5, 5.0, 8.0):
        pattern = perez_sky(clearness, 0.2, math.radians(50))
        assert (pattern.relative_luminance(sine, np.cos(np.arccos(sine) - math.radians(50))) >= 0).all()


def test_luminous_efficacies_are_those_of_daylight() -> None:
    """Clear sky, sun at 45 degrees: a beam of about 100 lm/W, a blue sky of about 130 lm/W [Littlefair 1985]."""
    direct, diffuse = luminous_efficacies(8.0, 0.12, math.radians(45))
    assert 95 < direct < 110
    assert 120 < diffuse < 145


def test_short_names_of_skies() -> None:
    assert parse_sky("clear") == parse_sky("cie:12") == SkyChoice("cie", cie_type=12)
    assert parse_sky("overcast") == SkyChoice("cie", cie_type=1)
    assert parse_sky("uniform") == SkyChoice("cie", cie_type=5)
    assert parse_sky("none") == SkyChoice("none")
    assert parse_sky("perez:600,120") == SkyChoice("perez", direct_normal_w_m2=600, diffuse_horizontal_w_m2=120)


@pytest.mark.parametrize(
    "text",
    ["", "cloudy", "cie", "cie:", "cie:0", "cie:17", "cie:-1", "cie:1.5", "cie:²", "perez", "perez:600", "perez:600,x",
     "perez:600,120,3", "perez:-1,100", "perez:100,0", "perez:nan,100", "perez:5000,100",
     "none:1", "clear:2", "CIE:12"],
)  # fmt: skip
def test_a_sky_that_is_not_one_is_refused_with_what_is_allowed(text: str) -> None:
    with pytest.raises(InputError, match=r"--sky = .*\. .*(cie:1|DHI above 0)"):
        parse_sky(text, "--sky")

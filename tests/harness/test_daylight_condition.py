"""Conditions: levels, colours, the sun below the horizon, keys, and errors that name their field."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from transom.colour import luminance
from transom.daylight import Condition, resolve_condition
from transom.errors import InputError
from transom.scene.model import ConditionSpec, Site

SITE = Site("London", math.radians(51.5), math.radians(-0.12), 0.0)
DAY = ConditionSpec("day", "2026-03-21T10:00")
NIGHT = replace(DAY, name="night", time="2026-03-21T22:00")


def horizontal_illuminance(condition: Condition) -> float:
    """By a plain midpoint rule, one degree apart: good to 1e-4 but beside the sun."""
    altitude = np.radians(np.arange(90) + 0.5)[:, None]
    azimuth = np.radians(np.arange(360) + 0.5)
    directions = np.stack(
        [np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude) + 0 * azimuth],
        axis=-1,
    ).reshape(-1, 3)
    values = condition.sky.luminance(directions).reshape(90, 360) * np.sin(altitude) * np.cos(altitude)
    return float(values.sum() * math.radians(1) ** 2)


@pytest.mark.parametrize("sky", ["cie:1", "cie:5", "cie:7", "cie:12", "cie:15", "cie:16", "perez:600,120"])
def test_given_horizontal_illuminance_is_kept(sky: str) -> None:
    condition = resolve_condition(replace(DAY, sky=sky, diffuse_horizontal_illuminance_lx=12_345.0), SITE)
    assert condition.diffuse_horizontal_lx == pytest.approx(12_345.0, rel=1e-12)
    assert horizontal_illuminance(condition) == pytest.approx(12_345.0, rel=1e-3)


@pytest.mark.parametrize("sky", ["cie:1", "cie:12", "cie:15", "cie:16", "perez:600,120"])
def test_given_zenith_luminance_is_kept(sky: str) -> None:
    condition = resolve_condition(replace(DAY, sky=sky, zenith_luminance_cd_m2=3000.0), SITE)
    assert condition.sky.luminance(np.array([[0.0, 0.0, 1.0]])) == pytest.approx([3000.0], rel=1e-12)
    assert horizontal_illuminance(condition) == pytest.approx(condition.diffuse_horizontal_lx, rel=1e-3)


def test_availability_model_gives_the_published_levels() -> None:
    """IES RP-21 at the sun's 32.19 degrees on day 80: E_xt = 128 klx x 1.0075, c = 0.21; 0.8 + 15.5 sin^0.5 klx."""
    condition = resolve_condition(DAY, SITE)
    sine = math.sin(condition.sun.altitude_rad)
    extraterrestrial = 128_000 * (1 + 0.034 * math.cos(2 * math.pi * 78 / 365))
    assert condition.direct_normal_lx == pytest.approx(extraterrestrial * math.exp(-0.21 / sine))
    assert condition.diffuse_horizontal_lx == pytest.approx(800 + 15_500 * math.sqrt(sine))
    overcast = resolve_condition(replace(DAY, sky="overcast"), SITE)
    assert (overcast.direct_normal_lx, overcast.sun_direction) == (0.0, None)
    assert overcast.diffuse_horizontal_lx == pytest.approx(300 + 21_000 * sine)


def test_perez_levels_are_irradiance_times_efficacy_and_can_be_overridden() -> None:
    condition = resolve_condition(replace(DAY, sky="perez:600,120"), SITE)
    assert 90 < condition.direct_normal_lx / 600 < 105
    assert 120 < condition.diffuse_horizontal_lx / 120 < 155
    given = replace(DAY, sky="perez:600,120", direct_normal_illuminance_lx=50_000.0)
    assert resolve_condition(given, SITE).direct_normal_lx == 50_000.0


def test_colour_temperature_changes_chromaticity_and_keeps_luminance() -> None:
    white = resolve_condition(DAY, SITE)
    warm = resolve_condition(replace(DAY, sun_colour_temperature_k=2500, sky_colour_temperature_k=9000), SITE)
    assert luminance(warm.sun_illuminance_rgb) == pytest.approx(luminance(white.sun_illuminance_rgb))
    assert luminance(warm.ground_luminance_rgb) == pytest.approx(luminance(white.ground_luminance_rgb))
    assert luminance(warm.sky_rgb) == pytest.approx(1.0)
    assert warm.sun_illuminance_rgb[0] > 2 * warm.sun_illuminance_rgb[2]
    assert warm.sky_rgb[2] > warm.sky_rgb[0]


def test_ground_reflects_the_global_horizontal_illuminance() -> None:
    condition = resolve_condition(replace(DAY, ground_albedo=0.3), SITE)
    assert condition.sun_direction is not None
    total = condition.direct_normal_lx * condition.sun_direction[2] + condition.diffuse_horizontal_lx
    assert condition.ground_luminance_rgb == pytest.approx(np.full(3, 0.3 * total / math.pi))


def test_sky_keeps_the_suns_place_without_a_beam() -> None:
    shaded = resolve_condition(replace(DAY, direct_normal_illuminance_lx=0.0), SITE)
    sunny = resolve_condition(DAY, SITE)
    directions = np.array([[0.6, -0.6, math.sqrt(0.28)], [-0.6, 0.6, math.sqrt(0.28)]])
    assert shaded.sun_direction is None
    assert not shaded.sun_illuminance_rgb.any()
    assert np.array_equal(shaded.sky.luminance(directions), sunny.sky.luminance(directions))


@pytest.mark.parametrize("sky", ["clear", "overcast", "cie:7", "cie:16", "perez:600,120", "none"])
def test_night_is_dark(sky: str) -> None:
    condition = resolve_condition(replace(NIGHT, sky=sky), SITE)
    assert condition.sun.altitude_rad < 0
    assert condition.sun_direction is None
    assert not condition.environment_image(16).any()


@pytest.mark.parametrize("sky", ["cie:1", "cie:3", "uniform", "cie:16"])
def test_a_level_lights_a_sky_that_knows_no_sun_at_any_hour(sky: str) -> None:
    condition = resolve_condition(replace(NIGHT, sky=sky, diffuse_horizontal_illuminance_lx=10_000.0), SITE)
    assert condition.sun_direction is None
    assert horizontal_illuminance(condition) == pytest.approx(10_000, rel=1e-3)


def test_no_sky_means_no_light_by_day_either() -> None:
    condition = resolve_condition(replace(DAY, sky="none"), SITE)
    assert condition.sun_direction is None
    assert (condition.direct_normal_lx, condition.diffuse_horizontal_lx) == (0.0, 0.0)
    assert not condition.environment_image(16).any()


def test_a_sun_in_a_black_sky_can_be_had() -> None:
    spec = replace(DAY, sky="uniform", diffuse_horizontal_illuminance_lx=0.0, direct_normal_illuminance_lx=80_000.0)
    condition = resolve_condition(spec, SITE)
    assert condition.sun_direction is not None
    assert luminance(condition.sun_illuminance_rgb) == pytest.approx(80_000.0)
    assert not condition.sky.luminance(np.array([[0.0, 0.0, 1.0]])).any()


def test_equal_light_has_an_equal_key() -> None:
    key = resolve_condition(DAY, SITE).key()
    assert key == resolve_condition(replace(DAY, name="other", sky="clear"), replace(SITE, name="elsewhere")).key()
    assert key == resolve_condition(replace(DAY, time="2026-03-21T11:00"), replace(SITE, time_zone_h=1.0)).key()
    overcast = replace(DAY, sky="overcast", diffuse_horizontal_illuminance_lx=10_000.0)
    later = replace(overcast, time="2026-03-21T14:00")
    assert resolve_condition(overcast, SITE).key() == resolve_condition(later, SITE).key()


def test_different_light_has_a_different_key() -> None:
    specs = [
        DAY,
        replace(DAY, time="2026-03-21T10:01"),
        replace(DAY, sky="cie:13"),
        replace(DAY, sky="perez:600,120"),
        replace(DAY, ground_albedo=0.21),
        replace(DAY, direct_normal_illuminance_lx=0.0),
        replace(DAY, direct_normal_illuminance_lx=80_000.0),
        replace(DAY, zenith_luminance_cd_m2=3000.0),
        replace(DAY, sun_colour_temperature_k=3000.0),
        replace(DAY, sky_colour_temperature_k=9000.0),
        replace(DAY, sky="none"),
    ]
    assert len({resolve_condition(spec, SITE).key() for spec in specs}) == len(specs)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sky": "cie:17"}, r"conditions\.day\.sky = 'cie:17' is not a CIE sky"),
        ({"time": "10 o'clock"}, r"conditions\.day\.time = .* is not a time"),
        ({"ground_albedo": 1.5}, r"conditions\.day\.ground_albedo = 1\.5 is outside 0\.\.1"),
        ({"zenith_luminance_cd_m2": -1.0}, r"zenith_luminance_cd_m2 = -1\.0 must be a number of at least 0"),
        ({"direct_normal_illuminance_lx": math.nan}, r"direct_normal_illuminance_lx = nan must be"),
        ({"zenith_luminance_cd_m2": 1.0, "diffuse_horizontal_illuminance_lx": 1.0}, r"both set the level"),
        ({"sun_colour_temperature_k": 100.0}, r"conditions\.day\.sun_colour_temperature_k = 100\.0 is outside"),
        ({"sky": "none", "direct_normal_illuminance_lx": 5.0}, r"gives light to sky = \"none\""),
        ({"time": "2026-03-21T22:00", "direct_normal_illuminance_lx": 5.0}, r"needs a sun above the horizon"),
        ({"time": "2026-03-21T22:00", "zenith_luminance_cd_m2": 5.0}, r"needs a sun above the horizon; .* -31\.\d deg"),
    ],
)
def test_a_bad_condition_is_refused_by_field(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        resolve_condition(replace(DAY, **changes), SITE)  # type: ignore[arg-type]

"""Sub-suns: where they stand, what they carry, how many a scene asks for, and how they are chosen by name."""

from __future__ import annotations

import math

import numpy as np
import pytest

from transom.daylight.sun_disc import (
    AUTO_COUNTS,
    COUNTS,
    DISC_COUNT,
    MOST_PLACES,
    SUN_RADIUS_RAD,
    TOLERANCE,
    SunPlan,
    parse_sun,
    plan_sun,
    sub_sun_illuminance,
    sub_suns,
)
from transom.errors import InputError

SUNS = [np.array(sun) / np.linalg.norm(sun) for sun in ((0.0, 0.0, 1.0), (0.3, -1.0, 0.5), (-1.0, 0.2, 0.01))]


@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize("count", COUNTS)
def test_sub_suns_are_unit_vectors_on_the_disc_around_the_sun(sun: np.ndarray, count: int) -> None:
    found = sub_suns(sun, count)
    assert found.shape == (count, 3)
    assert np.linalg.norm(found, axis=1) == pytest.approx(1, abs=1e-12)
    angles = np.arcsin(np.linalg.norm(np.cross(found, sun), axis=1))
    assert angles.max() < SUN_RADIUS_RAD
    mean = found.mean(axis=0)
    assert mean / np.linalg.norm(mean) == pytest.approx(sun, abs=1e-12)


@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize("count", COUNTS)
def test_surfaces_that_see_the_whole_disc_receive_exactly_the_suns_light(sun: np.ndarray, count: int) -> None:
    illuminance = np.array([5e4, 6e4, 7e4])
    flux = sub_suns(sun, count).sum(axis=0)[:, None] * sub_sun_illuminance(illuminance, count)
    assert flux == pytest.approx(sun[:, None] * illuminance, rel=1e-12, abs=1e-6)


@pytest.mark.parametrize("count", COUNTS[1:])
def test_sub_suns_are_spread_as_the_light_of_a_uniform_disc(count: int) -> None:
    """Second moment about every axis: a quarter of the squared radius, within what rings at their middles leave."""
    sun = SUNS[1]
    right = np.cross([0.0, 0.0, 1.0], sun) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], sun))
    beside = sub_suns(sun, count) / SUN_RADIUS_RAD
    for turn in np.linspace(0, math.pi, 24):
        axis = math.cos(turn) * right + math.sin(turn) * np.cross(sun, right)
        assert ((beside @ axis) ** 2).mean() == pytest.approx(0.25, abs=0.3 / count**2 + 1e-5)


@pytest.mark.parametrize("count", COUNTS[1:])
def test_half_planes_in_every_orientation_hold_their_share_of_sub_suns(count: int) -> None:
    """Turned about the sun, the pattern answers alike: any straight edge errs by 1.2 N^(-3/4) at most. Rings that are
    not turned against each other err by 1.4 to 1.5 times that from 37 on."""
    sun = np.array([0.0, 0.0, 1.0])
    beside = sub_suns(sun, count)[:, :2] / SUN_RADIUS_RAD
    offset = np.linspace(-1, 1, 801)
    exact = 0.5 + (np.arcsin(offset) + offset * np.sqrt(1 - offset**2)) / math.pi
    worst = 0.0
    for turn in np.linspace(0, math.pi, 180, endpoint=False):
        along = np.sort(beside @ [math.cos(turn), math.sin(turn)])
        worst = max(worst, float(np.abs(np.searchsorted(along, offset, side="right") / count - exact).max()))
    assert worst <= 1.2 * count**-0.75


def test_pattern_turns_about_the_zenith_with_the_sun() -> None:
    for turn in (0.3, 2.0, -1.1):
        matrix = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
        assert sub_suns(matrix @ SUNS[1], 19) == pytest.approx(sub_suns(SUNS[1], 19) @ matrix.T, abs=1e-14)


def test_names_of_suns() -> None:
    assert parse_sun("point") == 1
    assert parse_sun("disc") == DISC_COUNT
    assert parse_sun("disc:37") == 37
    assert parse_sun("auto") == "auto"


@pytest.mark.parametrize("text", ["disc:1", "disc:8", "disc:", "disc:-7", "sharp", "", "auto:7", "point:1"])
def test_other_names_are_refused_with_those_that_there_are(text: str) -> None:
    with pytest.raises(InputError, match=r"--sun.*disc:N.*7, 19, 37"):
        parse_sun(text, "--sun")


def test_a_count_that_fills_no_rings_is_refused() -> None:
    with pytest.raises(InputError, match="8"):
        sub_suns(SUNS[0], 8)


def behind_blades(pitch: float, open_share: float = 0.5) -> SunPlan:
    """The plan of places behind a grating: period `pitch` as seen on the disc, in its radii."""
    sun = np.array([0.0, 0.0, 1.0])
    phase = np.linspace(0, 1, 200, endpoint=False)
    asked: list[int] = []

    def shares(directions: np.ndarray, places: np.ndarray) -> np.ndarray:
        asked.append(len(directions) * len(places))
        at = directions[:, 0] / SUN_RADIUS_RAD / pitch
        return ((phase[places, None] + at) % 1 < open_share).astype(np.float32)

    plan = plan_sun(sun, shares, np.ones(len(phase), dtype=np.float32))
    assert sum(asked) <= len(phase) * (19 + 127 + sum(AUTO_COUNTS))
    return plan


def test_wide_gaps_keep_a_point_and_narrow_ones_ask_for_more_sub_suns() -> None:
    """Gaps of 20 penumbra radii, of 3, and narrower than the disc."""
    plans = [behind_blades(pitch) for pitch in (40.0, 6.0, 1.2)]
    assert plans[0].sub_suns == 1 and plans[0].sub_sun_error == plans[0].point_sun_error <= TOLERANCE
    assert 1 < plans[1].sub_suns <= plans[2].sub_suns <= AUTO_COUNTS[-1]
    assert plans[0].penumbra_share < plans[1].penumbra_share < plans[2].penumbra_share
    for plan in plans[1:]:
        assert plan.point_sun_error > TOLERANCE >= plan.sub_sun_error


def test_point_error_of_a_plan_is_that_of_the_closed_form() -> None:
    """The integral over places of what a point errs by at an edge is the mean distance of the disc's points from its
    diameter: 4 / (3 pi) radii."""
    pitch = 8.0
    plan = behind_blades(pitch)
    per_edge = 4 / (3 * math.pi) / pitch
    assert plan.point_sun_error == pytest.approx(2 * per_edge / 0.5, rel=0.05)


def test_no_more_than_so_many_places_are_asked() -> None:
    most = 0

    def shares(directions: np.ndarray, places: np.ndarray) -> np.ndarray:
        nonlocal most
        most = max(most, len(places))
        return np.ones((len(places), len(directions)), dtype=np.float32)

    plan = plan_sun(SUNS[0], shares, np.ones(3 * MOST_PLACES - 1, dtype=np.float32))
    assert plan == SunPlan() and most == MOST_PLACES


def test_a_scene_without_places_has_a_point() -> None:
    def shares(directions: np.ndarray, places: np.ndarray) -> np.ndarray:
        return np.zeros((len(places), len(directions)), dtype=np.float32)

    assert plan_sun(SUNS[0], shares, np.zeros(0, dtype=np.float32)) == SunPlan()


def test_a_scene_without_sun_has_a_point() -> None:
    assert behind_blades(6.0, open_share=0.0) == SunPlan()

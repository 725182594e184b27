"""The engine with the sun as a disc: closed forms, what must not change, and how many sub-suns are enough."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from transom import _engine
from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.daylight.sun_disc import SUN_RADIUS_RAD, Sun, sub_sun_illuminance, sub_suns
from transom.engine import Engine, Visibility
from transom.engine_renderer import EngineRenderer
from transom.engine_scene import engine_condition
from transom.errors import InputError
from transom.fenestration.reglazing import reglazed
from transom.hard.changes import sunlit
from transom.hard.claims import QUICK, Case, Lit
from transom.hard.disc_cases import LOW_SUN, direct_share, disc_cases, penumbra_places, share_beyond
from transom.hard.rooms import ROOM_M, Point, Room, windowed_room
from transom.hard.shape_cases import louvre_room
from transom.hard.sun_cases import roof_light_room
from transom.scene.model import View

OVERHEAD: Point = (0.0, 0.0, 1.0)
EDGE = ((1.0, 1.5, ROOM_M[2]), (1.0, 3.5, ROOM_M[2]), (9.0, 2.5, ROOM_M[2]))


def lit(room: Room, towards: Point = LOW_SUN, sun: int = 1) -> Lit:
    return Lit(room, lambda condition: sunlit(condition, towards), sun=sun)


def from_window(width: int = 128, height: int = 96) -> View:
    """Of the floor and walls behind the window, where its light falls."""
    return View("back", (2.0, 0.3, 2.0), (2.0, 4.0, 0.8), (0.0, 0.0, 1.0), 1.0, width, height, 1000.0)


@pytest.mark.parametrize("case", disc_cases(), ids=lambda case: case.name)
def test_closed_forms_of_penumbras(case: Case) -> None:
    for claim in case.claims:
        if claim.name == "closed form":
            seen = claim.check()
            assert seen.holds, seen.text


def test_a_point_sun_fails_the_closed_form_of_an_edge() -> None:
    room = lit(roof_light_room(), OVERHEAD)
    points = penumbra_places(EDGE, np.array(OVERHEAD))
    error = np.abs(direct_share(room, points) - share_beyond(points, EDGE, np.array(OVERHEAD)))
    assert error.max() > 0.45


def test_penumbra_of_an_edge_converges_with_the_number_of_sub_suns() -> None:
    room = lit(roof_light_room(), OVERHEAD)
    points = penumbra_places(EDGE, np.array(OVERHEAD))
    exact = share_beyond(points, EDGE, np.array(OVERHEAD))
    errors = []
    for count in (1, 7, 19, 37, 127):
        room.engine.relight(room.condition, count)
        errors.append(float(np.abs(direct_share(room, points) - exact).mean()))
    assert errors[0] > 0.08 and all(finer < coarser for coarser, finer in pairwise(errors)), errors
    assert all(error < 0.12 * count**-0.75 for count, error in zip((7, 19, 37, 127), errors[1:], strict=True)), errors


def test_flux_through_a_slit_is_that_of_a_point() -> None:
    """Integrated over the whole of its penumbra: width times illuminance."""
    width = 0.012
    room = lit(roof_light_room((1.0, 1.0 + width)), OVERHEAD, sun=37)
    points = penumbra_places(EDGE, np.array(OVERHEAD))
    step = float(points[1, 0] - points[0, 0])
    assert direct_share(room, points).sum() * step == pytest.approx(width, rel=2e-3)


def test_places_that_see_the_whole_disc_have_exactly_the_light_of_a_point() -> None:
    room = lit(roof_light_room(), (0.2, 0.1, 0.9))
    points = np.array([[1.6, 2.4, z] for z in (0.2, 0.9, 1.7)])
    share = []
    for count in (1, 7, 37):
        room.engine.relight(room.condition, count)
        share.append(direct_share(room, points))
    assert share[0] == pytest.approx(1, abs=1e-6)
    assert share[1] == pytest.approx(share[0], rel=1e-6)
    assert share[2] == pytest.approx(share[0], rel=1e-6)


def test_one_sub_sun_is_the_point_bit_by_bit() -> None:
    room = lit(louvre_room(20))
    room.engine.relight(room.condition)
    first = room.engine.render(from_window()).radiance
    room.engine.relight(room.condition, 19)
    disc = room.engine.render(from_window()).radiance
    core = engine_condition(room.scene, room.condition, room.engine.sky, 1)
    sun = room.condition.sun_direction
    assert sun is not None
    core.add_sub_sun(tuple(sun.tolist()), tuple(room.condition.sun_illuminance_rgb.tolist()))
    room.engine._core.relight(core)
    assert np.array_equal(room.engine.render(from_window()).radiance, first)
    assert not np.array_equal(disc, first)


@pytest.mark.parametrize("visibility", ["rays", "volumes"])
def test_picture_behind_louvres_approaches_that_of_very_many_sub_suns(visibility: Visibility) -> None:
    """Mean error of the sun's part of the picture: a seventh of it with a point, below 1.5 and 1 % with 7 and 19."""
    room = lit(louvre_room(30))
    pictures = {}
    for count in (1, 7, 19, 127):
        room.engine.relight(room.condition, count)
        pictures[count] = luminance(room.engine.render(from_window(), visibility).components["sun"])
    error = {n: float(np.abs(pictures[n] - pictures[127]).mean() / pictures[127].mean()) for n in (1, 7, 19)}
    assert error[1] > 0.1 and error[7] < 0.015 and error[19] < 0.01, error
    for count in (7, 19):
        assert pictures[count].mean() == pytest.approx(pictures[127].mean(), rel=0.005)


def test_indirect_light_of_a_point_is_that_of_the_disc() -> None:
    """Elements receive the point's light: their irradiance by each of 19 sub-suns gives the same indirect light."""
    room = lit(louvre_room(30), sun=19)
    engine, condition = room.engine, room.condition
    of_point = room.measure()["indirect"]
    core = engine_condition(engine.scene, replace(condition, sun_direction=None), engine.sky, 1)
    assert condition.sun_direction is not None
    r, g, b = sub_sun_illuminance(condition.sun_illuminance_rgb, 19).tolist()
    for x, y, z in sub_suns(condition.sun_direction, 19).tolist():
        core.add_beam((x, y, z), (r, g, b))
    engine._core.relight(core)
    assert luminance(room.measure()["indirect"]) == pytest.approx(luminance(of_point), rel=3e-3)


def test_products_receive_a_point() -> None:
    """Behind a window that holds one, the picture is the same bit by bit, and not dark."""
    room = Lit(
        lambda: reglazed(windowed_room().load(), ["glass=laser_cut_panel"]),
        lambda condition: sunlit(condition, LOW_SUN),
        QUICK,
    )
    pictures = []
    for count in (1, 19):
        room.engine.relight(room.condition, count)
        pictures.append(room.engine.render(from_window()).components["sun"])
    assert pictures[0].max() > 0
    assert np.array_equal(*pictures)


def test_overcast_and_sunless_hours_have_no_sub_suns() -> None:
    engine = lit(windowed_room()).engine
    condition: Condition = replace(lit(windowed_room()).condition, sun_direction=None, sun_illuminance_rgb=np.zeros(3))
    suns: tuple[Sun, ...] = (19, "auto")
    for sun in suns:
        engine.relight(condition, sun)
        assert engine.present_sun.sub_suns == 1


def test_light_found_beside_the_drawing_has_its_sub_suns() -> None:
    room = lit(louvre_room(20))
    engine: Engine = room.engine
    engine.relight(room.condition, 7)
    expected = engine.render(from_window()).radiance
    engine.relight(room.condition)
    with engine.relighting() as relighting:
        relighting.begin(room.condition, 7)
        relighting.finish()
    assert engine.present_sun.sub_suns == 7
    assert np.array_equal(engine.render(from_window()).radiance, expected)


def test_plan_of_the_run_bundle_says_how_many_sub_suns_and_why() -> None:
    room = lit(louvre_room(30))
    options = {"sun": "auto", "target_patch_count": QUICK.target_patch_count}
    facts = EngineRenderer().render(room.scene, room.condition, from_window(8, 6), options).facts
    plan = facts["plan"]
    assert (
        plan["sub_suns"] > 1 and plan["point_sun_error"] > 0.1 >= plan["sub_sun_error"] and plan["penumbra_share"] > 0.3
    )
    plain = EngineRenderer().render(room.scene, room.condition, from_window(8, 6), {**options, "sun": "point"}).facts
    assert plain["plan"]["sub_suns"] == 1


def test_a_wrong_number_of_sub_suns_is_refused_and_keeps_the_light() -> None:
    room = lit(windowed_room())
    before = room.engine.render(from_window()).radiance
    with pytest.raises(InputError, match="8"):
        room.engine.relight(room.condition, 8)
    assert np.array_equal(room.engine.render(from_window()).radiance, before)


def test_a_sub_sun_that_is_no_light_is_refused() -> None:
    room = lit(windowed_room())
    core = engine_condition(room.scene, room.condition, room.engine.sky, 7)
    core.add_sub_sun((0.0, 0.0, 2.0), (1.0, 1.0, 1.0))
    with pytest.raises(_engine.EngineInputError, match="unit"):
        room.engine._core.relight(core)


def test_penumbras_are_as_wide_as_the_disc() -> None:
    """From 1 to 99 % of the light, on a floor below an edge: 0.9343 of 2 tan(radius) times the distance."""
    room = lit(roof_light_room(), OVERHEAD, sun=127)
    points = penumbra_places(EDGE, np.array(OVERHEAD))
    share = direct_share(room, points)
    way = ROOM_M[2] - points[0, 2]
    width = np.interp(0.99, share, points[:, 0]) - np.interp(0.01, share, points[:, 0])
    assert width == pytest.approx(2 * 0.9343 * np.tan(SUN_RADIUS_RAD) * way, rel=0.03)

"""Full physics in our integrator: the sun's disc and the mirror of glass, against closed forms and matched answers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reference_rooms import PlainCondition, UniformSky, room_view, window_room

from transom.colour import luminance
from transom.glass import pane
from transom.scene.model import Material, Scene
from transom_reference.mitsuba_renderer import MitsubaRenderer

MITSUBA = MitsubaRenderer()
UP = np.array([[0.0, 0.0, 1.0]])
SUN = np.array([0.15, -0.8, 0.6]) / np.linalg.norm([0.15, -0.8, 0.6])
SUNNY: Any = PlainCondition(
    UniformSky(4000.0), SUN, np.full(3, 60e3), ground_luminance_rgb=np.full(3, 1500.0), sky_rgb=np.ones(3)
)


def test_matched_answers_are_what_published_references_hold() -> None:
    """Bit by bit: full physics adds no operation to the matched one. The mean is that of these samples, with four
    connections a vertex (285.88 with one, whose noise was another)."""
    options = {"batches": 2, "samples": 4}
    image = MITSUBA.render(window_room(), SUNNY, room_view(8, 6), options)
    again = MITSUBA.render(window_room(), SUNNY, room_view(8, 6), {**options, "physics": "matched"})
    assert np.array_equal(image.mean, again.mean)
    assert luminance(image.mean).mean() == pytest.approx(286.0997913, rel=1e-6)


def test_disc_lights_like_a_point_away_from_shadow_edges() -> None:
    """In the middle of a sun patch of a black room: the same illuminance, to the disc's curvature."""
    scene = blackened(window_room("none"))
    point = np.array([[2.0, 0.0, 1.6]]) - 1.2 * SUN
    results = [
        MITSUBA.illuminance(scene, SUNNY, point, UP, {"batches": 4, "physics": physics})
        for physics in ("matched", "full")
    ]
    lit = [luminance(result.illuminance)[0] for result in results]
    assert lit[1] == pytest.approx(lit[0], rel=2e-4)


def test_edge_of_the_disc_s_shadow_is_half_lit() -> None:
    """A sensor on the shadow edge of the sill, 1 m down the beam: half of it, where a point sun is all or nothing."""
    scene = blackened(window_room("none"))
    dark: Any = replace(SUNNY, sky=UniformSky(0.0), ground_luminance_rgb=np.zeros(3))
    sill = np.array([2.0, 0.0, 0.9])
    point = np.array([sill - 1.0 * SUN])
    result = MITSUBA.illuminance(scene, dark, point, UP, {"batches": 8, "physics": "full"})
    share = luminance(result.illuminance)[0] / (60e3 * SUN[2])
    assert share == pytest.approx(0.5, abs=0.02)


def test_glass_mirrors_an_emitting_wall() -> None:
    """The camera sees the emitting north wall in the pane: its luminance times the directional reflectance."""
    scene = window_room("clear", 0.82)
    materials = tuple(
        Material(m.name, luminance=(1000.0,) * 3 if m.name == "north" else (0.0,) * 3, opening=m.opening)
        for m in scene.materials
    )
    dark: Any = PlainCondition(UniformSky(0.0))
    view = replace(room_view(2, 2), position=(2.0, 4.0, 1.6), target=(2.0, 0.0, 1.6), vertical_fov_rad=0.01)
    options = {"batches": 8, "samples": 4096}
    result = MITSUBA.render(replace(scene, materials=materials), dark, view, {**options, "physics": "full"})
    mirror = float(pane(0.82, np.ones(1))[1][0])
    assert luminance(result.mean).mean() == pytest.approx(1000 * mirror, rel=0.03)


def blackened(scene: Scene) -> Scene:
    return replace(scene, materials=tuple(replace(m, reflectance=(0.0,) * 3) for m in scene.materials))

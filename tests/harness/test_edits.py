"""Edits of a scene, and engines that take over what an edit leaves valid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scene_writing import write_scene

from transom.daylight.condition import resolve_condition
from transom.edits import (
    with_glazing,
    with_object_added,
    with_object_moved,
    with_object_removed,
    with_opening_closed,
    with_reflectance,
)
from transom.engine import Engine, SolveOptions
from transom.errors import InputError
from transom.scene import load_scene
from transom.scene.model import Scene

BOX = np.array([1.0, 1.0, 0.5]) + 0.4 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
BOX_FACES = np.array([[0, 2, 1, -1], [0, 1, 3, -1], [0, 3, 2, -1], [1, 2, 3, -1]])


@pytest.fixture
def room(tmp_path: Path) -> Scene:
    return load_scene(write_scene(tmp_path / "room"))


@pytest.fixture
def solved(room: Scene) -> Engine:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    options = SolveOptions(target_patch_count=300, patch_rays=128, patch_opening_rays=64, node_rays=64)
    return Engine.solve(room, options)


def light(engine: Engine) -> np.ndarray:
    engine.relight(resolve_condition(engine.scene.conditions[0], engine.scene.site))
    sensors = engine.scene.sensors[0]
    return engine.illuminance(sensors.points, sensors.normals, rays=512, opening_rays=256)["total"]


def fresh(scene: Scene, like: Engine) -> Engine:
    from dataclasses import replace

    return Engine.solve(scene, replace(like.options, maximum_edge_m=like.facts()["maximum_edge_m"]))


def wall(scene: Scene) -> str:
    return next(material.name for material in scene.materials if material.opening < 0)


def test_reflectance_and_glazing_are_those_of_a_fresh_solve(room: Scene, solved: Engine) -> None:
    for scene in (with_reflectance(room, wall(room), 0.1), with_glazing(room, room.openings[0].name, 0.3)):
        edited = solved.edited(scene)
        assert edited.facts()["kept"]["patch_rows"] == edited.facts()["patches"]
        np.testing.assert_array_equal(light(edited), light(fresh(scene, solved)))


def test_edits_follow_each_other(room: Scene, solved: Engine) -> None:
    first = with_reflectance(room, wall(room), (0.1, 0.2, 0.3))
    second = with_glazing(first, room.openings[0].name, 0.3)
    np.testing.assert_array_equal(light(solved.edited(first).edited(second)), light(fresh(second, solved)))


def test_a_closed_opening_lets_nothing_in(room: Scene, solved: Engine) -> None:
    dark = with_opening_closed(room, room.openings[0].name, wall(room))
    assert light(solved).min() > 0
    assert light(solved.edited(dark)).max() == 0


def test_objects_come_move_and_go(room: Scene, solved: Engine) -> None:
    added = with_object_added(room, "wedge", BOX, BOX_FACES, wall(room))
    moved = with_object_moved(added, "wedge", (0.5, 0.2, 0.1))
    assert len(added.mesh.faces) == len(room.mesh.faces) + 4
    np.testing.assert_allclose(moved.mesh.vertices[moved.mesh.faces[-1, 0]], BOX[1] + [0.5, 0.2, 0.1])
    removed = with_object_removed(moved, "wedge")
    np.testing.assert_array_equal(removed.mesh.faces, room.mesh.faces)
    with_wedge = solved.edited(moved)
    np.testing.assert_array_equal(light(with_wedge), light(fresh(moved, solved)))
    np.testing.assert_array_equal(light(with_wedge.edited(removed)), light(fresh(removed, solved)))


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda s: with_reflectance(s, "wal", 0.3), "material"),
        (lambda s: with_reflectance(s, wall(s), 1.2), "reflectance"),
        (lambda s: with_reflectance(s, s.openings[0].material, 0.2), "with_glazing"),
        (lambda s: with_glazing(s, s.openings[0].name, 0.99), "visible_transmittance"),
        (lambda s: with_glazing(s, "nowhere", 0.5), "opening"),
        (lambda s: with_opening_closed(s, s.openings[0].name, s.openings[0].material), "opaque"),
        (lambda s: with_object_moved(s, s.mesh.objects[0], (0.0, float("nan"), 0.0)), "offset_m"),
        (lambda s: with_object_removed(s, "nothing"), "object"),
        (lambda s: with_object_added(s, s.mesh.objects[0], BOX, BOX_FACES, wall(s)), "another name"),
        (lambda s: with_object_added(s, "wedge", BOX[:3], BOX_FACES, wall(s)), "faces of wedge"),
    ],
)
def test_impossible_edits_name_the_field(room: Scene, edit: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        edit(room)  # type: ignore[operator]


def test_an_edit_that_opens_the_room_leaves_the_engine_as_it_was(room: Scene, solved: Engine) -> None:
    before = light(solved)
    with pytest.raises(InputError, match=r"open wall|leave"):
        solved.edited(with_object_moved(room, room.mesh.objects[0], (0.0, 0.0, 0.3)))
    np.testing.assert_array_equal(light(solved), before)

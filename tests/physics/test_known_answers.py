"""Scenes whose answer is known: CUBE, the furnace, and a box of three tones solved independently."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from conftest import KNOWN, solved

from transom.colour import luminance
from transom.engine import Engine
from transom.scene import load_scene

TOLERANCE = {"cube": 0.01, "furnace": 0.001, "three_tone": 0.005}
MEAN_OF_CUBE = 0.002

FACE_POINTS = {(0.0, 0.0): 892.8, (0.5, 0.0): 768.7, (0.5, 0.5): 686.7}
"""Luminance [cd/m²] of CUBE's faces at (x, y) in -1..1  [Khodulev & Kopylov 1996; collocation]."""


def face_luminance(engine: Engine, points: list[tuple[float, float]]) -> np.ndarray:
    """Luminance at points of all six faces of CUBE (10 m, centre at the middle of the mesh), mean over the faces."""
    low, high = engine.scene.mesh.vertices.min(axis=0), engine.scene.mesh.vertices.max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    values = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = -sign
            places = []
            for x, y in points:
                place = np.insert(np.array([x, y]), axis, sign)
                places.append(centre + place * half)
            result = engine.illuminance(np.array(places), np.tile(normal, (len(points), 1)))
            values.append(luminance(result["total"]) * (2 / 3) / np.pi)
    return np.mean(values, axis=0)


def test_cube_has_the_published_luminance_at_points_of_its_faces() -> None:
    computed = face_luminance(solved("cube"), list(FACE_POINTS))
    assert computed == pytest.approx(list(FACE_POINTS.values()), rel=TOLERANCE["cube"])


def test_cube_has_the_exact_mean_luminance() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(12)
    points = [(float(x), float(y)) for x in nodes for y in nodes]
    mean = float(np.outer(weights, weights).ravel() @ face_luminance(solved("cube"), points)) / 4
    assert mean == pytest.approx(2000 / 3, rel=MEAN_OF_CUBE)


@pytest.mark.parametrize("name", KNOWN)
def test_sensors_meet_the_known_answers(name: str) -> None:
    known_answers = importlib.import_module("transom_reference.analytic").known_answers(load_scene(name))
    assert known_answers
    for answer in known_answers:
        result = solved(name).illuminance(np.asarray(answer.points), np.asarray(answer.normals))
        value = luminance(result["total"])
        if answer.unit == "cd/m²":
            value = answer.reflectance * value / np.pi + answer.own_luminance
        computed = float(np.asarray(answer.weights) @ value)
        assert computed == pytest.approx(answer.truth, rel=TOLERANCE[name], abs=3 * answer.uncertainty), answer.quantity


@pytest.mark.parametrize("reflectance", [0.0, 0.5, 0.8, 0.9])
def test_furnace_is_exact_for_every_reflectance(reflectance: float) -> None:
    from dataclasses import replace

    scene = load_scene("furnace")
    (own,) = {material.luminance for material in scene.materials}
    white = tuple(replace(m, reflectance=(reflectance,) * 3) for m in scene.materials)
    engine = Engine.solve(replace(scene, materials=white))
    from transom.daylight import resolve_condition

    engine.relight(resolve_condition(scene.conditions[0], scene.site))
    frame = engine.render(scene.views[0], edge_samples=1)
    expected = luminance(np.array(own)) / (1 - reflectance)
    assert luminance(frame.radiance) == pytest.approx(np.full(frame.radiance.shape[:2], expected), rel=1e-3)

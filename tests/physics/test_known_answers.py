"""Scenes whose answer is known: CUBE, the furnace, and a box of three tones solved independently."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from solved_scenes import solved

from transom.bundle import Bundle
from transom.colour import luminance
from transom.daylight import resolve_condition
from transom.engine import Engine
from transom.known.suite import answer, cases_of_scene, compare_bundle
from transom.scene import load_scene
from transom.suite import SuiteCase, load_suite

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


@pytest.mark.parametrize("entry", load_suite("analytic").cases, ids=lambda entry: entry.scene.name)
def test_luminances_meet_the_known_answers(entry: SuiteCase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRANSOM_CACHE", str(tmp_path))
    for case in cases_of_scene(entry):
        bundle = answer(case, "engine")
        assert isinstance(bundle, Bundle), bundle
        rows = compare_bundle(case, "engine", bundle)
        assert rows
        for row in rows:
            assert row.value == pytest.approx(row.truth, rel=TOLERANCE[entry.scene.name]), row.quantity


@pytest.mark.parametrize("reflectance", [0.0, 0.5, 0.8, 0.9])
def test_furnace_is_exact_for_every_reflectance(reflectance: float) -> None:
    scene = load_scene("furnace")
    (own,) = {material.luminance for material in scene.materials}
    white = tuple(replace(m, reflectance=(reflectance,) * 3) for m in scene.materials)
    engine = Engine.solve(replace(scene, materials=white))
    engine.relight(resolve_condition(scene.conditions[0], scene.site))
    frame = engine.render(scene.views[0], edge_samples=1)
    expected = luminance(np.array(own)) / (1 - reflectance)
    assert luminance(frame.radiance) == pytest.approx(np.full(frame.radiance.shape[:2], expected), rel=1e-3)

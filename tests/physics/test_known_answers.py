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
from transom_reference.analytic import refine_cube

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


@pytest.mark.slow
def test_cube_shown_is_the_collocated_one_at_4096_points_of_every_face() -> None:
    """On a uniform mesh (1,536 patches). A camera at the centre of a cube that sees a face in 90 degrees has its pixel
    centres at the points of a regular grid."""
    engine, grid = solved("cube"), (np.arange(64) + 0.5) / 64
    reference = refine_cube(8)
    octant = np.array([[reference.luminance("z0", u, v) if u <= v else 0.0 for u in grid[:32]] for v in grid[:32]])
    quarter = np.maximum(octant, octant.T)
    truth = np.block([[quarter, quarter[:, ::-1]], [quarter[::-1], quarter[::-1, ::-1]]])
    view = replace(engine.scene.views[0], position=np.zeros(3), vertical_fov_rad=np.pi / 2, width=64, height=64)
    for axis in range(3):
        up = np.eye(3)[(axis + 1) % 3]
        for target in (np.eye(3)[axis], -np.eye(3)[axis]):
            shown = engine.render(replace(view, target=target, up=up), edge_samples=1).radiance
            error = np.abs(luminance(shown) / truth - 1)
            assert error.mean() < 0.0035
            assert error.max() < 0.03


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

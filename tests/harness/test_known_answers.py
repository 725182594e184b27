"""Known answers: boxes are read off scenes rightly, and an exact renderer gets no error."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from transom.daylight.condition import Condition, resolve_condition
from transom.errors import InputError
from transom.known_answers import FACES, box_of, compare_known_answer
from transom.renderer import ImageResult, Progress, SensorResult
from transom.scene import load_scene
from transom.scene.model import Scene, View
from transom.suite import SuiteCase


class ExactFurnace:
    """Knows that a furnace has luminance L0 / (1 - rho) everywhere."""

    name = "engine"
    version = "exact"

    def default_options(self) -> dict[str, Any]:
        return {}

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> ImageResult:
        raise NotImplementedError

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,  # noqa: ARG002
        points: NDArray[np.float64],
        normals: NDArray[np.float64],  # noqa: ARG002
        options: Mapping[str, Any],  # noqa: ARG002
        progress: Progress | None = None,  # noqa: ARG002
    ) -> SensorResult:
        material = scene.materials[0]
        level = math.pi * material.luminance[0] / (1 - material.reflectance[0])
        return SensorResult(np.full((len(points), 3), level), np.zeros(len(points)))


def case_of(name: str) -> SuiteCase:
    scene = load_scene(name)
    return SuiteCase(scene, resolve_condition(scene.conditions[0], scene.site), (), False)


def test_box_of_a_scene_has_its_size_and_six_sides() -> None:
    box = box_of(load_scene("cube"))
    np.testing.assert_allclose(box.high - box.low, 10.0)
    assert set(box.reflectance) == set(FACES)
    assert all(value == pytest.approx(2 / 3) for value in box.reflectance.values())


@pytest.mark.parametrize("face", FACES)
def test_points_of_a_face_lie_just_inside_it_and_look_inwards(face: str) -> None:
    box = box_of(load_scene("three_tone"))
    points, normals = box.points(face, [(0.5, 0.5), (0.1, 0.9)])
    centre = (box.low + box.high) / 2
    assert np.all((points > box.low) & (points < box.high))
    assert np.all(np.einsum("ij,ij->i", centre - points, normals) > 0)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_furnished_room_is_no_box() -> None:
    with pytest.raises(InputError, match="not an empty box"):
        box_of(load_scene("test_room"))


def test_exact_furnace_has_no_error_at_any_reflectance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("transom.bundle._engine_build", lambda: "fake")
    rows = compare_known_answer(case_of("furnace"), ExactFurnace())
    assert len(rows) == 3
    assert all(abs(row.error_percent) < 1e-3 for row in rows)


def test_scene_without_a_known_answer_is_refused() -> None:
    case = case_of("cube")
    renamed = dataclasses.replace(case, scene=dataclasses.replace(case.scene, name="attic"))
    with pytest.raises(InputError, match="no known answer"):
        compare_known_answer(renamed, ExactFurnace())

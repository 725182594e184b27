"""Faults planted into the engine's answers are caught and named by a check, and the unchanged engine passes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from transom import check, suite
from transom.baseline import Baseline, Drift, drifts, worth_judging
from transom.check import asked_cases, bless_suite, check_suite
from transom.check_summary import diagnoses, failed_drifts
from transom.daylight.condition import Condition
from transom.engine_renderer import EngineRenderer
from transom.judge import Outcome, judge, read_tolerances
from transom.renderer import Float64, ImageResult, Progress, SensorResult
from transom.scene import scene_root
from transom.scene.model import Scene, View
from transom.suite import load_suite

pytestmark = pytest.mark.slow

SUITE = """
format = 1
[suites.quick]
title = "One room"
layout = "hours"
width = 320
cases = [{ scene = "test_room", views = ["to_window"] }]
"""
SEEDS = 4


class PlantedEngine(EngineRenderer):
    """The engine with a fault: in the scene or the condition that it is given, or in what its answers lack.

    lost_indirect: share of the indirect light of pictures; lost_flux: of all flux, in the energy balance; lost_sweeps:
    of interreflection.
    """

    def __init__(
        self,
        name: str,
        scene: Callable[[Scene], Scene] = lambda scene: scene,
        condition: Callable[[Condition], Condition] = lambda condition: condition,
        lost_indirect: float = 0.0,
        lost_flux: float = 0.0,
        lost_sweeps: int = 0,
    ) -> None:
        super().__init__()
        self.version = f"planted {name}"
        self._scene, self._condition = scene, condition
        self._lost_indirect, self._lost_flux, self._lost_sweeps = lost_indirect, lost_flux, lost_sweeps

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> ImageResult:
        whole = super().render(self._scene(scene), self._condition(condition), view, options, progress)
        lost = self._lost_indirect * whole.components["indirect"]
        components = {**whole.components, "indirect": whole.components["indirect"] - lost}
        return dataclasses.replace(whole, mean=whole.mean - lost, components=components)

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,
        points: Float64,
        normals: Float64,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> SensorResult:
        whole = super().illuminance(self._scene(scene), self._condition(condition), points, normals, options, progress)
        facts = {
            **whole.facts,
            "energy_imbalance": whole.facts["energy_imbalance"] - self._lost_flux,
            "sweeps": whole.facts["sweeps"] - self._lost_sweeps,
        }
        return dataclasses.replace(whole, facts=facts)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("planted")


@pytest.fixture(scope="module")
def baseline(folder: Path) -> Baseline:
    """Of the unchanged engine."""
    with pytest.MonkeyPatch.context() as patch:
        _small(patch, folder)
        return bless_suite("quick", "the engine without a fault", seeds=SEEDS, folder=folder)


def _small(patch: pytest.MonkeyPatch, folder: Path) -> None:
    (folder / "suites.toml").write_text(SUITE)
    patch.setattr(suite, "suites_file", lambda: folder / "suites.toml")
    patch.setenv("TRANSOM_CACHE", str(folder / "cache"))


def checked(
    monkeypatch: pytest.MonkeyPatch, folder: Path, engine: EngineRenderer, seed: int | None = None
) -> tuple[set[str], str]:
    """Categories that failed against the baseline, and what the summary says of them."""
    _small(monkeypatch, folder)
    found = check_suite("quick", folder / "build", engine=engine, seed=seed, folder=folder)
    return {row.category for row in failed_drifts(found)}, " ".join(diagnoses(found))


def turned(vector: Float64, angle_deg: float) -> Float64:
    """Turned about the vertical."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    x, y, z = vector
    return np.array([c * x - s * y, s * x + c * y, z])


def with_turned_sky(condition: Condition) -> Condition:
    """The clear sky turned by 5 degrees, and the sun where it was."""
    sky = dataclasses.replace(condition.sky, sun_direction=turned(condition.sky.sun_direction, 5.0))
    return dataclasses.replace(condition, sky=sky)


def with_moved_shadows(condition: Condition) -> Condition:
    """The sun a little further on: shadows some metres from their frames move by about 10 mm."""
    assert condition.sun_direction is not None
    return dataclasses.replace(condition, sun_direction=turned(condition.sun_direction, 0.25))


def without_a_triangle(scene: Scene) -> Scene:
    """A table without one of its faces."""
    owner = [name.startswith("table") for name in scene.mesh.objects]
    lost = next(f for f, o in enumerate(scene.mesh.face_object) if owner[o] and _looks_up(scene, f))
    keep = np.arange(len(scene.mesh.faces)) != lost
    mesh = dataclasses.replace(
        scene.mesh,
        faces=scene.mesh.faces[keep],
        face_material=scene.mesh.face_material[keep],
        face_object=scene.mesh.face_object[keep],
        corner_normals=None if scene.mesh.corner_normals is None else scene.mesh.corner_normals[keep],
    )
    return dataclasses.replace(scene, mesh=mesh)


def _looks_up(scene: Scene, face: int) -> bool:
    a, b, c = (scene.mesh.vertices[i] for i in scene.mesh.faces[face][:3])
    return bool(np.cross(b - a, c - a)[2] > 0)


def brighter(scene: Scene) -> Scene:
    """Every reflectance 0.5 % higher: a transfer that is too strong."""
    materials = tuple(
        dataclasses.replace(material, reflectance=tuple(1.005 * value for value in material.reflectance))
        for material in scene.materials
    )
    return dataclasses.replace(scene, materials=materials)


def test_unchanged_engine_passes(monkeypatch: pytest.MonkeyPatch, folder: Path, baseline: Baseline) -> None:
    assert baseline.history[-1].seeds == SEEDS
    assert checked(monkeypatch, folder, EngineRenderer()) == (set(), "")


def test_transfer_that_is_too_strong_is_named(
    monkeypatch: pytest.MonkeyPatch, folder: Path, baseline: Baseline
) -> None:
    assert baseline
    found, words = checked(monkeypatch, folder, PlantedEngine("brighter", scene=brighter))
    assert "indirect" in found and not found & {"sun shadow", "geometry", "geometry seen"}
    assert "Interreflection" in words or "Indirect light" in words


def test_turned_sky_is_named(monkeypatch: pytest.MonkeyPatch, folder: Path, baseline: Baseline) -> None:
    assert baseline
    found, words = checked(monkeypatch, folder, PlantedEngine("sky", condition=with_turned_sky))
    assert {"sky", "sky in blocks"} <= found and "sun shadow" not in found
    assert "Direct sky light" in words


def test_bounces_that_stop_early_are_named(monkeypatch: pytest.MonkeyPatch, folder: Path, baseline: Baseline) -> None:
    assert baseline
    # No setting of the engine does so: what a first cycle leaves is carried to its end before the engine stops.
    stops_early = PlantedEngine("bounces", lost_indirect=0.025, lost_flux=0.01, lost_sweeps=1)
    found, words = checked(monkeypatch, folder, stops_early)
    assert {"indirect", "energy", "plan"} <= found and not found & {"sky", "sun", "sun shadow"}
    assert "the bounces stop early" in words


def test_moved_shadow_is_named_in_millimetres(
    monkeypatch: pytest.MonkeyPatch, folder: Path, baseline: Baseline
) -> None:
    assert baseline
    found, words = checked(monkeypatch, folder, PlantedEngine("shadow", condition=with_moved_shadows))
    assert "sun shadow" in found and "sky" not in found
    assert "Shadow of the sun on floor" in words and "moved by" in words


def test_lost_face_is_named(monkeypatch: pytest.MonkeyPatch, folder: Path, baseline: Baseline) -> None:
    """The probes look at the scene itself, so that it is the check's own scene that loses a face."""
    assert baseline
    _small(monkeypatch, folder)
    whole = load_suite("quick")
    entry = dataclasses.replace(whole.cases[0], scene=without_a_triangle(whole.cases[0].scene))
    monkeypatch.setattr(check, "load_suite", lambda _: dataclasses.replace(whole, cases=(entry,)))
    found = check_suite("quick", folder / "build", folder=folder)
    words = " ".join(diagnoses(found))
    assert "Geometry: faces of the scene" in words
    assert "of table" in words


def test_fresh_seeds_pass(folder: Path, baseline: Baseline, monkeypatch: pytest.MonkeyPatch) -> None:
    """Seeds that the blessing did not see; the baseline's own measures decide, without pictures in the store."""
    _small(monkeypatch, folder)
    tolerances = read_tolerances(scene_root() / "tolerances.toml")
    loaded, engine = load_suite("quick"), EngineRenderer()
    for seed in (101, 102, 103):
        seeded = check.WithOptions(engine, {"seed": seed})
        found = check._measures_with(loaded, seeded, geometry=True)
        rows: list[Drift] = []
        for asked in asked_cases(loaded):
            blessed = baseline.find(asked.name)
            assert blessed is not None
            now = check._measured(asked, seeded, [found[asked.name]])
            rows += drifts(blessed, now, fresh_seed=True)
        kept = worth_judging(rows, tolerances)
        verdicts = judge([row.subject("baseline") for row in kept], [], tolerances)
        assert {verdict.outcome for verdict in verdicts} == {Outcome.PASS}
        assert {"sun", "sun shadow"} <= {row.category for row in kept}

"""A project of one small scene with fake renderers, for tests of the report: all is written, nothing rendered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness_fakes import NoisyRenderer, grey, small_scene
from numpy.typing import NDArray

from transom.bundle import repository_store
from transom.daylight.condition import Condition
from transom.renderer import ImageResult, Progress, SensorResult
from transom.run import reference_questions, render_case
from transom.scene.model import Opening, Scene, View
from transom.suite import load_suite
from transom.timing import Timing
from transom.visible import FirstSurfaces

SUITES = """
format = 1
[suites.rooms]
title = "Rooms"
target_percent = 5.0
cases = [{ scene = "small", views = ["*"] }]
[suites.hours]
title = "Hours"
layout = "hours"
width = 6
target_percent = 9.0
cases = [{ scene = "small", sensors = false }]
"""

FENESTRATION = """
[suites.fenestration]
title = "Products"
width = 8
target_percent = 9.0
cases = [
    { scene = "small", glazing = ["window=clear:0.5"] },
    { scene = "small", glazing = ["window=prismatic_panel(angle_low=30)"] },
]
"""

TOLERANCES = """
format = 1
[[tolerances]]
quantity = "mean_relative_error_percent"
tolerance = 8.0
reason = "stated"
[[tolerances]]
quantity = "bias_percent"
tolerance = 3.0
reason = "stated"
[[tolerances]]
quantity = "sensor_percent"
tolerance = 3.0
reason = "stated"
"""


class FakeEngine:
    """An engine that is `error` too bright everywhere, and crashes on request."""

    name = "engine"
    version = "fake"
    error = 0.01
    crashes = False

    def default_options(self) -> dict[str, Any]:
        return {"visibility": "rays"}

    def render(
        self,
        scene: Scene,  # noqa: ARG002
        condition: Condition,  # noqa: ARG002
        view: View,
        options: Mapping[str, Any],  # noqa: ARG002
        progress: Progress | None = None,  # noqa: ARG002
    ) -> ImageResult:
        if self.crashes:
            raise RuntimeError("the fake engine was asked to crash")
        picture = grey(np.full((view.height, view.width), 100 * (1 + self.error)))
        return ImageResult(picture, components={"sun": 0.25 * picture, "sky": 0.75 * picture})

    def illuminance(
        self,
        scene: Scene,  # noqa: ARG002
        condition: Condition,  # noqa: ARG002
        points: NDArray[np.float64],
        normals: NDArray[np.float64],  # noqa: ARG002
        options: Mapping[str, Any],  # noqa: ARG002
        progress: Progress | None = None,  # noqa: ARG002
    ) -> SensorResult:
        return SensorResult(np.full((len(points), 3), 100 * (1 + self.error)), np.zeros(len(points)))


def make_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sky: str = "overcast", more_suites: str = "") -> Path:
    """A project of one small scene, with fake renderers and timings."""
    small = small_scene()
    scene = replace(
        small,
        conditions=tuple(replace(spec, sky=sky) for spec in small.conditions),
        openings=(Opening("window", "glass", "clear", 0.8),),
    )
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "suites.toml").write_text(SUITES + more_suites)
    (scenes / "tolerances.toml").write_text(TOLERANCES)
    renderers = {"engine": FakeEngine(), "mitsuba": NoisyRenderer(relative_noise=0.02)}

    def surfaces(_: Scene, view: View) -> FirstSurfaces:
        shape = (view.height, view.width)
        interior = np.ones(shape, bool)
        interior[0] = False
        return FirstSurfaces(np.where(interior, 0, -1).astype(np.int32), np.zeros((*shape, 3), np.float32), interior)

    monkeypatch.setattr("transom.bundle._engine_build", lambda: "fake")
    monkeypatch.setattr("transom.suite.load_scene", lambda _: scene)
    monkeypatch.setattr("transom.suite.scene_root", lambda: scenes)
    monkeypatch.setattr("transom.workflow.scene_root", lambda: scenes)
    monkeypatch.setattr("transom.report.build.scene_root", lambda: scenes)
    monkeypatch.setattr("transom.report.speed.load_scene", lambda _: scene)
    for module in ("workflow", "report.pictures", "report.day"):
        monkeypatch.setattr(f"transom.{module}.load_renderer", renderers.__getitem__)
    for module in ("run", "visible", "report.viewer"):
        monkeypatch.setattr(f"transom.{module}.first_surfaces", surfaces)
    monkeypatch.setattr("transom.report.build.make_plots", lambda *_: None)
    timings = [
        Timing("small", "solve", "s", 1.0, 0.9, 1.1, 3, 2, 40),
        Timing("small", "relight", "s", 2e-3, 1e-3, 3e-3, 9, 2, 40),
    ]
    monkeypatch.setattr("transom.report.build.time_scenes", lambda *_: timings)
    return tmp_path


def render_references(suites: Sequence[str] = ("rooms", "hours")) -> None:
    renderer = NoisyRenderer(relative_noise=0.02)
    for name in suites:
        for question in reference_questions(load_suite(name), renderer, {}):
            render_case(renderer, question, repository_store())

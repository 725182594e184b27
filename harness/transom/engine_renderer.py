"""The engine behind the renderer protocol: solves a scene once, then relights and looks."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from transom.daylight.condition import Condition
from transom.daylight.sun_disc import parse_sun
from transom.engine import Engine, SolveOptions
from transom.renderer import Float64, ImageResult, Progress, SensorResult
from transom.scene import content_key
from transom.scene.model import Scene, View

SOLVE_FIELDS = tuple(f.name for f in fields(SolveOptions))


class EngineRenderer:
    """Transom's own engine. `version` is raised when its answers may change.

    Options beside those of a solve: visibility, "rays" or "volumes"; edge_samples a pixel and axis; sensor_rays and
    sensor_opening_rays a sensor; sun, "point", "disc", "disc:N" or "auto" (`transom.daylight.sun_disc`).
    """

    name = "engine"
    version = "6"

    def __init__(self) -> None:
        self._solved: dict[tuple[str, SolveOptions], tuple[Engine, float]] = {}

    def default_options(self) -> dict[str, Any]:
        options = {name: getattr(SolveOptions(), name) for name in SOLVE_FIELDS}
        return {
            "visibility": "rays",
            "edge_samples": 4,
            "sensor_rays": 16384,
            "sensor_opening_rays": 8192,
            "sun": "point",
            **options,
        }

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> ImageResult:
        options = {**self.default_options(), **options}
        report = progress or _no_progress
        engine, facts = self._relit(scene, condition, options, report)
        begin = time.perf_counter()
        frame = engine.render(view, options["visibility"], edge_samples=options["edge_samples"])
        facts["seconds"]["frame"] = time.perf_counter() - begin
        facts["edge_pixels"] = frame.edge_pixel_count
        facts["passes"] = frame.pass_count
        report(3, 3)
        return ImageResult(frame.radiance, components=frame.components, facts=facts)

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,
        points: Float64,
        normals: Float64,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> SensorResult:
        options = {**self.default_options(), **options}
        report = progress or _no_progress
        engine, facts = self._relit(scene, condition, options, report)
        begin = time.perf_counter()
        parts = engine.illuminance(
            points, normals, rays=options["sensor_rays"], opening_rays=options["sensor_opening_rays"]
        )
        facts["seconds"]["sensors"] = time.perf_counter() - begin
        report(3, 3)
        return SensorResult(parts["total"], np.zeros(len(points)), facts)

    def engine(self, scene: Scene, options: SolveOptions) -> tuple[Engine, float]:
        """The solved engine of a scene, and the seconds that its solve took when it was first asked for."""
        key = (content_key(scene), options)
        if key not in self._solved:
            self._solved.clear()  # one scene at a time: a suite goes scene by scene
            begin = time.perf_counter()
            engine = Engine.solve(scene, options, trace=True)
            self._solved[key] = (engine, time.perf_counter() - begin)
        return self._solved[key]

    def _relit(
        self, scene: Scene, condition: Condition, options: Mapping[str, Any], report: Progress
    ) -> tuple[Engine, dict[str, Any]]:
        engine, solve_s = self.engine(scene, SolveOptions(**{name: options[name] for name in SOLVE_FIELDS}))
        report(1, 3)
        begin = time.perf_counter()
        engine.relight(condition, parse_sun(str(options["sun"])))
        relight_s = time.perf_counter() - begin
        report(2, 3)
        facts: dict[str, Any] = {
            **engine.facts(),
            "plan": {**engine.plan(), **engine.present_sun.facts()},
            "beams": (condition.sun_direction is not None) + engine.lobe_count,
            "lobes": engine.lobe_count,
            "sweeps": engine.sweeps,
            "energy_imbalance": engine.audit().imbalance,
            "seconds": {"solve": solve_s, "relight": relight_s},
            "trace": engine.trace(),
        }
        return engine, facts


def _no_progress(done: int, total: int) -> None:
    """Takes the place of a progress bar that nobody asked for."""

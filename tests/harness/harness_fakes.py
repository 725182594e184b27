"""A small scene and a renderer that does no light transport, for tests of everything around rendering."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.bundle import BatchStore
from transom.daylight.condition import Condition, resolve_condition
from transom.renderer import ImageResult, Progress, SensorResult
from transom.scene.model import ConditionSpec, Material, Mesh, Region, Scene, SensorSet, Site, View


def small_scene(reflectance: float = 0.5) -> Scene:
    """A single floor of one square metre, with a view of 12 x 8 pixels, a region and two sensors."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = Mesh(
        vertices=corners,
        faces=np.array([[0, 1, 2, 3]], np.int32),
        face_material=np.zeros(1, np.int32),
        face_object=np.zeros(1, np.int32),
        objects=("floor",),
    )
    view = View("top", (0.5, 0.5, 2.0), (0.5, 0.5, 0.0), (0.0, 1.0, 0.0), math.radians(60), 12, 8, 1000.0)
    return Scene(
        name="small",
        file=Path("small/scene.toml"),
        title="A floor",
        description="One square metre.",
        mesh=mesh,
        materials=(Material("floor", (reflectance,) * 3),),
        openings=(),
        point_sources=(),
        site=Site("equator", 0.0, 0.0, 0.0),
        views=(view,),
        conditions=(ConditionSpec("noon", "2026-03-21T12:00", "overcast"),),
        regions=(Region("floor", ("floor",)),),
        sensors=(SensorSet("grid", np.array([[0.2, 0.2, 0.0], [0.8, 0.8, 0.0]]), np.array([[0, 0, 1.0]] * 2)),),
    )


def small_condition() -> Condition:
    scene = small_scene()
    return resolve_condition(scene.conditions[0], scene.site)


class NoisyRenderer:
    """A reference of constant luminance `level` with independent noise: batch i is seeded by i alone."""

    name = "mitsuba"
    version = "fake-1"

    def __init__(self, level: float = 100.0, relative_noise: float = 0.2, stop_after: int | None = None) -> None:
        self.level, self.relative_noise, self.stop_after = level, relative_noise, stop_after
        self.rendered: list[int] = []

    def default_options(self) -> dict[str, Any]:
        return {"batches": 4, "seed": 1}

    def render(
        self,
        scene: Scene,  # noqa: ARG002
        condition: Condition,  # noqa: ARG002
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
        batches: BatchStore | None = None,
    ) -> ImageResult:
        shape = (view.height, view.width)
        values = self._batches(shape, batches, progress, options)
        mean, error = values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))
        turn = 0 if batches is None else batches.first % 2
        halves = (grey(values[turn::2].mean(axis=0)), grey(values[1 - turn :: 2].mean(axis=0)))
        return ImageResult(grey(mean), halves, error.astype(np.float32), facts={"samples": 1})

    def illuminance(
        self,
        scene: Scene,  # noqa: ARG002
        condition: Condition,  # noqa: ARG002
        points: NDArray[np.float64],
        normals: NDArray[np.float64],  # noqa: ARG002
        options: Mapping[str, Any],
        progress: Progress | None = None,
        batches: BatchStore | None = None,
    ) -> SensorResult:
        shape = (len(points),)
        values = self._batches(shape, batches, progress, options)
        error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
        return SensorResult(grey(values.mean(axis=0)).astype(np.float64), error)

    def _batches(
        self,
        shape: tuple[int, ...],
        batches: BatchStore | None,
        progress: Progress | None,
        options: Mapping[str, Any],
    ) -> NDArray[np.float64]:
        wanted = range(0 if batches is None else batches.first, options["batches"])
        return np.stack([self._batch(index, shape, batches, progress, options) for index in wanted])

    def _batch(
        self,
        index: int,
        shape: tuple[int, ...],
        batches: BatchStore | None,
        progress: Progress | None,
        options: Mapping[str, Any],
    ) -> NDArray[np.float64]:
        if batches is not None and batches.has(index):
            return batches.load(index)["values"][..., 0]
        if self.stop_after is not None and len(self.rendered) >= self.stop_after:
            raise KeyboardInterrupt
        noise = np.random.default_rng((options["seed"], index)).standard_normal(shape)
        values = self.level * (1 + self.relative_noise * noise)
        self.rendered.append(index)
        if batches is not None:
            batches.save(index, {"values": np.repeat(values[..., None], 3, axis=-1)})
        if progress is not None:
            progress(index + 1, options["batches"])
        return values


def grey(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """(..., ) -> (..., 3): equal red, green and blue, whose luminance is the value."""
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=-1)


CHEAP_FACTS = {"energy_imbalance": 1e-4, "sweeps": 12, "interior_patches": 300, "nodes": 900, "faces": 6}


class CheapEngine:
    """Takes the engine's place: a level that depends on the scene's reflectance, and a note of every case it renders.

    $CHEAP_ENGINE_LOG: file to which each finished rendering adds a line; $CHEAP_ENGINE_SECONDS: how long one takes;
    $CHEAP_ENGINE_FAILS: condition whose rendering raises an error; $CHEAP_ENGINE_SKY, $CHEAP_ENGINE_INDIRECT: factors
    on these components; $CHEAP_ENGINE_SPREAD: relative noise of a pixel, by seed.
    """

    name = "engine"
    version = "cheap-1"

    def default_options(self) -> dict[str, Any]:
        return {"visibility": "rays", "seed": 1, "sensor_rays": 16, "sensor_opening_rays": 16}

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,  # noqa: ARG002
    ) -> ImageResult:
        level = self._level(scene, condition)
        shape = (view.height, view.width, 3)
        random = np.random.default_rng(int(options["seed"]))
        spread = float(os.environ.get("CHEAP_ENGINE_SPREAD", "0"))
        parts = {name: np.zeros(shape, np.float32) for name in ("sun", "emitted", "exterior")}
        for name, share in (("sky", 0.4), ("indirect", 0.6)):
            changed = float(os.environ.get(f"CHEAP_ENGINE_{name.upper()}", "1"))
            noise = 1 + spread * random.standard_normal(shape[:2])
            parts[name] = grey(level * share * changed * noise)
        return ImageResult(sum(parts.values(), np.zeros(shape, np.float32)), components=parts, facts=CHEAP_FACTS)

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,
        points: NDArray[np.float64],
        normals: NDArray[np.float64],  # noqa: ARG002
        options: Mapping[str, Any],  # noqa: ARG002
        progress: Progress | None = None,  # noqa: ARG002
    ) -> SensorResult:
        values = np.full((len(points), 3), self._level(scene, condition))
        return SensorResult(values, np.zeros(len(points)), CHEAP_FACTS)

    def _level(self, scene: Scene, condition: Condition) -> float:
        time.sleep(float(os.environ.get("CHEAP_ENGINE_SECONDS", "0")))
        if os.environ.get("CHEAP_ENGINE_FAILS") == condition.name:
            raise ArithmeticError("light went backwards")
        log = os.environ.get("CHEAP_ENGINE_LOG")
        if log is not None:
            with Path(log).open("a") as stream:
                stream.write(f"{scene.name} {condition.name}\n")
        return 200.0 * scene.materials[0].reflectance[0]

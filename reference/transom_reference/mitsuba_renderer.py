"""The reference renderer: Mitsuba's ray tracing, our portal integrator, independent batches with a standard error."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.renderer import ImageResult, Progress, SensorResult
from transom.scene.model import Scene, View
from transom_reference.mitsuba_setup import VARIANT, dr, mi
from transom_reference.path_starts import CameraRays, SensorPoints
from transom_reference.portal_integrator import PathOptions, PortalIntegrator
from transom_reference.transport_scene import TransportScene, build_transport_scene

Float64 = NDArray[np.float64]

SENSOR_LOG2_SAMPLES = 6
SENSOR_LANES_PER_BATCH = 1 << 12
"""Sensors share so many lanes, but each has at least one and at most 1024."""


class BatchStore(Protocol):
    """Where finished batches are kept, so that a stopped run repeats nothing. Those before `first` are left out."""

    @property
    def first(self) -> int: ...

    def has(self, index: int) -> bool: ...

    def load(self, index: int) -> Mapping[str, NDArray[Any]]: ...

    def save(self, index: int, arrays: Mapping[str, NDArray[Any]]) -> None: ...


class MitsubaRenderer:
    """Unbiased path tracing with opening and sun-patch sampling. `version` rises when answers may change."""

    name = "mitsuba"
    version = "1"

    def default_options(self) -> dict[str, Any]:
        """samples: paths a pixel in one batch, a power of two (1..4096); sensors use 64 paths in each of many lanes.

        batches: independent estimates, at least 2; published references have 32 or more. seed: any integer.
        max_depth: surfaces and panes a path may meet. physics: "matched" (hard sun, diffuse room side of glass)
        or "full" (sun's disc of 0.533 degrees, the room side of glass a mirror).
        """
        return {"samples": 64, "batches": 32, "seed": 1, "max_depth": 512, "physics": "matched"}

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
        *,
        batches: BatchStore | None = None,
    ) -> ImageResult:
        """The view's image (height, width, 3) [cd/m²], halves and standard error, from `options["batches"]` batches.

        batches: finished batches are loaded from here and new ones saved; the answer is of `batches.first` and those
        after it, by number below `options["batches"]`. Raises InputError for options out of range.
        """
        settings = self._settings(options)
        transport = build_transport_scene(scene, condition, full_physics=settings["physics"] == "full")
        path = PathOptions(_log2(settings["samples"]), settings["max_depth"])
        integrator = PortalIntegrator(transport, camera_rays(view), path)

        def trace(seed: int) -> NDArray[Any]:
            return integrator.batch(seed).reshape(view.height, view.width, 3).astype(np.float32)

        summary = _run_batches(trace, settings, batches, progress)
        facts = self._facts(settings, transport, summary)
        return ImageResult(
            mean=summary.mean.astype(np.float32),
            halves=(summary.halves[0].astype(np.float32), summary.halves[1].astype(np.float32)),
            standard_error=summary.standard_error.astype(np.float32),
            facts=facts,
        )

    def illuminance(
        self,
        scene: Scene,
        condition: Condition,
        points: Float64,
        normals: Float64,
        options: Mapping[str, Any],
        progress: Progress | None = None,
        *,
        batches: BatchStore | None = None,
    ) -> SensorResult:
        """Illuminance [lx] at points (N, 3) [m] with unit normals (N, 3); light from behind a sensor does not count."""
        settings = self._settings(options)
        points, normals = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or points.shape != normals.shape or len(points) == 0:
            raise InputError("must both have the same shape (N, 3), N >= 1", field="points, normals")
        transport = build_transport_scene(scene, condition, full_physics=settings["physics"] == "full")
        replicas = int(np.clip(SENSOR_LANES_PER_BATCH // len(points), 1, 1024))
        start = SensorPoints(points, normals, replicas)
        path = PathOptions(SENSOR_LOG2_SAMPLES, settings["max_depth"])
        integrator = PortalIntegrator(transport, start, path)
        summary = _run_batches(integrator.batch, settings, batches, progress)
        facts = self._facts(settings, transport, summary)
        facts["paths_per_sensor"] = (replicas << SENSOR_LOG2_SAMPLES) * settings["batches"]
        return SensorResult(summary.mean, summary.standard_error, facts)

    def _settings(self, options: Mapping[str, Any]) -> dict[str, Any]:
        defaults = self.default_options()
        unknown = sorted(set(options) - set(defaults))
        if unknown:
            raise InputError(
                "is not an option of the Mitsuba renderer", field=unknown[0], remedy=f"Known: {', '.join(defaults)}"
            )
        settings = {**defaults, **options}
        samples = settings["samples"]
        if samples not in [1 << k for k in range(13)]:
            raise InputError("is not a power of two from 1 to 4096", field="samples", value=samples)
        if settings["batches"] < 2:
            raise InputError("is less than 2: no standard error", field="batches", value=settings["batches"])
        if settings["max_depth"] < 1:
            raise InputError("is less than 1", field="max_depth", value=settings["max_depth"])
        if settings["physics"] not in ("matched", "full"):
            remedy = 'Use "matched" or "full"'
            raise InputError("is not known", field="physics", value=settings["physics"], remedy=remedy)
        return settings

    def _facts(self, settings: Mapping[str, Any], transport: TransportScene, summary: _Summary) -> dict[str, Any]:
        return {
            "integrator": "portal",
            "variant": VARIANT,
            "mitsuba": mi.__version__,
            "drjit": dr.__version__,
            "threads": dr.thread_count(),
            "portals": len(transport.portals),
            "samples_per_batch": settings["samples"],
            "batches": settings["batches"],
            "batches_loaded": summary.loaded,
            "seconds": round(summary.seconds, 3),
        }


def camera_rays(view: View) -> CameraRays:
    """The pinhole camera of a view. Raises InputError when target and position coincide or `up` points along them."""
    position, target, up = (np.array(v, dtype=np.float64) for v in (view.position, view.target, view.up))
    forward = target - position
    right = np.cross(forward, up)
    if np.linalg.norm(forward) == 0 or np.linalg.norm(right) == 0:
        raise InputError("has no direction: target, position and up are on one line", field=f"views.{view.name}")
    forward, right = forward / np.linalg.norm(forward), right / np.linalg.norm(right)
    half_height = np.tan(0.5 * view.vertical_fov_rad)
    half_width = half_height * view.width / view.height
    return CameraRays(
        position, right * half_width, np.cross(right, forward) * half_height, forward, view.width, view.height
    )


class _Summary:
    """Running mean, halves (even and odd batches) and variance of luminance over batches [Welford 1962]."""

    def __init__(self) -> None:
        self.count = 0
        self.loaded = 0
        self.seconds = 0.0
        self.sums: list[Any] = [0.0, 0.0]
        self.counts = [0, 0]
        self.luminance_mean: Any = 0.0
        self.squares: Any = 0.0

    def add(self, index: int, values: NDArray[Any]) -> None:
        half = index % 2
        self.count += 1
        self.counts[half] += 1
        self.sums[half] = self.sums[half] + values.astype(np.float64)
        level = np.asarray(luminance(values.astype(np.float64)))
        step = level - self.luminance_mean
        self.luminance_mean = self.luminance_mean + step / self.count
        self.squares = self.squares + step * (level - self.luminance_mean)

    @property
    def mean(self) -> Float64:
        return np.asarray((self.sums[0] + self.sums[1]) / self.count)

    @property
    def halves(self) -> tuple[Float64, Float64]:
        return self.sums[0] / self.counts[0], self.sums[1] / self.counts[1]

    @property
    def standard_error(self) -> Float64:
        return np.asarray(np.sqrt(self.squares / (self.count - 1) / self.count))


def _run_batches(
    trace: Callable[[int], NDArray[Any]],
    settings: Mapping[str, Any],
    store: BatchStore | None,
    progress: Progress | None,
) -> _Summary:
    """Batch i depends on the seed and i alone, so that more batches can be added to a finished run."""
    summary, began, total = _Summary(), time.perf_counter(), int(settings["batches"])
    first = 0 if store is None else store.first
    if progress is not None:
        progress(first, total)
    for index in range(first, total):
        if store is not None and store.has(index):
            values = np.asarray(store.load(index)["values"])
            summary.loaded += 1
        else:
            values = trace(_batch_seed(int(settings["seed"]), index))
            if store is not None:
                store.save(index, {"values": values})
        summary.add(index, values)
        if progress is not None:
            progress(index + 1, total)
    summary.seconds = time.perf_counter() - began
    return summary


def _batch_seed(seed: int, index: int) -> int:
    return int(np.random.SeedSequence([seed & 0xFFFFFFFF, index]).generate_state(1)[0])


def _log2(value: int) -> int:
    return int(value).bit_length() - 1

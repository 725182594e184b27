"""Timings of the engine, scene by scene, each in a process of its own so that its peak memory is known."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError

from transom.errors import invalid_field
from transom.files import write_atomic
from transom.scene.model import ConditionSpec, Scene
from transom.suite import resized

SOLVE_REPEATS, RELIGHT_REPEATS, FRAME_REPEATS = 3, 32, 32
LEAST_REPEATS = 2
TIME_BUDGET_S = 4.0
"""Repeats of one quantity end after so many seconds, once there are LEAST_REPEATS: a report is to take minutes."""

FRAME_SIZE = (640, 480)
PLOT_RAYS = 2048
PLOT_MONTHS = (1, 2, 3, 4, 5, 6, 7, 8)
PLOT_HOURS = (9, 10, 11, 12, 13, 14, 15, 16)
"""Of the 8 x 8 plot: one moment a month, on its 21st day, at each of eight hours."""

Quantity = Literal["solve", "relight", "frame_rays", "frame_volumes", "plot_8x8", "peak_memory"]


@dataclass(frozen=True)
class Timing:
    """One quantity of one scene. first, median and p95 of `count` repeats in `unit` (s; MiB for peak_memory).

    triangles and patches: of the scene and of the solve. width, height: of the frame, 0 where there is none.
    """

    scene: str
    quantity: Quantity
    unit: str
    first: float
    median: float
    p95: float
    count: int
    triangles: int
    patches: int
    width: int = 0
    height: int = 0


def time_scenes(names: Sequence[str], note: Callable[[str], None]) -> list[Timing]:
    """Times each scene in a fresh process. `note` is told which one is next. Raises what the scene's process raised."""
    timings: list[Timing] = []
    context = multiprocessing.get_context("spawn")
    for name in names:
        note(name)
        with ProcessPoolExecutor(max_workers=1, mp_context=context) as pool:
            timings += pool.submit(time_scene, name).result()
    return timings


def time_scene(name: str) -> list[Timing]:
    """All timings of one scene, in this process. Conditions are resolved beforehand, except for the plot."""
    from transom.daylight.condition import resolve_condition
    from transom.engine import Engine
    from transom.scene import load_scene

    scene = load_scene(name)
    triangles = len(scene.mesh.triangles()[0])
    solved: list[Engine] = []

    def solve(_: int) -> None:
        solved[:] = [Engine.solve(scene)]

    solves = repeat(solve, SOLVE_REPEATS)
    engine = solved[0]
    patches = int(engine.facts()["patches"])
    conditions = [resolve_condition(spec, scene.site) for spec in scene.conditions]
    view = resized(scene.views[0], *FRAME_SIZE)

    def row(quantity: Quantity, samples: Sequence[float], size: tuple[int, int] = (0, 0), unit: str = "s") -> Timing:
        median, p95 = (float(value) for value in np.percentile(samples, [50, 95]))
        return Timing(name, quantity, unit, samples[0], median, p95, len(samples), triangles, patches, *size)

    rows = [row("solve", solves)]
    rows.append(row("relight", repeat(lambda i: engine.relight(conditions[i % len(conditions)]), RELIGHT_REPEATS)))
    engine.relight(conditions[0])
    rows.append(row("frame_rays", repeat(lambda _: engine.render(view, "rays"), FRAME_REPEATS), FRAME_SIZE))
    rows.append(row("frame_volumes", repeat(lambda _: engine.render(view, "volumes"), FRAME_REPEATS), FRAME_SIZE))
    target = next((entry for entry in scene.sensors if entry.target), None)
    if target is not None:
        points, normals = np.asarray(target.points), np.asarray(target.normals)

        def plot(_: int) -> None:
            for spec in plot_conditions(scene):
                engine.relight(resolve_condition(spec, scene.site))
                engine.illuminance(points, normals, rays=PLOT_RAYS, opening_rays=PLOT_RAYS)

        rows.append(row("plot_8x8", repeat(plot, 1)))
    rows.append(row("peak_memory", [peak_memory_mib()], unit="MiB"))
    return rows


def repeat(action: Callable[[int], object], count: int) -> list[float]:
    """Seconds that each of `count` calls action(0), action(1), ... took; fewer when the time budget is spent."""
    samples: list[float] = []
    for index in range(count):
        begin = time.perf_counter()
        action(index)
        samples.append(time.perf_counter() - begin)
        if sum(samples) > TIME_BUDGET_S and len(samples) >= LEAST_REPEATS:
            break
    return samples


def peak_memory_mib() -> float:
    """Largest resident memory of this process so far [MiB].

    From /proc where there is one: getrusage also counts what the parent process held before this one was started.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def plot_conditions(scene: Scene) -> list[ConditionSpec]:
    """The 64 moments of the 8 x 8 plot: the scene's first condition at other months and hours, levels from the sky."""
    first = replace(
        scene.conditions[0],
        zenith_luminance_cd_m2=None,
        diffuse_horizontal_illuminance_lx=None,
        direct_normal_illuminance_lx=None,
    )
    return [
        replace(first, name=f"{month:02d}_{hour:02d}", time=f"2026-{month:02d}-21T{hour:02d}:00")
        for month in PLOT_MONTHS
        for hour in PLOT_HOURS
    ]


def write_timings(path: Path, timings: Sequence[Timing]) -> None:
    write_atomic(path, TypeAdapter(list[Timing]).dump_json(list(timings), indent=1) + b"\n")


def read_timings(path: Path) -> list[Timing]:
    """Timings of an earlier run; none where there was none. Raises InputError for a malformed file."""
    if not path.is_file():
        return []
    try:
        return TypeAdapter(list[Timing]).validate_json(path.read_bytes())
    except ValidationError as error:
        raise invalid_field(error, path) from error

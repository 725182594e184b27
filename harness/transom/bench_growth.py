"""growth.json: what load, solve, relight, frame and memory cost as a hall gets more patches, openings and triangles."""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import TypeAdapter

from transom.bench import FRAME_SIZE, in_own_process
from transom.bench_hall import hall_scene, write_hall
from transom.daylight.condition import resolve_condition
from transom.files import write_atomic
from transom.progress import CaseProgress
from transom.provenance import Provenance, current_provenance
from transom.scene import load_scene
from transom.suite import resized
from transom.timing import peak_memory_mib

SCHEMA_FILE = Path(__file__).resolve().parents[2] / "reports" / "growth.schema.json"

Axis = Literal["patches", "openings", "triangles"]

PATCHES, OPENINGS, TRIANGLES = 3000, 24, 100_000
"""Of a point, but for what its axis varies."""
SWEEPS: dict[Axis, tuple[int, ...]] = {
    "patches": (1000, 3000, 10_000, 30_000),
    "openings": (1, 20, 200),
    "triangles": (1000, 10_000, 100_000, 1_000_000),
}
QUICK: dict[Axis, tuple[int, ...]] = {"patches": (1000, 3000), "openings": (1, 200), "triangles": (10_000, 100_000)}
REPEATS = 5


@dataclass(frozen=True)
class GrowthPoint:
    """What is asked for at one point of a sweep, and along which axis it lies."""

    axis: Axis
    patches: int = PATCHES
    openings: int = OPENINGS
    triangles: int = TRIANGLES


@dataclass(frozen=True)
class GrowthRow:
    """Costs at a point. patches, nodes, triangles: as they came out. Times [s] of the clock; solve_processor_s: of all
    threads together. Load and solve once, relight and frame the median of REPEATS. peak_memory_mib: of the process."""

    axis: Axis
    patches: int
    nodes: int
    openings: int
    triangles: int
    load_s: float
    solve_s: float
    solve_processor_s: float
    relight_s: float
    frame_s: float
    peak_memory_mib: float


@dataclass(frozen=True)
class Growth:
    """The whole file. load_average: of the machine before and after [processes, over one minute]."""

    format: Literal[1]
    created: datetime
    engine_build: str
    load_average: tuple[float, float]
    rows: tuple[GrowthRow, ...]
    provenance: Provenance


def growth_points(quick: bool) -> list[GrowthPoint]:
    """All points, one axis after the other."""
    sweeps = QUICK if quick else SWEEPS
    return [
        *(GrowthPoint("patches", patches=value) for value in sweeps["patches"]),
        *(GrowthPoint("openings", openings=value) for value in sweeps["openings"]),
        *(GrowthPoint("triangles", triangles=value) for value in sweeps["triangles"]),
    ]


def measure_growth(progress: CaseProgress, *, quick: bool = False) -> Growth:
    """Measures every point in a process of its own."""
    before = os.getloadavg()[0]
    rows = []
    for point in growth_points(quick):
        words = f"{point.patches} patches, {point.openings} openings, {point.triangles} triangles"
        progress.begin(f"{point.axis}: {words}")
        rows.append(in_own_process(measure_growth_point, point))
        progress.finish(f"solved in {rows[-1].solve_s:.1f} s, {rows[-1].peak_memory_mib:.0f} MiB")
    return Growth(
        1,
        datetime.now(UTC).replace(microsecond=0),
        in_own_process(_engine_build),
        (before, os.getloadavg()[0]),
        tuple(rows),
        current_provenance(),
    )


def measure_growth_point(point: GrowthPoint) -> GrowthRow:
    """The costs of one point, in this process."""
    from transom.engine import Engine, SolveOptions

    with tempfile.TemporaryDirectory() as folder:
        path = write_hall(Path(folder) / "hall", hall_scene(point.triangles, point.openings))
        begin = time.perf_counter()
        scene = load_scene(path)
        load_s = time.perf_counter() - begin
    begin, begin_processor = time.perf_counter(), time.process_time()
    engine = Engine.solve(scene, SolveOptions(target_patch_count=point.patches))
    solve_s, solve_processor_s = time.perf_counter() - begin, time.process_time() - begin_processor
    conditions = [resolve_condition(spec, scene.site) for spec in scene.conditions]
    view = resized(scene.views[0], *FRAME_SIZE)
    relight_s = _median_seconds(lambda index: engine.relight(conditions[index % len(conditions)]))
    frame_s = _median_seconds(lambda _: engine.render(view, "rays", components=False))
    facts = engine.facts()
    return GrowthRow(
        axis=point.axis,
        patches=int(facts["patches"]),
        nodes=int(facts["nodes"]),
        openings=point.openings,
        triangles=len(scene.mesh.triangles()[0]),
        load_s=load_s,
        solve_s=solve_s,
        solve_processor_s=solve_processor_s,
        relight_s=relight_s,
        frame_s=frame_s,
        peak_memory_mib=peak_memory_mib(),
    )


def growth_schema() -> str:
    """The JSON schema of growth.json, as kept in reports/growth.schema.json."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **TypeAdapter(Growth).json_schema()}
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def write_growth(path: Path, growth: Growth) -> None:
    write_atomic(path, TypeAdapter(Growth).dump_json(growth, indent=1) + b"\n")


def growth_lines(growth: Growth) -> Iterator[str]:
    """The file as a table for the terminal, with how each cost grows: the exponent of a power of what was varied."""
    yield (
        f"{'axis':10}{'patches':>8}{'nodes':>8}{'openings':>9}{'triangles':>10}"
        f"{'load':>10}{'solve':>10}{'relight':>12}{'frame':>11}{'memory':>11}"
    )
    for row in growth.rows:
        yield (
            f"{row.axis:10}{row.patches:>8}{row.nodes:>8}{row.openings:>9}{row.triangles:>10}{row.load_s:>8.1f} s"
            f"{row.solve_s:>8.1f} s{1e3 * row.relight_s:>9.1f} ms{1e3 * row.frame_s:>8.0f} ms"
            f"{row.peak_memory_mib:>7.0f} MiB"
        )
    for axis in SWEEPS:
        rows = [row for row in growth.rows if row.axis == axis]
        if len(rows) > 1:
            words = ", ".join(f"{name} {_exponent(rows, axis, name):.2f}" for name in COSTS)
            yield f"grows with {axis} to the power: {words}"


COSTS = ("load_s", "solve_s", "relight_s", "frame_s", "peak_memory_mib")


def _exponent(rows: list[GrowthRow], axis: Axis, name: str) -> float:
    """Slope of the last two points in logarithms."""
    (x0, y0), (x1, y1) = ((getattr(row, axis), getattr(row, name)) for row in rows[-2:])
    return float(np.log(y1 / y0) / np.log(x1 / x0))


def _median_seconds(action: Callable[[int], object]) -> float:
    samples = []
    for index in range(REPEATS):
        begin = time.perf_counter()
        action(index)
        samples.append(time.perf_counter() - begin)
    return float(np.median(samples))


def _engine_build() -> str:
    from transom.engine import build_description

    return build_description()

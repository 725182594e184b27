"""bench.json: how fast one scene loads, solves, relights, draws and measures, by phase and against its size.

Every point of a sweep runs in a process of its own, so that its peak memory is known. Nothing is judged here.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import TypeAdapter, ValidationError

from transom.bench_scenes import (
    beam_count,
    has_changeable_product,
    opening_face_count,
    scene_edits,
    target_for_patches,
    with_other_product,
    with_panes,
)
from transom.bench_worker import SENSOR_RAYS, phase_seconds
from transom.daylight.condition import resolve_condition
from transom.errors import InputError, invalid_field
from transom.fenestration.reglazing import load_glazed
from transom.files import write_atomic
from transom.machine_limits import BENCHMARKS, Limit, Utilisation, embree_rays, memory_copy, utilisations
from transom.progress import CaseProgress
from transom.provenance import Provenance, current_provenance
from transom.scene.model import Scene
from transom.suite import resized
from transom.timing import peak_memory_mib

SCHEMA_FILE = Path(__file__).resolve().parents[2] / "reports" / "bench.schema.json"

SMALL_PATCH_COUNTS, LARGE_PATCH_COUNTS = (1000, 3000), (10000, 30000)
PANE_SPLITS = (2, 4)
"""Each pane is cut into 2 x 2 and 4 x 4: more openings of the same area."""

DEFAULT_BUDGET_S, QUICK_BUDGET_S = 240.0, 40.0
MOST_REPEATS = 100
LEAST_REPEATS = 2
FRAME_SIZE = (640, 480)

Sweep = Literal["default", "patches", "openings"]
QuantityName = Literal[
    "load",
    "solve",
    "reglaze",
    "new_product",
    "recolour",
    "move_object",
    "add_object",
    "remove_object",
    "relight_hour",
    "relight_sky",
    "relight_overcast",
    "frame_rays",
    "frame_volumes",
    "sensors",
    "peak_memory",
]

NOTES = (
    "reglaze and recolour are edits: another transmittance of every pane, or another reflectance of the first opaque "
    "material, in a scene that is solved, and a relighting; the answer is that of a fresh solve, bit by bit; so are "
    "move_object, add_object and remove_object, of the largest closed object that stands free of panes",
    "relight_sky changes the sky alone and keeps the sun; the engine does all the work of a new hour",
    "beams are the sun and every lobe of a product that it shines on; relight_overcast has none",
    "load reads the scene's files; with solve and relight_hour it is what the paper sets against 86 s to set up a "
    "heliodon and 29 s to move its sun [Cutler et al. 2008, section 4.3.1]",
)


@dataclass(frozen=True)
class PhaseTimes:
    """A phase of a quantity, such as "solve/nodes": seconds in each repeat, and their median."""

    name: str
    samples: tuple[float, ...]
    median: float


@dataclass(frozen=True)
class Measurement:
    """One quantity at one point of a sweep; `samples` are all repeats in order, in `unit`.

    sweep: what was varied. patches, nodes: of the solve. openings: faces of panes. beams: of the condition.
    points: sensors measured. width, height: of the frame. Counts that do not apply are 0.
    """

    quantity: QuantityName
    unit: Literal["s", "MiB"]
    sweep: Sweep
    patches: int
    nodes: int
    triangles: int
    openings: int
    beams: int
    points: int
    width: int
    height: int
    first: float
    median: float
    p95: float
    samples: tuple[float, ...]
    phases: tuple[PhaseTimes, ...] = ()


@dataclass(frozen=True)
class Bench:
    """The whole file. load_average: of the machine before and after [processes, over one minute]. left_out: points of
    the sweeps that the budget did not allow, or that failed, and why. notes: what a quantity means and does not."""

    format: Literal[1]
    created: datetime
    scene: str
    engine_build: str
    budget_s: float
    load_average: tuple[float, float]
    measurements: tuple[Measurement, ...]
    limits: tuple[Limit, ...]
    utilisations: tuple[Utilisation, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: Provenance


@dataclass(frozen=True)
class Point:
    """One point of a sweep: patches wanted (0: the default), and how panes are changed (0: all closed but one)."""

    sweep: Sweep
    wanted_patches: int = 0
    pane_split: int = 1

    def label(self) -> str:
        if self.sweep == "patches":
            return f"{self.wanted_patches} patches"
        if self.sweep == "openings":
            return "one pane" if self.pane_split == 0 else f"panes cut {self.pane_split}x{self.pane_split}"
        return "default settings"


@dataclass(frozen=True)
class PointResult:
    measurements: tuple[Measurement, ...]
    limits: tuple[Limit, ...]
    utilisations: tuple[Utilisation, ...]


def bench_scene(
    name: str, progress: CaseProgress, *, budget_s: float, quick: bool = False, glazings: Sequence[str] = ()
) -> Bench:
    """Times a scene at its default settings, then over patches and openings, for about `budget_s` seconds.

    Every quantity is repeated at least twice (a solve at least once), so that a large scene may take longer; what is
    no longer begun is named in `left_out`. glazings: other glazing than the scene's (transom.fenestration.reglazing).
    Raises InputError for a scene that cannot be solved.
    """
    began, load = time.monotonic(), os.getloadavg()[0]
    scene = load_glazed(name, glazings)
    points = bench_points(scene, quick)
    measurements: list[Measurement] = []
    limits: tuple[Limit, ...] = ()
    used: tuple[Utilisation, ...] = ()
    left_out: list[str] = []
    for index, point in enumerate(points):
        progress.begin(f"{name}: {point.label()}")
        remaining = budget_s - (time.monotonic() - began)
        if index and remaining < _expected_seconds(point, measurements):
            left_out.append(f"{point.label()}: the time budget of {budget_s:g} s was spent")
            progress.finish("left out: the budget is spent")
            continue
        share = max(remaining, 0.0) / (len(points) - index) * (2 if index == 0 else 1)
        try:
            found = in_own_process(measure_point, name, point, share, tuple(glazings))
        except InputError as error:
            if index == 0:
                raise
            left_out.append(f"{point.label()}: {error}")
            progress.finish(f"left out: {error}")
            continue
        measurements += found.measurements
        limits, used = limits or found.limits, used or found.utilisations
        if index == 0 and not any(limit.name == "embree_rays" for limit in limits):
            left_out.append(f"rays of Embree alone: {BENCHMARKS.name} is not built (make engine)")
        progress.finish(f"{len(found.measurements)} quantities")
    return Bench(
        format=1,
        created=datetime.now(UTC).replace(microsecond=0),
        scene=scene.name,
        engine_build=in_own_process(_engine_build),
        budget_s=budget_s,
        load_average=(load, os.getloadavg()[0]),
        measurements=tuple(measurements),
        limits=limits,
        utilisations=used,
        left_out=tuple(left_out),
        notes=NOTES,
        provenance=current_provenance(),
    )


def bench_points(scene: Scene, quick: bool) -> list[Point]:
    """Default settings first, then the sweeps, what takes longest last."""
    points = [Point("default")]
    points += [Point("patches", count) for count in SMALL_PATCH_COUNTS]
    if opening_face_count(scene) > 1:
        points.append(Point("openings", pane_split=0))
    if opening_face_count(scene) > 0:
        points += [Point("openings", pane_split=split) for split in PANE_SPLITS[: 1 if quick else None]]
    return points if quick else points + [Point("patches", count) for count in LARGE_PATCH_COUNTS]


def measure_point(name: str, point: Point, budget_s: float, glazings: Sequence[str] = ()) -> PointResult:
    """All quantities of one point, in this process. Sweeps are of solve, relighting, frame and memory alone."""
    from transom.engine import Engine, SolveOptions

    whole = point.sweep == "default"
    loads = _repeated(lambda _: load_glazed(name, glazings), 0.03 * budget_s)
    scene = load_glazed(name, glazings)
    if point.sweep == "openings":
        scene = with_panes(scene, point.pane_split)
    options = SolveOptions()
    if point.wanted_patches:
        options = replace(options, target_patch_count=target_for_patches(scene, point.wanted_patches))
    conditions = [resolve_condition(spec, scene.site) for spec in scene.conditions]
    sun = [condition for condition in conditions if condition.sun_direction is not None] or conditions
    if not conditions or not scene.views:
        raise InputError("has no view or no condition to time", file=scene.file)
    view = resized(scene.views[0], *FRAME_SIZE)
    rows: list[Measurement] = []
    state: dict[str, Engine] = {}
    edits = scene_edits(scene)

    def add(
        quantity: QuantityName,
        action: Callable[[int], object],
        share: float,
        *,
        least: int = LEAST_REPEATS,
        beams: int = 0,
        points: int = 0,
        size: tuple[int, int] = (0, 0),
    ) -> None:
        seconds: list[float] = []
        phases: list[dict[str, float]] = []

        def once(index: int) -> None:
            seen = len(state["engine"].trace()) if "engine" in state else 0
            action(index)
            spans = state["engine"].trace()
            phases.append(phase_seconds(spans if quantity == "solve" or quantity in edits else spans[seen:], quantity))

        seconds = _repeated(once, share * budget_s, least)
        rows.append(_measurement(quantity, point, seconds, phases, scene, state["engine"], beams, points, size))

    def solve(_: int) -> None:
        state["engine"] = Engine.solve(scene, options, trace=True)

    add("solve", solve, 0.35, least=1)
    engine = state["engine"]
    beams = beam_count(scene, sun[0])
    if whole:
        rows.insert(0, _measurement("load", point, loads, [], scene, engine, 0, 0, (0, 0)))
    add("relight_hour", lambda i: engine.relight(sun[i % len(sun)]), 0.12, beams=beams)
    if whole:
        skies = [
            resolve_condition(replace(sun[0].spec, sky=f"cie:{kind}", **_NO_LEVELS), scene.site) for kind in (8, 12)
        ]
        skies = [replace(sky, sun_illuminance_rgb=sun[0].sun_illuminance_rgb) for sky in skies]
        add("relight_sky", lambda i: engine.relight(skies[i % 2]), 0.06, beams=beams)
        overcast = resolve_condition(replace(sun[0].spec, sky="overcast", **_NO_LEVELS), scene.site)
        add("relight_overcast", lambda _: engine.relight(overcast), 0.06)
        engine.relight(sun[0])
    add("frame_rays", lambda _: engine.render(view, "rays"), 0.1, beams=beams, size=FRAME_SIZE)
    limits: tuple[Limit, ...] = ()
    used: tuple[Utilisation, ...] = ()
    if whole:
        if _draws_volumes(engine, scene):
            add("frame_volumes", lambda _: engine.render(view, "volumes"), 0.1, beams=beams, size=FRAME_SIZE)
        if scene.sensors:
            places = np.concatenate([sensors.points for sensors in scene.sensors])
            normals = np.concatenate([sensors.normals for sensors in scene.sensors])

            def sensors(_: int) -> None:
                engine.illuminance(places, normals, rays=SENSOR_RAYS, opening_rays=SENSOR_RAYS)

            add("sensors", sensors, 0.06, beams=beams, points=len(places))
    rows.append(_measurement("peak_memory", point, [peak_memory_mib()], [], scene, engine, 0, 0, (0, 0)))
    if whole:
        limits = tuple(limit for limit in (memory_copy(), embree_rays()) if limit is not None)
        medians = {phase.name: phase.median for row in rows for phase in row.phases}
        used = utilisations(engine, medians, limits)
    if whole and has_changeable_product(scene):

        def new_product(index: int) -> None:
            engine.replace_products(with_other_product(scene, index))
            engine.relight(sun[0])

        add("new_product", new_product, 0.1, beams=beams)
    elif whole:
        for name, change in edits.items():
            solved = engine if change.before is scene else engine.edited(change.before)

            def edit(index: int, solved: Engine = solved, scenes: Sequence[Scene] = change.after) -> None:
                state["engine"] = solved.edited(scenes[index % len(scenes)])
                state["engine"].relight(sun[0])

            add(name, edit, 0.06, least=1, beams=beams)
    return PointResult(tuple(rows), limits, used)


_NO_LEVELS: dict[str, Any] = {
    "zenith_luminance_cd_m2": None,
    "diffuse_horizontal_illuminance_lx": None,
    "direct_normal_illuminance_lx": None,
}
"""Another sky takes its levels from the availability model."""


def write_bench(path: Path, bench: Bench) -> None:
    write_atomic(path, TypeAdapter(Bench).dump_json(bench, indent=1) + b"\n")


def read_bench(path: Path) -> Bench:
    """A file of `write_bench`. Raises InputError for one that does not exist or is not in its form."""
    try:
        return TypeAdapter(Bench).validate_json(path.read_bytes())
    except FileNotFoundError as error:
        raise InputError("does not exist", file=path, remedy="transom bench SCENE writes it") from error
    except ValidationError as error:
        raise invalid_field(error, path) from error


def bench_schema() -> str:
    """The JSON schema of bench.json, as kept in reports/bench.schema.json."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **TypeAdapter(Bench).json_schema()}
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def bench_lines(bench: Bench) -> list[str]:
    """The file as a table for the terminal."""
    lines = [f"{'quantity':18}{'patches':>8}{'openings':>9}{'first':>13}{'median':>12}{'p95':>12}{'count':>7}"]
    for row in bench.measurements:
        cells = [f"{1e3 * value:.1f} ms" if row.unit == "s" else f"{value:.0f} MiB" for value in _three(row)]
        counts = f"{row.patches:>8}{row.openings:>9}"
        lines.append(f"{row.quantity:18}{counts}{cells[0]:>13}{cells[1]:>12}{cells[2]:>12}{len(row.samples):>7}")
    lines += [f"limit {limit.name}: {limit.median / 1e9:.3g} {limit.giga_unit()}" for limit in bench.limits]
    lines += [f"{used.phase}: {100 * used.share:.0f} % of {used.limit}" for used in bench.utilisations]
    return lines + [f"left out: {text}" for text in bench.left_out]


def _three(row: Measurement) -> tuple[float, float, float]:
    return row.first, row.median, row.p95


def _measurement(
    quantity: QuantityName,
    point: Point,
    samples: Sequence[float],
    phases: Sequence[dict[str, float]],
    scene: Scene,
    engine: Any,
    beams: int,
    points: int,
    size: tuple[int, int],
) -> Measurement:
    facts = engine.facts()
    median, p95 = (float(value) for value in np.percentile(samples, [50, 95]))
    names = [name for name in (phases[0] if phases else {}) if all(name in entry for entry in phases)]
    return Measurement(
        quantity=quantity,
        unit="MiB" if quantity == "peak_memory" else "s",
        sweep=point.sweep,
        patches=int(facts["patches"]),
        nodes=int(facts["nodes"]),
        triangles=len(scene.mesh.triangles()[0]),
        openings=opening_face_count(scene),
        beams=beams,
        points=points,
        width=size[0],
        height=size[1],
        first=float(samples[0]),
        median=median,
        p95=p95,
        samples=tuple(float(value) for value in samples),
        phases=tuple(
            PhaseTimes(
                name, tuple(entry[name] for entry in phases), float(np.median([entry[name] for entry in phases]))
            )
            for name in names
        ),
    )


def _repeated(action: Callable[[int], object], budget_s: float, least: int = LEAST_REPEATS) -> list[float]:
    """Seconds of action(0), action(1), ... until the budget is spent, at least `least` and at most MOST_REPEATS."""
    samples: list[float] = []
    while len(samples) < least or (sum(samples) < budget_s and len(samples) < MOST_REPEATS):
        begin = time.perf_counter()
        action(len(samples))
        samples.append(time.perf_counter() - begin)
    return samples


def _draws_volumes(engine: Any, scene: Scene) -> bool:
    """Whether there is an OpenGL that draws shadow volumes."""
    try:
        engine.render(resized(scene.views[0], 8, 8), "volumes")
    except RuntimeError:
        return False
    return True


def _expected_seconds(point: Point, measurements: Sequence[Measurement]) -> float:
    """Least seconds that a point will take: one solve, in proportion to the patches wanted, and half as much again."""
    solves = [row for row in measurements if row.quantity == "solve"]
    last = max(solves, key=lambda row: row.patches)
    wanted = point.wanted_patches or last.patches
    return 1.5 * last.median * max(wanted / last.patches, 0.3)


def in_own_process(function: Callable[..., Any], *arguments: object) -> Any:
    """The function's answer from a process that has done nothing else."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context) as pool:
        return pool.submit(function, *arguments).result()


def _engine_build() -> str:
    from transom.engine import build_description

    return build_description()

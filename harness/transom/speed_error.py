"""Speed against error: the engine and other programs over their settings, in one run on one machine.

Each program renders one view; its error is the mean relative error over the pixels of the interior, against the stored
reference, whose own noise is taken out (transom.error_measures). Times are raw samples of two phases:

    cold   a new process loads the scene, prepares all that it needs and renders; importing libraries is not counted.
           Programs that compile (Mitsuba) find the kernels that earlier runs left on disk, if they did.
    hour   another sun and sky of the same scene in the same process: relight and frame for the engine; for path tracers
           setting up that light and rendering again, with everything compiled; for Radiance a whole rendering.

Mitsuba is seeded differently from the reference, so that their noises are independent.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from transom.bundle import find_bundle, make_case
from transom.compare import CaseNames, compare_region
from transom.daylight.condition import Condition, resolve_condition
from transom.errors import InputError, invalid_field
from transom.fenestration.reglazing import reglazed
from transom.files import write_atomic
from transom.machine_limits import Limit, memory_copy
from transom.progress import CaseProgress
from transom.provenance import Provenance, current_provenance
from transom.references import REFERENCE_RENDERER
from transom.renderer import RENDERERS, ImageResult, load_renderer
from transom.scene import load_scene
from transom.scene.model import ConditionSpec, Scene, View
from transom.speed_ratio import SpeedUp, dominated, speed_ups
from transom.suite import choose, resized
from transom.visible import INTERIOR, region_masks

SCHEMA_FILE = Path(__file__).resolve().parents[2] / "reports" / "speed_error.schema.json"

Phase = Literal["cold", "hour"]
ENGINE = "engine"
ENGINE_METHODS: Mapping[str, Literal["gather", "classic"]] = {ENGINE: "gather", "classic": "classic"}
"""Programs that are the engine, and its method; "classic" is the published one."""

DEFAULT_SETTING = "default"
FIRST_SEED = 1009
"""Of the programs that draw random numbers; references have seed 1."""

REFERENCE_WIDTHS = (None, 320, 160)
"""Sizes at which references are stored: the view's own, and those of the suites."""

COLD_REPEATS, HOUR_REPEATS = 3, 5
QUICK_COLD_REPEATS, QUICK_HOUR_REPEATS = 2, 3
HOUR_BUDGET_S = 10.0
"""Further hours end after so many seconds in each process, once there is one: slow programs need not be timed often."""


@dataclass(frozen=True)
class Setting:
    """One setting of one program. quick: whether a quick run has it."""

    program: str
    name: str
    options: Mapping[str, Any]
    quick: bool = False


FEW_RAYS = {"patch_rays": 128, "patch_opening_rays": 64, "node_rays": 256, "node_opening_rays": 96}
HALF_THE_RAYS = {"patch_rays": 256, "patch_opening_rays": 64, "node_rays": 512, "node_opening_rays": 192}

SETTINGS: tuple[Setting, ...] = (
    Setting(ENGINE, "300 patches, few rays", {"target_patch_count": 300, **FEW_RAYS}, True),
    Setting(ENGINE, "1000 patches", {"target_patch_count": 1000}, True),
    Setting(ENGINE, DEFAULT_SETTING, {}, True),
    Setting(ENGINE, "half the rays", HALF_THE_RAYS),
    Setting(ENGINE, "wider nodes", {"node_tolerance": 0.24}),
    Setting(ENGINE, "10000 patches", {"target_patch_count": 10000}),
    Setting("classic", "1000 patches", {"target_patch_count": 1000}),
    Setting("classic", DEFAULT_SETTING, {}, True),
    Setting("classic", "10000 patches", {"target_patch_count": 10000}),
    Setting("mitsuba", "2 paths a pixel", {"samples": 1, "batches": 2}, True),
    Setting("mitsuba", "8 paths a pixel", {"samples": 4, "batches": 2}),
    Setting("mitsuba", "32 paths a pixel", {"samples": 16, "batches": 2}, True),
    Setting("mitsuba", "128 paths a pixel", {"samples": 64, "batches": 2}),
    Setting("mitsuba", "512 paths a pixel", {"samples": 64, "batches": 8}),
    Setting("radiance", "fast", {"preset": "fast"}, True),
    Setting("radiance", "accurate", {"preset": "accurate"}),
)


@dataclass(frozen=True)
class SpeedErrorRow:
    """One setting of one program in one phase. seconds: raw samples.

    error_percent: mean |relative error| of the interior's pixels, the reference's noise taken out; its standard
    uncertainty; and error_bias_percent: what extrapolation may have left or taken too much. dominated_by: a setting of
    any program that is at least as fast and as right in this phase, "" on the frontier.
    """

    scene: str
    view: str
    condition: str
    program: str
    setting: str
    phase: Phase
    seconds: tuple[float, ...]
    error_percent: float
    error_uncertainty_percent: float
    error_bias_percent: float
    dominated_by: str = ""


@dataclass(frozen=True)
class Missing:
    """A program or setting without a point, and why."""

    program: str
    setting: str
    reason: str


@dataclass(frozen=True)
class SpeedError:
    """The whole file. reference_key, reference_noise_percent: of the stored reference that errors are against.
    load_average: of the machine before and after [processes, over one minute]."""

    format: Literal[1]
    created: datetime
    width: int
    height: int
    reference_key: str
    reference_noise_percent: float
    rows: tuple[SpeedErrorRow, ...]
    speed_ups: tuple[SpeedUp, ...]
    missing: tuple[Missing, ...]
    limits: tuple[Limit, ...]
    load_average: tuple[float, float]
    provenance: Provenance


@dataclass(frozen=True)
class Task:
    """What every program is asked: a view, the condition with a reference, and another hour."""

    scene: Scene
    view: View
    condition: Condition
    other: Condition


@dataclass(frozen=True)
class Timed:
    """What one process found: seconds of its cold start, of further hours, and the picture of the task's condition."""

    cold_s: float
    hour_s: tuple[float, ...]
    picture: ImageResult


def measure_speed_error(
    name: str,
    progress: CaseProgress,
    *,
    view: str | None = None,
    condition: str | None = None,
    quick: bool = False,
    settings: Sequence[Setting] = SETTINGS,
    glazings: Sequence[str] = (),
) -> SpeedError:
    """Runs every setting, each in new processes. Names None: the scene's first. What cannot run is listed as missing.

    Raises InputError where the view has no stored reference in that condition.
    """
    load = os.getloadavg()[0]
    task = make_task(reglazed(load_scene(name), glazings), view, condition)
    task, reference, key, facts = _with_reference(task)
    names = CaseNames(
        scene=task.scene.name,
        condition=task.condition.name,
        method="",
        reference=REFERENCE_RENDERER,
        view=task.view.name,
        reference_batch_count=int(facts.get("batches", 0)),
        reference_means=facts.get("group_means_cd_m2", {}),
    )
    mask = region_masks(task.scene, task.view)[INTERIOR]
    rows: list[SpeedErrorRow] = []
    missing: list[Missing] = []
    for setting in [entry for entry in settings if entry.quick or not quick]:
        progress.begin(f"{setting.program}: {setting.name}")
        if setting.program not in (*RENDERERS, *ENGINE_METHODS):
            missing.append(Missing(setting.program, setting.name, "there is no such renderer here"))
            progress.finish("missing")
            continue
        try:
            runs = _runs(name, task, setting, quick, progress)
        except (InputError, ImportError, OSError, RuntimeError, ValueError) as error:
            missing.append(Missing(setting.program, setting.name, str(error)))
            progress.finish(f"missing: {error}")
            continue
        found = setting_rows(runs, setting, reference, mask, names)
        rows += found
        progress.finish(f"{found[0].error_percent:.2f} %, cold {np.median(found[0].seconds):.3g} s")
    return SpeedError(
        format=1,
        created=datetime.now(UTC).replace(microsecond=0),
        width=task.view.width,
        height=task.view.height,
        reference_key=key,
        reference_noise_percent=float(facts.get("relative_standard_error_percent", 0.0)),
        rows=tuple(dominated(rows)),
        speed_ups=tuple(speed_ups(rows, ENGINE, DEFAULT_SETTING)),
        missing=tuple(missing),
        limits=(memory_copy(),),
        load_average=(load, os.getloadavg()[0]),
        provenance=current_provenance(),
    )


def make_task(scene: Scene, view: str | None, condition: str | None) -> Task:
    """The view and condition of those names (None: the first), and the next condition as another hour."""
    chosen = choose(scene.views, None if view is None else [view], scene, "view")
    specs = choose(scene.conditions, None if condition is None else [condition], scene, "condition")
    if not chosen or not specs:
        raise InputError("has no view or no condition", file=scene.file)
    others: list[ConditionSpec] = [spec for spec in scene.conditions if spec != specs[0]] or [specs[0]]
    return Task(scene, chosen[0], resolve_condition(specs[0], scene.site), resolve_condition(others[0], scene.site))


def time_program(name: str, task: Task, setting: Setting, seed: int, hours: int) -> Timed:
    """Cold start and further hours of one setting, in this process. Libraries are imported before the clock starts."""
    if setting.program in ENGINE_METHODS:
        return _time_engine(name, task, setting, hours)
    renderer = load_renderer(setting.program)
    options = {**renderer.default_options(), **setting.options}
    if "seed" in options:
        options["seed"] = seed
    begin = time.perf_counter()
    scene = reglazed(load_scene(name), task.scene.glazings)
    picture = renderer.render(scene, task.condition, task.view, options)
    cold = time.perf_counter() - begin
    seconds: list[float] = []
    while len(seconds) < hours and sum(seconds) < HOUR_BUDGET_S:
        light = task.condition if len(seconds) % 2 else task.other
        begin = time.perf_counter()
        renderer.render(scene, light, task.view, options)
        seconds.append(time.perf_counter() - begin)
    return Timed(cold, tuple(seconds), ImageResult(picture.mean))


def setting_rows(
    runs: Sequence[Timed], setting: Setting, reference: ImageResult, mask: NDArray[np.bool_], names: CaseNames
) -> list[SpeedErrorRow]:
    """The rows of one setting: the mean error over the runs' pictures, and its uncertainty with their spread."""
    compared = [compare_region(run.picture, reference, mask, INTERIOR, names) for run in runs]
    errors = [row.mean_relative_error_percent for row in compared]
    spread = float(np.std(errors, ddof=1) / len(errors) ** 0.5) if len(errors) > 1 else 0.0
    uncertainty = float(np.hypot(compared[0].mean_relative_error_standard_error_percent, spread))
    bias = max(row.mean_relative_error_extrapolation_percent for row in compared)
    seconds: dict[Phase, tuple[float, ...]] = {
        "cold": tuple(run.cold_s for run in runs),
        "hour": tuple(value for run in runs for value in run.hour_s),
    }
    return [
        SpeedErrorRow(
            scene=names.scene,
            view=names.view,
            condition=names.condition,
            program=setting.program,
            setting=setting.name,
            phase=phase,
            seconds=samples,
            error_percent=float(np.mean(errors)),
            error_uncertainty_percent=uncertainty,
            error_bias_percent=bias,
        )
        for phase, samples in seconds.items()
        if samples
    ]


def write_speed_error(path: Path, found: SpeedError) -> None:
    write_atomic(path, TypeAdapter(SpeedError).dump_json(found, indent=1) + b"\n")


def read_speed_error(path: Path) -> SpeedError:
    """A file of `write_speed_error`. Raises InputError for one that does not exist or is not in its form."""
    try:
        return TypeAdapter(SpeedError).validate_json(path.read_bytes())
    except FileNotFoundError as error:
        raise InputError("does not exist", file=path, remedy="transom bench SCENE --speed-error writes it") from error
    except ValidationError as error:
        raise invalid_field(error, path) from error


def speed_error_schema() -> str:
    """The JSON schema of speed_error.json, as kept in reports/speed_error.schema.json."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **TypeAdapter(SpeedError).json_schema()}
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def speed_error_lines(found: SpeedError) -> list[str]:
    """The file as a table for the terminal, and the speed-ups as sentences."""
    lines = [f"{'program':10}{'setting':24}{'phase':7}{'error [%]':>16}{'seconds':>12}  dominated by"]
    for row in found.rows:
        error = f"{row.error_percent:.2f} ± {row.error_uncertainty_percent:.2f}"
        seconds = f"{np.median(row.seconds):.4g}"
        lines.append(f"{row.program:10}{row.setting:24}{row.phase:7}{error:>16}{seconds:>12}  {row.dominated_by}")
    lines += [entry.sentence() for entry in found.speed_ups]
    return lines + [f"missing: {entry.program}, {entry.setting}: {entry.reason}" for entry in found.missing]


def _time_engine(name: str, task: Task, setting: Setting, hours: int) -> Timed:
    """The engine's own steps: `EngineRenderer` audits each answer as well, which a user does not wait for."""
    from transom.engine import Engine, SolveOptions

    options = SolveOptions(method=ENGINE_METHODS[setting.program], **setting.options)
    begin = time.perf_counter()
    engine = Engine.solve(reglazed(load_scene(name), task.scene.glazings), options)
    engine.relight(task.condition)
    picture = engine.render(task.view).radiance
    cold = time.perf_counter() - begin
    seconds = []
    for index in range(hours):
        begin = time.perf_counter()
        engine.relight(task.other if index % 2 == 0 else task.condition)
        engine.render(task.view)
        seconds.append(time.perf_counter() - begin)
    return Timed(cold, tuple(seconds), ImageResult(picture))


def _runs(name: str, task: Task, setting: Setting, quick: bool, progress: CaseProgress) -> list[Timed]:
    repeats = QUICK_COLD_REPEATS if quick else COLD_REPEATS
    hours = QUICK_HOUR_REPEATS if quick else HOUR_REPEATS
    context = multiprocessing.get_context("spawn")
    runs = []
    for index in range(repeats):
        with ProcessPoolExecutor(max_workers=1, mp_context=context) as pool:
            runs.append(pool.submit(time_program, name, task, setting, FIRST_SEED + index, hours).result())
        progress.update(index + 1, repeats)
    return runs


def _with_reference(task: Task) -> tuple[Task, ImageResult, str, Mapping[str, Any]]:
    """The task at a size at which there is a reference, the reference's picture, its key and facts."""
    renderer = load_renderer(REFERENCE_RENDERER)
    for width in REFERENCE_WIDTHS:
        view = task.view if width is None else resized(task.view, width)
        bundle = find_bundle(make_case(task.scene, task.condition, renderer, {}, view=view))
        if bundle is not None:
            facts = bundle.record.facts
            return Task(task.scene, view, task.condition, task.other), bundle.image(), bundle.record.key, facts
    raise InputError(
        f"has no stored reference in condition {task.condition.name}",
        file=task.scene.file,
        field=f"views.{task.view.name}",
        remedy="Choose a case of a suite (transom list suites), or add it to one and run: transom run references",
    )

"""`transom check`: a suite against its references, and against its own blessed baseline, where noise hides nothing."""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter
from rich.console import Console

from transom.baseline import (
    Baseline,
    Drift,
    Measured,
    baseline_file,
    bless,
    checked_reason,
    drifts,
    read_baseline,
    worth_judging,
)
from transom.bundle import find_bundle, make_case
from transom.colour import luminance
from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.files import write_atomic
from transom.judge import Missing, Outcome, ToleranceFile, Verdict, exit_code, judge, read_tolerances
from transom.measures import (
    UP_CLOSE_RAYS,
    Measure,
    fact_measures,
    geometry_measures,
    image_measures,
    sensor_measures,
    sun_measures,
    triangle_measures,
    triangle_points,
)
from transom.progress import CaseProgress
from transom.renderer import Float64, ImageResult, Progress, Renderer, SensorResult, load_renderer
from transom.run import Question, engine_questions
from transom.scene import scene_root
from transom.scene.model import Scene, View
from transom.sensor_file import SensorTable, scene_sensors
from transom.suite import Suite, SuiteCase, load_suite
from transom.visible import first_surfaces
from transom.workflow import ENGINE, VISIBILITIES, Crash, compare_suite, judge_compared, render_questions

BLESSED_SEEDS = 16
"""Seeds by which a blessing learns how far another seed alone moves a measure."""

LIGHT_METHOD = "rays"
"""The visibility method whose pictures are measured in full; of the other, only sunlight differs."""


@dataclass(frozen=True)
class Asked:
    """One case of a suite as it is measured: a view by one visibility method, or, without a view, all sensors of a
    scene or (`faces`) all of its triangles from up close."""

    entry: SuiteCase
    view: View | None
    method: str
    faces: bool = False

    @property
    def place(self) -> str:
        if self.view is not None:
            return self.view.name
        return "faces" if self.faces else "sensors"

    @property
    def name(self) -> str:
        return "/".join((self.entry.scene.name, self.place, self.entry.condition.name, self.method))


@dataclass(frozen=True)
class Checked:
    """What a check of one suite found. drifts: those that were judged, in the order of `baseline_verdicts`."""

    suite: str
    title: str
    seed: int | None
    comparison: Comparison
    verdicts: Sequence[Verdict]
    drifts: Sequence[Drift]
    baseline_verdicts: Sequence[Verdict]
    blessed: str
    seconds: float

    @property
    def exit_code(self) -> int:
        """Of references and baseline together; a side without any verdict counts as missing."""
        codes = {exit_code(self.verdicts), exit_code(self.baseline_verdicts)}
        return next(code for code in (4, 2, 1, 3, 0) if code in codes)

    def judged(self) -> list[tuple[Comparison, Sequence[Verdict]]]:
        """Both sides, for JUnit."""
        title = f"{self.title}, against its blessed baseline"
        baseline = Comparison(COMPARISON_FORMAT, f"{self.suite} baseline", title)
        return [(self.comparison, self.verdicts), (baseline, self.baseline_verdicts)]


class WithOptions:
    """A renderer with other defaults, such as another seed."""

    def __init__(self, renderer: Renderer, options: Mapping[str, Any]) -> None:
        self.name, self.version = renderer.name, renderer.version
        self._renderer, self._options = renderer, dict(options)

    def default_options(self) -> dict[str, Any]:
        return {**self._renderer.default_options(), **self._options}

    def render(
        self,
        scene: Scene,
        condition: Condition,
        view: View,
        options: Mapping[str, Any],
        progress: Progress | None = None,
    ) -> ImageResult:
        return self._renderer.render(scene, condition, view, {**self.default_options(), **options}, progress)

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
        return self._renderer.illuminance(scene, condition, points, normals, options, progress)


def check_suite(
    name: str, build: Path, *, seed: int | None = None, engine: Renderer | None = None, folder: Path | None = None
) -> Checked:
    """Renders a suite with the engine, compares and judges it against references and baseline.

    seed: of the engine, instead of its default; then means over seeds are compared. engine: in place of the engine.
    folder: of the baselines. Raises InputError for a malformed baseline; a missing one is a verdict.
    """
    started = time.perf_counter()
    suite = load_suite(name)
    if suite.reference != "mitsuba":
        raise InputError("has no pictures to check", field="SUITE", value=name, remedy="Choose a suite of rooms")
    engine = engine or load_renderer(ENGINE)
    if seed is not None:
        engine = WithOptions(engine, {"seed": seed})
    baseline = read_baseline(baseline_file(name, folder))
    questions = list(engine_questions(suite, engine, VISIBILITIES))
    questions += [Question(_case(asked, engine)) for asked in asked_cases(suite) if asked.faces]
    questions.sort(key=_solve)  # what one solve answers stands together
    crashes = render_questions(engine, questions, name)
    comparison = compare_suite(suite, build, crashes, engine)
    verdicts = judge_compared(name, build)
    tolerances = read_tolerances(scene_root() / "tolerances.toml")
    rows, missing = _against_baseline(suite, engine, baseline, crashes, fresh_seed=seed is not None)
    rows = worth_judging(rows, tolerances)
    blessed = "" if baseline is None else f"{baseline.history[-1].date[:10]}, {baseline.history[-1].reason}"
    return Checked(
        suite=name,
        title=suite.title,
        seed=seed,
        comparison=comparison,
        verdicts=verdicts,
        drifts=rows,
        baseline_verdicts=_judge_drifts(rows, missing, tolerances, baseline),
        blessed=blessed,
        seconds=time.perf_counter() - started,
    )


def _solve(question: Question) -> tuple[str, int]:
    return question.case.scene.name, -int(question.case.options.get("target_patch_count", 0))


def write_check(path: Path, checked: Sequence[Checked]) -> None:
    """check.json: everything that was compared with baselines and decided."""
    write_atomic(path, TypeAdapter(list[Checked]).dump_json(list(checked), indent=1) + b"\n")


def bless_suite(
    name: str, reason: str, *, seeds: int = BLESSED_SEEDS, engine: Renderer | None = None, folder: Path | None = None
) -> Baseline:
    """Measures a suite with several seeds, the default one first, and blesses what was found.

    A seed with which the engine refuses a scene is left out, and named in the history.
    """
    if seeds < 2:
        raise InputError("are too few to know a spread", field="--seeds", value=seeds, remedy="At least 2")
    suite = load_suite(name)
    engine = engine or load_renderer(ENGINE)
    path = baseline_file(name, folder)
    checked_reason(reason)
    read_baseline(path)
    default = int(engine.default_options()["seed"])
    by_case: dict[str, list[list[Measure]]] = {asked.name: [] for asked in asked_cases(suite)}
    refused: list[str] = []
    with CaseProgress(seeds, Console(stderr=True)) as bars:
        for seed in range(default, default + seeds):
            bars.begin(f"{name} with seed {seed}")
            try:
                found = _measures_with(suite, WithOptions(engine, {"seed": seed}), geometry=seed == default)
            except InputError as error:
                if seed == default:
                    raise
                refused.append(f"seed {seed}: {error}")
                bars.finish(f"refused: {error}")
                continue
            for case, measures in found.items():
                by_case[case].append(measures)
            bars.finish("measured")
    measured = [_measured(asked, engine, by_case[asked.name]) for asked in asked_cases(suite)]
    return bless(path, name, measured, reason, _engine_words(suite, engine), refused=refused)


def _measures_with(suite: Suite, engine: Renderer, *, geometry: bool) -> dict[str, list[Measure]]:
    """By case, what is measured with one engine, without the stores."""
    found = {}
    for asked in asked_cases(suite):
        result, facts = _render_now(asked, engine)
        found[asked.name] = list(measures_of(asked, result, facts, geometry=geometry))
    return found


def asked_cases(suite: Suite) -> list[Asked]:
    """The cases of a suite by which its baseline knows it."""
    found = []
    for entry in suite.cases:
        if entry.sensors and entry.scene.sensors:
            found.append(Asked(entry, None, LIGHT_METHOD))
        found.append(Asked(entry, None, LIGHT_METHOD, faces=True))
        found += [Asked(entry, view, method) for view in entry.views for method in VISIBILITIES]
    return found


def measures_of(
    asked: Asked, result: ImageResult | SensorTable, facts: Mapping[str, Any], *, geometry: bool = True
) -> Iterator[Measure]:
    """The measures of one answer. Solve and geometry are told once a scene, with its faces."""
    scene = asked.entry.scene
    if isinstance(result, SensorTable):
        yield from triangle_measures(result) if asked.faces else sensor_measures(result)
    elif asked.view is not None:
        seen = first_surfaces(scene, asked.view)
        if asked.method == LIGHT_METHOD:
            yield from image_measures(scene, asked.view, result, seen)
        else:
            yield from sun_measures(scene, asked.view, luminance(result.components["sun"]).astype(np.float64), seen)
    if asked.faces:
        yield from fact_measures(facts)
        if geometry:
            yield from geometry_measures(scene)


def _against_baseline(
    suite: Suite, engine: Renderer, baseline: Baseline | None, crashes: Sequence[Crash], *, fresh_seed: bool
) -> tuple[list[Drift], list[Missing]]:
    failed = {crash.question.case.key: crash.message for crash in crashes}
    rows: list[Drift] = []
    missing: list[Missing] = []
    for asked in asked_cases(suite):
        place = (asked.entry.scene.name, asked.place, asked.entry.condition.name)
        blessed = baseline.find(asked.name) if baseline is not None else None
        if blessed is None:
            message = f"no baseline: transom bless {suite.name} --reason ..."
            missing.append(Missing(Outcome.NO_REFERENCE, *place, asked.method, message))
            continue
        case = _case(asked, engine)
        bundle = None if case.key in failed else find_bundle(case)
        if bundle is None:
            message = failed.get(case.key, "not rendered")
            missing.append(Missing(Outcome.CRASHED, *place, asked.method, message))
            continue
        result = bundle.image() if asked.view is not None else bundle.sensors()
        found = list(measures_of(asked, result, bundle.record.facts))
        rows += drifts(blessed, _measured(asked, engine, [found]), fresh_seed=fresh_seed)
    for name in sorted(_forgotten(suite, baseline)):
        scene, view, condition, method = name.split("/")
        message = f"blessed, but no longer in the suite: transom bless {suite.name} --reason ..."
        missing.append(Missing(Outcome.NO_REFERENCE, scene, view, condition, method, message))
    return rows, missing


def _forgotten(suite: Suite, baseline: Baseline | None) -> set[str]:
    blessed = {entry.case for entry in baseline.cases} if baseline is not None else set()
    return blessed - {asked.name for asked in asked_cases(suite)}


def _judge_drifts(
    rows: Sequence[Drift], missing: Sequence[Missing], tolerances: ToleranceFile, baseline: Baseline | None
) -> list[Verdict]:
    reference = f"baseline of {baseline.history[-1].date[:10]}" if baseline is not None else ""
    return judge([row.subject(reference) for row in rows], missing, tolerances)


def _case(asked: Asked, engine: Renderer) -> Any:
    scene, condition = asked.entry.scene, asked.entry.condition
    if asked.view is None:
        return make_case(scene, condition, engine, _sensor_options(asked), sensors=_sensors(asked))
    return make_case(scene, condition, engine, {"visibility": asked.method}, view=asked.view)


def _sensors(asked: Asked) -> SensorTable:
    scene = asked.entry.scene
    table = triangle_points(scene) if asked.faces else scene_sensors(scene)
    if table is None:
        raise InputError("has no sensors", file=scene.file)
    return table


def _sensor_options(asked: Asked) -> dict[str, Any]:
    return {"sensor_rays": UP_CLOSE_RAYS, "sensor_opening_rays": UP_CLOSE_RAYS} if asked.faces else {}


def _render_now(asked: Asked, engine: Renderer) -> tuple[ImageResult | SensorTable, Mapping[str, Any]]:
    scene, condition = asked.entry.scene, asked.entry.condition
    if asked.view is not None:
        image = engine.render(scene, condition, asked.view, {"visibility": asked.method})
        return image, image.facts
    table = _sensors(asked)
    result = engine.illuminance(scene, condition, table.points, table.normals, _sensor_options(asked))
    return table.measured(np.asarray(luminance(result.illuminance), np.float64), result.standard_error), result.facts


def _measured(asked: Asked, engine: Renderer, by_seed: Sequence[Sequence[Measure]]) -> Measured:
    """With what the answer depends on, but for the engine's build and the seed."""
    inputs = _case(asked, engine).inputs()
    inputs["options"] = {name: value for name, value in inputs["options"].items() if name != "seed"}
    words = {
        name: hashlib.sha256(json.dumps(inputs[name], sort_keys=True).encode()).hexdigest()[:12]
        for name in ("scene", "condition", "options", "view", "sensors")
        if name in inputs
    }
    entry = asked.entry
    return Measured(asked.name, entry.scene.name, asked.place, entry.condition.name, asked.method, words, by_seed)


def _engine_words(suite: Suite, engine: Renderer) -> str:
    """The engine's version and build."""
    return str(_case(asked_cases(suite)[0], engine).renderer_version)


def outcome_counts(verdicts: Sequence[Verdict]) -> Counter[Outcome]:
    """How many verdicts there are of each kind."""
    return Counter(verdict.outcome for verdict in verdicts)

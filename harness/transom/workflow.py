"""The steps of a suite with files in between: render -> run bundles -> compare -> judge. Each can run again alone."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import TypeAdapter
from rich.console import Console
from rich.table import Table

from transom.bundle import Bundle, find_bundle, make_case
from transom.claims import CaseBusyError
from transom.compare import CaseNames, ImageComparison, SensorComparison, compare_images, compare_sensors
from transom.comparison import (
    COMPARISON_FORMAT,
    Comparison,
    MethodAgreement,
    compare_methods,
    read_comparison,
    write_comparison,
)
from transom.crosscheck import compare_references, render_references
from transom.errors import InputError, StorageError
from transom.failures import error_words, read_failure
from transom.files import write_atomic
from transom.hard_cases import compare_hard_cases
from transom.judge import Missing, Outcome, Verdict, exit_code, judge, read_tolerances
from transom.known.suite import compare_known, program_table
from transom.progress import CaseProgress
from transom.renderer import ImageResult, Renderer, load_renderer
from transom.run import (
    COARSE_VISIBILITY,
    DEFAULT_METHOD,
    Question,
    chosen_visibilities,
    coarse_options,
    engine_questions,
    free_first,
    method_options,
    render_case,
)
from transom.scene import scene_root
from transom.scene.model import View
from transom.sensor_file import SensorTable, scene_sensors
from transom.suite import Suite, SuiteCase, is_of_scenes, load_suite
from transom.visible import region_masks

VISIBILITIES = ("volumes", "rays")
DRAWN_IN_CODE = ("closed_form", "hard")
"""Suites whose cases are rendered while they are compared."""
ENGINE = "engine"

LOG_WIDTH = 160
"""Columns of tables that go to a file."""


@dataclass(frozen=True)
class Crash:
    """A case whose renderer failed, and its error."""

    question: Question
    message: str


def comparison_file(suite: str, build: Path) -> Path:
    return build / "runs" / suite / "comparison.json"


def verdicts_file(suite: str, build: Path) -> Path:
    return build / "runs" / suite / "verdicts.json"


def run_suite(name: str, scenes: Collection[str], build: Path = Path("build"), *, fresh: bool = False) -> int:
    """Renders, compares, judges and prints; the exit code of the verdicts."""
    suite = chosen(load_suite(name), scenes)
    compare_suite(suite, build, render_suite(suite, fresh=fresh))
    verdicts = judge_compared(name, build)
    print_verdicts(verdicts)
    if suite.reference == "closed_form":
        _console().print(program_table(verdicts))
    return exit_code(verdicts)


def chosen(suite: Suite, scenes: Collection[str]) -> Suite:
    """The suite's cases of some scenes (none given: all). Raises InputError when none is left."""
    cases = tuple(case for case in suite.cases if is_of_scenes(case.scene, scenes))
    known = tuple(name for name in suite.known if not scenes or name in scenes)
    if not cases and not known:
        raise InputError(f"is no scene of suite {suite.name}", field="--scene", value=", ".join(sorted(scenes)))
    return replace(suite, cases=cases, known=known)


def render_suite(suite: Suite, *, fresh: bool = False) -> list[Crash]:
    """Renders with the engine what is not there yet. A case that fails does not stop the others; a disk that takes no
    more files does (StorageError)."""
    if suite.reference in DRAWN_IN_CODE:
        return []
    if suite.reference == "crosscheck":
        return [Crash(question, message) for question, message in render_references(suite, fresh=fresh)]
    renderer = load_renderer(ENGINE)
    return render_questions(renderer, list(engine_questions(suite, renderer, VISIBILITIES)), suite.name, fresh=fresh)


def render_questions(
    renderer: Renderer, questions: Sequence[Question], suite: str, *, fresh: bool = False
) -> list[Crash]:
    """Answers questions of a suite, those that another process is at last; gives the ones that failed."""
    crashes: list[Crash] = []
    with CaseProgress(len(questions), Console(stderr=True)) as bars:

        def work(question: Question, wait: bool) -> None:
            bars.begin(question_words(question))
            asked = replace(question, command=f"transom run {suite} --scene {question.case.scene.name}")
            try:
                bundle = render_case(renderer, asked, progress=bars.update, fresh=fresh, wait=wait)
            except (CaseBusyError, StorageError):
                raise
            except Exception as error:
                crashes.append(Crash(question, error_words(error)))
                bars.finish(f"crashed: {crashes[-1].message}")
            else:
                bars.finish(f"{bundle.record.wall_seconds:.1f} s")

        free_first(questions, work)
    return crashes


def question_words(question: Question) -> str:
    """A case for people: its label, and what tells it from others of that label."""
    options = question.case.options
    patches = options.get("target_patch_count", "")
    return " ".join(str(part) for part in (question.case.label, options.get("visibility", ""), patches) if part)


def compare_finished(name: str, build: Path) -> Comparison:
    """Compares what has been rendered of a suite. What failed when it was last rendered has no answer."""
    suite = load_suite(name)
    return compare_suite(suite, build, stored_failures(suite))


def stored_failures(suite: Suite) -> list[Crash]:
    """The cases of a suite that failed when they were last rendered, as their failure bundles say."""
    if suite.reference != "mitsuba":
        return []
    questions = engine_questions(suite, load_renderer(ENGINE), VISIBILITIES)
    found = ((question, read_failure(question.case)) for question in questions)
    return [Crash(question, failure.error) for question, failure in found if failure is not None]


def compare_suite(suite: Suite, build: Path, crashes: Collection[Crash], engine: Renderer | None = None) -> Comparison:
    """Compares every case with its reference and writes comparison.json. engine: another than the engine itself."""
    if suite.reference == "closed_form":
        comparison = compare_known(suite)
    elif suite.reference == "crosscheck":
        comparison = compare_references(suite, {crash.question.case.key: crash.message for crash in crashes})
    elif suite.reference == "hard":
        comparison = compare_hard_cases(suite)
    else:
        failed = {crash.question.case.key: crash.message for crash in crashes}
        comparison = _compare_with_mitsuba(suite, failed, engine or load_renderer(ENGINE))
    write_comparison(comparison_file(suite.name, build), comparison)
    return comparison


def judge_compared(name: str, build: Path) -> list[Verdict]:
    """Judges comparison.json by the tolerances and writes verdicts.json."""
    comparison = read_comparison(comparison_file(name, build))
    verdicts = judge(comparison.subjects(), comparison.missing, read_tolerances(scene_root() / "tolerances.toml"))
    path = verdicts_file(name, build)
    write_atomic(path, TypeAdapter(list[Verdict]).dump_json(verdicts, indent=1) + b"\n")
    return verdicts


def print_verdicts(verdicts: Collection[Verdict]) -> None:
    """A table on standard output: what did not pass first. Sensors that passed are only counted."""
    order = list(reversed(Outcome))
    table = Table("verdict", "quantity", "case", "difference %", "b %", "k u %", "tolerance %", box=None)
    for verdict in sorted(verdicts, key=lambda entry: order.index(entry.outcome)):
        if verdict.outcome is Outcome.PASS and verdict.quantity == "sensor_percent":
            continue
        case = " ".join(part for part in _place(verdict) if part)
        numbers = (verdict.difference, verdict.numerical_bias, verdict.expanded_uncertainty, verdict.tolerance)
        cells = ["" if number is None else f"{number:.3g}" for number in numbers]
        table.add_row(verdict.outcome, verdict.quantity or verdict.reason, case, *cells)
    console = _console()
    console.print(table)
    counts = {outcome: sum(verdict.outcome is outcome for verdict in verdicts) for outcome in Outcome}
    console.print(", ".join(f"{count} {outcome}" for outcome, count in counts.items() if count) or "nothing judged")


def _console() -> Console:
    """Standard output; tables that go to a file have room."""
    console = Console()
    return console if console.is_terminal else Console(width=LOG_WIDTH)


@dataclass
class _Found:
    """Comparisons of a suite as they are made."""

    images: list[ImageComparison]
    sensors: list[SensorComparison]
    agreements: list[MethodAgreement]
    missing: list[Missing]


def _compare_with_mitsuba(suite: Suite, crashed: Mapping[str, str], engine: Renderer) -> Comparison:
    mitsuba = load_renderer("mitsuba")
    found = _Found([], [], [], [])
    for entry in suite.cases:
        if entry.sensors:
            _compare_sensors(entry, engine, mitsuba, crashed, found)
        for view in entry.views:
            _compare_view(entry, view, engine, mitsuba, crashed, found)
    return Comparison(
        COMPARISON_FORMAT,
        suite.name,
        suite.title,
        images=tuple(found.images),
        sensors=tuple(found.sensors),
        agreements=tuple(found.agreements),
        missing=tuple(found.missing),
    )


def _compare_view(
    entry: SuiteCase, view: View, engine: Renderer, mitsuba: Renderer, crashed: Mapping[str, str], found: _Found
) -> None:
    scene, condition = entry.scene, entry.condition
    truth = find_bundle(make_case(scene, condition, mitsuba, {}, view=view))
    if truth is None:
        found.missing.append(_no_reference(entry, view.name))
    rendered: dict[str, Bundle] = {}
    for visibility in chosen_visibilities(entry, VISIBILITIES):
        case = make_case(scene, condition, engine, method_options(entry, visibility), view=view)
        ours = find_bundle(case)
        if ours is None or case.key in crashed:
            message = crashed.get(case.key, "not rendered: transom run")
            method = method_words(entry, visibility)
            found.missing.append(Missing(Outcome.CRASHED, scene.name, view.name, condition.name, method, message))
            continue
        rendered[visibility] = ours
    pictures = {visibility: bundle.image() for visibility, bundle in rendered.items()}
    if truth is not None and rendered:
        masks = region_masks(scene, view)
        reference = truth.image()
        coarse = _coarse(entry, engine, view=view)
        for visibility, bundle in rendered.items():
            names = _names(entry, view.name, method_words(entry, visibility), bundle, truth)
            rough = None
            if coarse is not None and COARSE_VISIBILITY in pictures:
                rough = change_of_method(coarse.image(), pictures[COARSE_VISIBILITY], pictures[visibility])
            found.images += compare_images(pictures[visibility], reference, masks, names, rough)
    if len(pictures) == len(VISIBILITIES):
        pair = [pictures[visibility] for visibility in VISIBILITIES]
        found.agreements.append(compare_methods(scene.name, view.name, condition.name, pair[0], pair[1]))


def _compare_sensors(
    entry: SuiteCase, engine: Renderer, mitsuba: Renderer, crashed: Mapping[str, str], found: _Found
) -> None:
    scene, condition = entry.scene, entry.condition
    table = scene_sensors(scene)
    case = make_case(scene, condition, engine, method_options(entry), sensors=table)
    ours, truth = find_bundle(case), find_bundle(make_case(scene, condition, mitsuba, {}, sensors=table))
    if truth is None:
        found.missing.append(_no_reference(entry, "sensors"))
    if ours is None or case.key in crashed:
        message = crashed.get(case.key, "not measured: transom run")
        found.missing.append(Missing(Outcome.CRASHED, scene.name, "sensors", condition.name, ENGINE, message))
    elif truth is not None:
        names = _names(entry, "", method_words(entry, "rays"), ours, truth)
        coarse = _coarse(entry, engine, sensors=table)
        rough = None if coarse is None else coarse.sensors()
        found.sensors += compare_sensors(ours.sensors(), truth.sensors(), names, rough)


def method_words(entry: SuiteCase, visibility: str) -> str:
    """How rows name what made a picture: the visibility method, or the engine's method where it is not the default."""
    return visibility if entry.method == DEFAULT_METHOD else entry.method


def change_of_method(coarse: ImageResult, usual: ImageResult, ours: ImageResult) -> ImageResult:
    """What the coarse solve would show by our visibility method: fewer patches change the picture as they change the
    usual one by the coarse one's method."""
    return ImageResult(coarse.mean - usual.mean + ours.mean)


def _coarse(
    entry: SuiteCase, engine: Renderer, view: View | None = None, sensors: SensorTable | None = None
) -> Bundle | None:
    """The engine's answer from half as many patches, where it was rendered."""
    options = coarse_options(engine)
    if options is None or entry.method != DEFAULT_METHOD:
        return None
    return find_bundle(make_case(entry.scene, entry.condition, engine, options, view=view, sensors=sensors))


def _names(entry: SuiteCase, view: str, method: str, ours: Bundle, truth: Bundle) -> CaseNames:
    return CaseNames(
        scene=entry.scene.name,
        condition=entry.condition.name,
        method=method,
        reference=str(truth.record.inputs["renderer"]),
        view=view,
        engine_key=ours.record.key,
        reference_key=truth.record.key,
        reference_batch_count=int(truth.record.facts.get("batches", 0)),
        reference_means=truth.record.facts.get("group_means_cd_m2", {}),
        reference_file=str(truth.folder),
        physics=str(truth.record.inputs["options"].get("physics", "matched")),
    )


def _no_reference(entry: SuiteCase, view: str) -> Missing:
    message = "no reference: transom run references"
    return Missing(Outcome.NO_REFERENCE, entry.scene.name, view, entry.condition.name, "", message)


def _place(verdict: Verdict) -> tuple[str, ...]:
    return (verdict.scene, verdict.view, verdict.region, verdict.condition, verdict.method)

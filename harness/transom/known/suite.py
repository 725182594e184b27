"""The open analytic suite: every known case by every program. The engine runs; references come from their bundles."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cache

from rich.console import Console
from rich.table import Table

from transom.bundle import Bundle, find_bundle, repository_store
from transom.comparison import COMPARISON_FORMAT, AnalyticComparison, Comparison
from transom.errors import InputError, StorageError
from transom.failures import error_words, read_failure
from transom.judge import Missing, Outcome, Verdict
from transom.known import boxes, lights, openings
from transom.known.case import KnownCase, compare_answers
from transom.progress import CaseProgress
from transom.renderer import Renderer, load_renderer
from transom.run import Question, Target, render_case
from transom.suite import Suite, SuiteCase

ENGINE = "engine"

FAMILIES: dict[str, Callable[[], list[KnownCase]]] = {
    "point_source": lights.point_source,
    "area_source": lights.area_source,
    "flux_through_opening": lights.flux_through_opening,
    "glass_angles": lights.glass_angles,
    "diffuse_reflection": lights.diffuse_reflection,
    "diffuse_obstruction": lights.diffuse_obstruction,
    "internal_reflection": boxes.internal_reflection,
    "two_plates": boxes.two_plates,
    "sphere": boxes.sphere,
    "reflecting_wall": openings.reflecting_wall,
    "roof": openings.roof,
    "facade": openings.facade,
    "overhang": openings.overhang,
    "opposite_wall": openings.opposite_wall,
}
"""Cases that are drawn in code, by the name that suites.toml, tolerances and tables use."""

REFERENCE_TARGET = Target(percent=0.1, max_batches=96)
"""Noise at which a reference is quiet enough to be judged by a known answer (median over the sensors), and the most
batches: answers that are sums over many sensors are quieter than any one of them."""

QUIET_TARGET = Target(percent=0.015, max_batches=512)
NEED_QUIET = frozenset({"area_source", "furnace", "opposite_wall", "reflecting_wall", "sphere", "three_tone"})
"""Cases whose single sensors are judged and where paths find the light by chance: more batches."""


@dataclass(frozen=True)
class ProgramCount:
    """One cell of the table case x program: the greatest error and its bound [%], and verdicts by outcome."""

    worst_percent: float
    bound_percent: float | None
    counts: dict[Outcome, int]


def families(suite: Suite) -> Iterator[tuple[str, list[KnownCase]]]:
    """The suite's cases by family. Raises InputError for a scene or a name without a known answer."""
    for entry in suite.cases:
        yield entry.scene.name, cases_of_scene(entry)
    for name in suite.known:
        if name not in FAMILIES:
            raise InputError("is not a known case", field="known", value=name, remedy=f"Known: {', '.join(FAMILIES)}")
        yield name, FAMILIES[name]()


def cases_of_scene(entry: SuiteCase) -> list[KnownCase]:
    """The known cases of a scene in a file. Raises InputError for a scene without a known answer."""
    if entry.scene.name not in boxes.OF_SCENES:
        remedy = f"Known answers: {', '.join(boxes.OF_SCENES)}"
        raise InputError("has no known answer", file=entry.scene.file, remedy=remedy)
    return boxes.OF_SCENES[entry.scene.name](entry)


def compare_known(suite: Suite, *, fresh: bool = False) -> Comparison:
    """Every answer by every program. What fails or is missing is listed, and stops nothing else."""
    rows: list[AnalyticComparison] = []
    missing: list[Missing] = []
    every = [(name, cases) for name, cases in families(suite)]
    count = sum(len(cases) for _, cases in every) * len(suite.programs)
    with CaseProgress(count, Console(stderr=True)) as bars:
        for program in suite.programs:
            for _, cases in every:
                for case in cases:
                    bars.begin(f"{case.scene.name} {case.label} {program}")
                    found = answer(case, program, fresh=fresh)
                    if isinstance(found, Missing):
                        missing.append(found)
                        bars.finish(found.message)
                    else:
                        rows += compare_bundle(case, program, found)
                        bars.finish(f"{found.record.wall_seconds:.1f} s")
    return Comparison(COMPARISON_FORMAT, suite.name, suite.title, analytic=tuple(rows), missing=tuple(missing))


def answer(case: KnownCase, program: str, *, fresh: bool = False) -> Bundle | Missing:
    """A program's illuminances: the engine's are measured if need be, a reference's must be there."""
    place = (case.scene.name, "sensors", case.condition.name, program)
    try:
        renderer = _loaded(program)
        question = case.question(renderer)
        if program == ENGINE:
            return render_case(
                renderer, Question(question, command=f"transom run analytic --scene {place[0]}"), fresh=fresh
            )
        bundle = find_bundle(question)
        if bundle is not None:
            return bundle
        failure = read_failure(question)
        if failure is not None:
            return Missing(Outcome.CRASHED, *place, failure.error)
    except StorageError:
        raise
    except Exception as error:
        return Missing(Outcome.CRASHED, *place, error_words(error))
    return Missing(Outcome.NO_REFERENCE, *place, "no reference: transom run references")


def compare_bundle(case: KnownCase, program: str, bundle: Bundle) -> list[AnalyticComparison]:
    """The answers of a case beside the illuminances of a program's bundle."""
    facts = bundle.record.facts
    batches = int(facts.get("batches", facts.get("passes", 0)))
    return compare_answers(case, bundle.sensors(), program, batches)


def run_known_references(
    suite: Suite, names: Collection[str] = (), programs: Collection[str] = (), *, fresh: bool = False
) -> None:
    """Renders what is missing of the suite's references into the repository's store; a failure is kept and shown.

    names, programs: only these cases and renderers; none given: all.
    """
    store = repository_store()
    chosen = [program for program in suite.programs if program != ENGINE and (not programs or program in programs)]
    every = [case for name, cases in families(suite) if not names or name in names for case in cases]
    with CaseProgress(len(every) * len(chosen), Console(stderr=True)) as bars:
        for program in chosen:
            renderer = _loaded(program)
            has_batches = "batches" in renderer.default_options()
            for case in every:
                bars.begin(f"{case.scene.name} {case.label} {program}")
                command = f"transom run references --scene {case.scene.name}"
                target = QUIET_TARGET if case.scene.name in NEED_QUIET else REFERENCE_TARGET
                question = Question(case.question(renderer), target if has_batches else None, command)
                try:
                    bundle = render_case(renderer, question, store, bars.update, fresh=fresh)
                except StorageError:
                    raise
                except Exception as error:
                    bars.finish(f"crashed: {error_words(error)}")
                else:
                    bars.finish(f"{bundle.record.wall_seconds:.1f} s")


def program_table(verdicts: Sequence[Verdict]) -> Table:
    """The table case x program for the terminal: greatest error, bound, and how many of each verdict."""
    cells = program_counts(verdicts)
    programs = list(dict.fromkeys(program for _, program in cells))
    table = Table("case", *(f"{program}: greatest error %, bound %, verdicts" for program in programs), box=None)
    for name in dict.fromkeys(scene for scene, _ in cells):
        table.add_row(name, *(_cell_words(cells.get((name, program))) for program in programs))
    return table


def program_counts(verdicts: Sequence[Verdict]) -> dict[tuple[str, str], ProgramCount]:
    """By case and program, in the order of the verdicts."""
    groups: dict[tuple[str, str], list[Verdict]] = {}
    for verdict in verdicts:
        groups.setdefault((verdict.scene, verdict.method), []).append(verdict)
    found = {}
    for place, group in groups.items():
        errors = [abs(verdict.difference) for verdict in group if verdict.difference is not None]
        bounds = [verdict.tolerance for verdict in group if verdict.tolerance is not None]
        counts = {outcome: sum(verdict.outcome is outcome for verdict in group) for outcome in Outcome}
        found[place] = ProgramCount(
            max(errors, default=float("nan")),
            max(bounds, default=None),
            {outcome: count for outcome, count in counts.items() if count},
        )
    return found


def _cell_words(cell: ProgramCount | None) -> str:
    if cell is None:
        return "not run"
    bound = "" if cell.bound_percent is None else f"{cell.bound_percent:g}"
    counts = ", ".join(f"{count} {outcome}" for outcome, count in cell.counts.items())
    return f"{cell.worst_percent:.3f}  {bound}  {counts}"


@cache
def _loaded(program: str) -> Renderer:
    """One renderer for all cases: the engine keeps the scene that it solved last."""
    return load_renderer(program)

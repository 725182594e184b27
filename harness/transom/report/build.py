"""Writing the report: runs the suites, times the engine, judges, and writes every format from one content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from transom.comparison import COMPARISON_FORMAT, Comparison, read_comparison
from transom.files import write_atomic
from transom.judge import Missing, Outcome, ToleranceFile, Verdict, exit_code, judge, read_tolerances
from transom.report.checks import read_check
from transom.report.content import Content, Pictures, make_content
from transom.report.day import day_cases, find_day, render_missing
from transom.report.fenestration import chapter_tables, make_chapter
from transom.report.figure_13 import corner_errors, figure_13_cases, figure_13_strips
from transom.report.junit import junit_xml
from transom.report.notes import read_notes
from transom.report.page import write_page
from transom.report.pdf import write_pdf
from transom.report.plots import make_plots
from transom.report.results import collect_results, write_results
from transom.report.sections import hour_grids, rooms, shows_views, strips, view_images
from transom.report.speed import read_speed
from transom.report.table import plain_tables, write_csv_files
from transom.scene import scene_root
from transom.suite import Suite, load_suite, read_suites
from transom.timing import Timing, read_timings, time_scenes, write_timings
from transom.workflow import compare_suite, comparison_file, judge_compared, render_suite

Judged = list[tuple[Comparison, Sequence[Verdict]]]


def write_report(output: Path, build: Path, *, render: bool = True) -> int:
    """Writes OUTPUT/index.html, report.pdf, junit.xml, results.json, tables.json and tables/*.csv; gives the exit code
    of all verdicts together.

    render: run and time what the suites need; otherwise use the runs and timings that are there.
    """
    console = Console(stderr=True)

    def note(text: str) -> None:
        console.print(text, highlight=False, markup=False)

    notes = read_notes()
    suites = [load_suite(name) for name, entry in read_suites().items() if entry.report]
    judged: Judged = []
    for suite in suites:
        note(f"Suite {suite.name}: {suite.title}")
        judged.append(_judged(suite, build, render=render))
    timings = _timings(suites, build, note) if render else read_timings(_timings_file(build))
    results = collect_results(judged, timings)
    cases = day_cases([suite for suite in suites if shows_views(suite)])
    if render:
        render_missing([*figure_13_cases(suites), *cases], note)
        make_plots(build, note)
    pictures = Pictures(
        rooms=[room for suite in suites if shows_views(suite) for room in rooms(suite)],
        hours=[grid for suite in suites if suite.layout == "hours" for grid in hour_grids(suite, results)],
        factoring=[strip for suite in suites if shows_views(suite) for strip in strips(suite)],
        day=find_day(cases),
        figure_13=figure_13_strips(suites),
        corners=list(corner_errors(suites)),
        fenestration=make_chapter(suites, results, build),
    )
    speed = read_speed(build, _judged_scenes(suites))
    images, checked = view_images(suites, results), read_check(build / "check" / "check.json")
    content = make_content(
        results, images, pictures, speed, _tolerances(), notes, checked, chapter_tables(suites, results, speed, build)
    )
    write_files(output, content, judged)
    return exit_code(verdict for _, verdicts in judged for verdict in verdicts)


def write_files(output: Path, content: Content, judged: Judged) -> None:
    """Every format of the report."""
    tables = list(content.tables.values())
    write_results(output / "results.json", content.results)
    plain = plain_tables(tables, content.results.created)
    write_atomic(output / "tables.json", plain.model_dump_json(indent=1) + "\n")
    write_csv_files(output / "tables", tables)
    write_atomic(output / "junit.xml", junit_xml(judged))
    write_pdf(output / "report.pdf", content)
    write_page(output / "index.html", content)


def _judged(suite: Suite, build: Path, *, render: bool) -> tuple[Comparison, Sequence[Verdict]]:
    """The suite's comparison, made anew from its runs, and its verdicts. Where comparing would itself run programs and
    nothing may be rendered, the comparison that is there; none is a crash, so that it cannot pass unseen."""
    if render or suite.reference == "mitsuba":
        comparison = compare_suite(suite, build, render_suite(suite) if render else [])
    elif comparison_file(suite.name, build).is_file():
        comparison = read_comparison(comparison_file(suite.name, build))
    else:
        missing = Missing(Outcome.CRASHED, "", "", "", "", f"not run: transom run {suite.name}")
        comparison = Comparison(COMPARISON_FORMAT, suite.name, suite.title, missing=(missing,))
        return comparison, judge([], comparison.missing, _tolerances())
    return comparison, judge_compared(suite.name, build)


def _tolerances() -> ToleranceFile:
    return read_tolerances(scene_root() / "tolerances.toml")


def _timings(suites: Sequence[Suite], build: Path, note: Callable[[str], None]) -> list[Timing]:
    """Times every scene that is judged against Mitsuba."""
    timings = time_scenes(_judged_scenes(suites), lambda name: note(f"Timing {name}"))
    write_timings(_timings_file(build), timings)
    return timings


def _judged_scenes(suites: Sequence[Suite]) -> list[str]:
    """Scenes that are judged against Mitsuba, by name; variants are timed in the chapter on fenestration."""
    cases = [case for suite in suites if suite.reference == "mitsuba" for case in suite.cases]
    names = {case.scene.name: None for case in cases if not case.scene.variant_of}
    return list(names)


def _timings_file(build: Path) -> Path:
    return build / "runs" / "timings.json"

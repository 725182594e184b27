"""Writing the report: runs the suites, times the engine, judges, and hands everything to the page."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from transom.judge import exit_code
from transom.report.page import write_page
from transom.report.results import collect_results, write_results
from transom.suite import Suite, load_suite, read_suites
from transom.timing import Timing, read_timings, time_scenes, write_timings
from transom.workflow import compare_suite, judge_compared, render_suite


def write_report(output: Path, build: Path, *, render: bool = True) -> int:
    """Writes OUTPUT/results.json and OUTPUT/index.html; gives the exit code of all verdicts together.

    render: run and time what the suites need; otherwise use the runs and timings that are there.
    """
    console = Console(stderr=True)
    suites = [load_suite(name) for name, entry in read_suites().items() if entry.report]
    judged = []
    for suite in suites:
        console.print(f"Suite {suite.name}: {suite.title}", highlight=False, markup=False)
        comparison = compare_suite(suite, build, render_suite(suite) if render else [])
        judged.append((comparison, judge_compared(suite.name, build)))
    timings = _timings(suites, build, console) if render else read_timings(_timings_file(build))
    results = collect_results(judged, timings)
    write_results(output / "results.json", results)
    write_page(output / "index.html", suites, results)
    return exit_code(results.verdicts)


def _timings(suites: list[Suite], build: Path, console: Console) -> list[Timing]:
    """Times every scene that is judged against Mitsuba."""
    names = {case.scene.name: None for suite in suites if suite.reference == "mitsuba" for case in suite.cases}
    timings = time_scenes(list(names), lambda name: console.print(f"Timing {name}", highlight=False, markup=False))
    write_timings(_timings_file(build), timings)
    return timings


def _timings_file(build: Path) -> Path:
    return build / "runs" / "timings.json"

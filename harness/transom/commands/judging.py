"""`transom compare`, `judge` and `report`: the later steps, each from the files of the one before."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SuiteArgument = Annotated[str, typer.Argument(metavar="SUITE", help="Name of a suite: transom list suites.")]
BuildOption = Annotated[Path, typer.Option("--build", help="Folder of results.")]
DEFAULT_BUILD = Path("build")


def compare(suite: SuiteArgument, build: BuildOption = DEFAULT_BUILD) -> None:
    """Compare the finished runs of a suite with their references; renders nothing.

    Writes BUILD/runs/SUITE/comparison.json: numbers with uncertainties, no opinion.

    \b
    Example:  transom compare rooms
    """
    from transom.workflow import compare_finished, comparison_file

    comparison = compare_finished(suite, build)
    counts = f"{len(comparison.images)} image regions, {len(comparison.sensors)} sensors"
    typer.echo(f"{comparison_file(suite, build)}: {counts}, {len(comparison.missing)} missing")


def judge(suite: SuiteArgument, build: BuildOption = DEFAULT_BUILD) -> None:
    """Judge a compared suite by scenes/tolerances.toml; takes seconds.

    Exit code: 4 crash or missing reference, 1 fail, 3 inconclusive, 0 pass.

    \b
    Example:  transom judge rooms
    """
    from transom.judge import exit_code
    from transom.workflow import judge_compared, print_verdicts

    verdicts = judge_compared(suite, build)
    print_verdicts(verdicts)
    for rule in _unused_rules(build):
        typer.echo(f"tolerances.toml: {rule} judges nothing in any suite. Correct or delete it", err=True)
    code = exit_code(verdicts)
    if code:
        raise typer.Exit(code)


def _unused_rules(build: Path) -> list[str]:
    """Rules of tolerances.toml by which nothing is judged, once every suite has been compared; none before."""
    from transom.comparison import read_comparison
    from transom.judge import read_tolerances, unused_rules
    from transom.scene import scene_root
    from transom.suite import read_suites
    from transom.workflow import comparison_file

    files = [comparison_file(name, build) for name in read_suites()]
    if not all(file.is_file() for file in files):
        return []
    subjects = [subject for file in files for subject in read_comparison(file).subjects()]
    unused = unused_rules(read_tolerances(scene_root() / "tolerances.toml"), subjects)
    return [f"{rule.quantity} ({rule.place() or 'everywhere'})" for rule in unused]


def report(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the report.")] = DEFAULT_BUILD / "report",
    build: BuildOption = DEFAULT_BUILD,
    rendered: Annotated[
        bool, typer.Option("--rendered", help="Use the runs that are there; render and time nothing.")
    ] = False,
    publish: Annotated[
        bool, typer.Option("--publish", help="Also copy it to reports/published, part of the repository.")
    ] = False,
) -> None:
    """Run every suite, time the engine, and write the report.

    Writes OUTPUT/index.html (one file, with its pictures in it), report.pdf, junit.xml, results.json, tables.json and
    tables/*.csv, all from the same tables. Exit code as of `transom judge`, over all suites.

    \b
    Example:  transom report
    """
    from transom.report.build import write_report
    from transom.report.publish import publish as publish_report

    code = write_report(output, build, render=not rendered)
    typer.echo(f"{output / 'index.html'}")
    if publish:
        typer.echo(f"reports/published: {len(publish_report(output))} files")
    if code:
        raise typer.Exit(code)

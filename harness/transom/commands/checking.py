"""`transom check` and `transom bless`: whether accuracy has changed, and saying that it was meant to."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.judging import DEFAULT_BUILD, BuildOption

DEFAULT_SUITE = "quick"


def check(
    suite: Annotated[
        list[str] | None, typer.Option("--suite", help="A suite with a baseline (can be repeated); quick if omitted.")
    ] = None,
    junit: Annotated[Path | None, typer.Option("--junit", help="Write the verdicts as JUnit XML here, too.")] = None,
    markdown: Annotated[
        Path | None, typer.Option("--summary", help="Write the summary, Markdown for a pull request, here, too.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=1, help="Of the engine: compares means over seeds, less sharply.")
    ] = None,
    build: BuildOption = DEFAULT_BUILD,
) -> None:
    """Has the engine's accuracy changed? Runs a suite and judges it against references and against its baseline.

    References say how wrong the engine is, as far as their noise lets them. The baseline, an earlier answer of our own
    in reports/baselines/, has no noise: with the default seed a drift of 0.2 % shows, and the summary says in which
    component of light, by how much, and what that points to. What is missing is an error, never skipped.

    Writes BUILD/check/check.json, summary.md and junit.xml. Exit code: 4 crash or missing reference or baseline,
    2 wrong use, 1 fail, 3 inconclusive, 0 pass.

    \b
    Example:  transom check
    Example:  transom check --suite rooms --junit junit.xml --summary summary.md
    Example:  transom check --seed 7
    """
    from transom.check import check_suite, write_check
    from transom.check_summary import summary
    from transom.files import write_atomic
    from transom.judge import EXIT_PRIORITY
    from transom.report.junit import junit_xml

    checked = [check_suite(name, build, seed=seed) for name in suite or [DEFAULT_SUITE]]
    codes = {entry.exit_code for entry in checked}
    code = next(value for value in EXIT_PRIORITY if value in codes)
    text = summary(checked, code)
    document = junit_xml([pair for entry in checked for pair in entry.judged()])
    folder = build / "check"
    write_check(folder / "check.json", checked)
    for path in (folder / "summary.md", markdown):
        if path is not None:
            write_atomic(path, text)
    for path in (folder / "junit.xml", junit):
        if path is not None:
            write_atomic(path, document)
    typer.echo(text)
    if code:
        raise typer.Exit(code)


def bless(
    suite: Annotated[str, typer.Argument(metavar="SUITE", help="Suite whose present answers become its baseline.")],
    reason: Annotated[str, typer.Option("--reason", help="Why the numbers may be what they are: a sentence.")],
    seeds: Annotated[int, typer.Option("--seeds", help="Seeds from which the spread is learnt.")] = 16,
) -> None:
    """Accept the engine's present answers as the baseline of a suite: reports/baselines/SUITE.json.

    Measures the suite with several seeds, and adds an entry with author, commit, reason and the largest changes to a
    history that only grows. Commit the file by itself. Some minutes for the quick suite.

    \b
    Example:  transom bless quick --reason "Nodes stand back from borders: less light in corners, as Mitsuba has it"
    """
    from transom.baseline import baseline_file
    from transom.check import bless_suite

    baseline = bless_suite(suite, reason, seeds=seeds)
    entry = baseline.history[-1]
    for change in entry.changes:
        amount = "came or went" if change.change is None else f"{change.change:+.3g} ({change.quantity})"
        typer.echo(f"{change.case}: {change.category}, {change.place}: {amount}")
    for refusal in entry.refused:
        typer.echo(f"The engine refused a scene with {refusal}")
    count = sum(len(case.measures) for case in baseline.cases)
    typer.echo(f"{baseline_file(suite)}: {count} measures of {len(baseline.cases)} cases, {entry.seeds} seeds")

"""Tables about the referees: cross-checks, model error, the ladder of parameters, known answers, and hard cases."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from transom.report.numbers import decimals_of, fixed, seconds, signed, words
from transom.report.rows_images import verdict_cell
from transom.report.table import Cell, Row, Table, known_number, number, signed_number, texts

PROGRAM_WORDS = {"engine": "Transom", "classic": "Classic method", "mitsuba": "Mitsuba 3", "radiance": "Radiance"}


def program_words(name: str) -> str:
    return PROGRAM_WORDS.get(name, words(name))


def crosschecks(entries: Iterable[Any]) -> Table:
    """References against each other, before either judges the engine."""
    rows = [
        Row(
            (
                Cell(" / ".join(part for part in (row.view, row.region, row.condition) if part)),
                Cell(row.quantity),
                Cell(row.physics),
                Cell(f"{row.first}, {row.second}"),
                known_number(row.first_value, row.first_value * row.uncertainty_percent / 100),
                known_number(row.second_value, row.second_value * row.uncertainty_percent / 100),
                Cell(row.unit),
                signed_number(row.difference_percent, 2),
                number(row.uncertainty_percent, 2),
                verdict_cell([row.verdict]),
                Cell(row.note),
            ),
            row.origin,
            words(row.scene),
        )
        for row in entries
    ]
    head = (
        "Case",
        "Quantity",
        "Physics",
        "First, second",
        "First",
        "Second",
        "Unit",
        "Difference [%]",
        "u [%]",
        "Verdict",
        "Note",
    )
    title = "The references against each other"
    return Table("crosscheck", title, head, tuple(rows), "transom run crosscheck")


def model_errors(entries: Iterable[Any]) -> Table:
    """The matched reference against the full physics: what the method costs, and not our code."""
    rows = [
        Row(
            (
                Cell(" / ".join(part for part in (row.view, row.region, row.condition) if part)),
                Cell(row.quantity),
                known_number(row.matched, row.matched * row.uncertainty_percent / 100),
                known_number(row.full, row.full * row.uncertainty_percent / 100),
                Cell(row.unit),
                signed_number(row.model_error_percent, 2),
                number(row.uncertainty_percent, 2),
            ),
            row.origin,
            words(row.scene),
        )
        for row in entries
    ]
    head = ("Case", "Quantity", "Matched physics", "Full physics", "Unit", "Model error [%]", "u [%]")
    return Table("model_error", "Model error: what the method costs", head, tuple(rows), "transom run crosscheck")


def ladder(entries: Iterable[Any]) -> Table:
    """Raising a reference's parameters until its picture stays constant."""
    rows = [
        Row(
            (
                number(row.step, 0),
                Cell(row.options),
                Cell(seconds(row.seconds), row.seconds),
                Cell("first step", kind="muted") if row.change_percent is None else number(row.change_percent, 2),
                number(row.difference_percent, 2),
                signed_number(row.bias_percent, 2),
            ),
            row.origin,
            f"{program_words(row.program)}: {words(row.scene)}, {row.view}, {row.condition}",
        )
        for row in entries
    ]
    head = (
        "Step",
        "Parameters",
        "Time",
        "Change from the step before [%]",
        "Mean difference from Mitsuba 3 [%]",
        "Bias against Mitsuba 3 [%]",
    )
    title = "The ladder: parameters raised until the picture stays constant"
    return Table("ladder", title, head, tuple(rows), "transom run crosscheck")


def analytic(entries: Iterable[Any], verdicts: Iterable[Any]) -> Table:
    """Known answers: a case a row, and each program's value, error and verdict beside the bound."""
    cases: dict[tuple[str, ...], dict[str, Any]] = {}
    for row in entries:
        cases.setdefault((row.suite, row.scene, row.quantity), {})[row.program] = row
    programs = [name for name in PROGRAM_WORDS if any(name in found for found in cases.values())]
    bounds: dict[tuple[str, ...], float | None] = {
        (v.suite, v.scene, v.region): v.tolerance for v in verdicts if v.quantity == "analytic_percent"
    }
    rows = []
    for place, found in cases.items():
        first = next(iter(found.values()))
        digits = decimals_of(first.truth_uncertainty or abs(first.truth) * 1e-5, 4)
        cells = [Cell(first.quantity, title=first.source), Cell(first.unit), number(first.truth, digits)]
        cells.append(number(bounds.get(place), 2))
        for name in programs:
            entry = found.get(name)
            if entry is None:
                cells += [Cell("", kind="muted")] * 3
                continue
            cells.append(number(entry.value, digits))
            error = signed(entry.error_percent, 3)
            noise = f" ± {fixed(entry.error_uncertainty_percent, 3)}" if entry.error_uncertainty_percent else ""
            cells += [Cell(error + noise, entry.error_percent), verdict_cell([entry.verdict])]
        rows.append(Row(tuple(cells), first.origin, words(first.scene)))
    columns = [(program_words(name), f"{program_words(name)}, error [%]", "Verdict") for name in programs]
    head = ("Quantity", "Unit", "Truth", "Bound [%]", *(name for triple in columns for name in triple))
    return Table("analytic", "Known answers", head, tuple(rows), "transom run analytic")


def hard_cases(entries: Iterable[Any]) -> Table:
    """What was expected of each hard case, and what was seen: broken claims first."""
    entries = sorted(entries, key=lambda entry: entry.holds)
    order = list(dict.fromkeys(entry.group for entry in entries))
    entries.sort(key=lambda entry: order.index(entry.group))
    rows = [
        Row(
            (
                *texts(words(row.case), row.claim, row.expectation, row.seen),
                Cell(seconds(row.seconds), row.seconds),
                verdict_cell([row.verdict]),
            ),
            row.origin,
            words(row.group),
        )
        for row in entries
    ]
    head = ("Case", "Claim", "Expected", "Seen", "Time", "Verdict")
    return Table("hard_cases", "Hard cases", head, tuple(rows), "transom run hard")

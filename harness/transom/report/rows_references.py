"""Tables about the referees: cross-checks, model error, the ladder of parameters, known answers, and hard cases."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from transom.report.numbers import decimals_of, seconds, words
from transom.report.rows_images import verdict_cell
from transom.report.table import Cell, Row, Table, known_number, number, signed_number, texts

PROGRAM_WORDS = {"engine": "Transom", "mitsuba": "Mitsuba 3", "radiance": "Radiance"}


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
        "Why it is larger",
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
            f"{PROGRAM_WORDS.get(row.program, row.program)}: {words(row.scene)}, {row.view}, {row.condition}",
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


def analytic(entries: Iterable[Any]) -> Table:
    """Known answers: a case, and each program's error on it."""
    rows = []
    for row in entries:
        digits = decimals_of(row.truth_uncertainty or abs(row.truth) * 1e-5, 4)
        cells = (
            Cell(row.quantity, title=row.source),
            Cell(PROGRAM_WORDS.get(row.program, row.program)),
            Cell(row.unit),
            number(row.truth, digits),
            number(row.value, digits),
            signed_number(row.error_percent, 3),
            number(row.error_uncertainty_percent, 3),
            verdict_cell([row.verdict]),
        )
        rows.append(Row(cells, row.origin, words(row.scene)))
    head = ("Quantity", "Program", "Unit", "Truth", "Value", "Error [%]", "u [%]", "Verdict")
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

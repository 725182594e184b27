"""Verdicts as tables: the matrix of suites and quantities, the complete list, and what is used of each tolerance."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from transom.check import Checked
from transom.judge import Outcome, Tolerance, ToleranceFile, Verdict, tolerance_debt
from transom.report.junit import reproduce_command
from transom.report.numbers import fixed, words
from transom.report.results import Results
from transom.report.rows_images import verdict_cell
from transom.report.table import Cell, Row, Table, number, signed_number

QUANTITY_WORDS = {
    "": "No answer",
    "mean_relative_error_percent": "Mean pixel error",
    "bias_percent": "Bias",
    "block_p95_percent": "4×4 blocks, p95",
    "sensor_percent": "Sensors",
    "analytic_percent": "Known answers",
    "agreement_percent": "Volumes and rays",
    "crosscheck_image_percent": "References, images",
    "crosscheck_sensor_percent": "References, sensors",
    "baseline_percent": "Against the baseline",
    "sun_edge_mm": "Sun edge",
    "energy_percent": "Energy",
    "broken_claims": "Claims",
}

WORST_FIRST = list(reversed(Outcome))

TOLERANCES = "scenes/tolerances.toml"


def quantity_words(quantity: str) -> str:
    return QUANTITY_WORDS.get(quantity, words(quantity.removesuffix("_percent")))


def verdict_anchor(suite: str, scene: str, quantity: str) -> str:
    """The place of the first verdict of a matrix cell."""
    return "v-" + re.sub(r"[^a-z0-9]+", "-", f"{suite}-{scene}-{quantity or 'none'}".lower()).strip("-")


@dataclass(frozen=True)
class MatrixCell:
    """One suite and scene by one quantity: the worst outcome, and how many of how many passed."""

    outcome: Outcome
    passed: int
    count: int
    anchor: str
    title: str


@dataclass(frozen=True)
class MatrixRow:
    """A scene of a suite; cells by column, None where nothing of the kind is judged."""

    suite: str
    scene: str
    cells: list[MatrixCell | None]


@dataclass(frozen=True)
class Matrix:
    """The verdicts in one look: rows and columns with the worst outcome first."""

    columns: list[str]
    rows: list[MatrixRow]


def matrix(results: Results) -> Matrix:
    """Suites and scenes against quantities, failed first."""
    verdicts: list[Any] = list(results.verdicts)
    titles = {record.suite: record.title for record in results.suites}
    places = list(dict.fromkeys((verdict.suite, _subject_scene(verdict)) for verdict in verdicts))
    quantities = list(dict.fromkeys(verdict.quantity for verdict in verdicts))

    def members(place: tuple[str, str] | None, quantity: str | None) -> list[Any]:
        return [
            verdict
            for verdict in verdicts
            if place in (None, (verdict.suite, _subject_scene(verdict))) and quantity in (None, verdict.quantity)
        ]

    places.sort(key=lambda place: WORST_FIRST.index(_worst(members(place, None))))
    quantities.sort(key=lambda quantity: WORST_FIRST.index(_worst(members(None, quantity))))
    rows = []
    for place in places:
        cells: list[MatrixCell | None] = []
        for quantity in quantities:
            found = members(place, quantity)
            cells.append(_matrix_cell(found, place, quantity) if found else None)
        rows.append(MatrixRow(titles[place[0]], words(place[1]) or "suite", cells))
    return Matrix([quantity_words(quantity) for quantity in quantities], rows)


def matrix_table(found: Matrix) -> Table:
    """The matrix as a table, for paper and for other programs."""
    rows = []
    for row in found.rows:
        cells = [
            Cell("") if cell is None else Cell(f"{cell.outcome}, {cell.passed} of {cell.count}") for cell in row.cells
        ]
        sources = " · ".join(dict.fromkeys(cell.title for cell in row.cells if cell is not None))
        rows.append(Row((Cell(row.scene), *cells), sources, row.suite))
    return Table("matrix", "Verdicts by suite and quantity", ("", *found.columns), tuple(rows), "transom report")


def verdict_list(results: Results) -> Table:
    """Every verdict, failed first; each matrix cell links to the first of its rows."""
    titles = {record.suite: record.title for record in results.suites}
    rows, anchors = [], set()
    verdicts: list[Any] = sorted(results.verdicts, key=lambda row: WORST_FIRST.index(row.outcome))
    for verdict in verdicts:
        anchor = verdict_anchor(verdict.suite, _subject_scene(verdict), verdict.quantity)
        first = anchor not in anchors
        anchors.add(anchor)
        place = (verdict.view, verdict.region, verdict.condition, verdict.method)
        number_in_set = re.search(r"\[(\d+)\]$", verdict.name)
        parts = [part for part in place if part] + ([f"no. {number_in_set.group(1)}"] if number_in_set else [])
        needed = "" if verdict.batches_needed is None else f"{fixed(verdict.batches_needed, 0)} batches"
        cells = (
            Cell(verdict.outcome, kind="verdict", title="" if verdict.outcome is Outcome.PASS else verdict.reason),
            Cell(quantity_words(verdict.quantity)),
            Cell(titles[verdict.suite]),
            Cell(words(verdict.scene)),
            Cell(", ".join(parts) if verdict.quantity else f"{', '.join(parts)}: {verdict.reason}"),
            _maybe(verdict.difference, 2, sign=True),
            _maybe(verdict.expanded_uncertainty, 2),
            _maybe(verdict.numerical_bias, 2),
            _maybe(verdict.tolerance, 2),
            Cell(needed, verdict.batches_needed),
            Cell(reproduce_command(verdict.suite, verdict.scene) if verdict.outcome is not Outcome.PASS else ""),
        )
        tags = f"{verdict.outcome}|{words(verdict.scene)}"
        rows.append(Row(cells, verdict.origin, anchor=anchor if first else "", tags=tags))
    head = (
        "Verdict",
        "Quantity",
        "Suite",
        "Scene",
        "Where",
        "Difference",
        "k\N{NO-BREAK SPACE}u",
        "b",
        "Tolerance",
        "To decide",
        "Reproduce",
    )
    return Table("verdicts", "All verdicts", head, tuple(rows), "transom report")


def tolerance_use(tolerances: ToleranceFile, results: Results) -> Table:
    """Each rule with its reason, and how near the judged quantities come to it: |difference| + b + k u, the largest."""
    rows = []
    for rule in tolerances.tolerances:
        judged = _judged_by(rule, results)
        used = [
            abs(verdict.difference) + (verdict.numerical_bias or 0.0) + (verdict.expanded_uncertainty or 0.0)
            for verdict in judged
            if verdict.difference is not None
        ]
        largest = max(used, default=None)
        cells = (
            Cell(quantity_words(rule.quantity)),
            Cell(rule.place() or "everywhere"),
            number(rule.tolerance, 2),
            number(len(judged), 0),
            Cell("nothing judged", kind="muted") if largest is None else number(largest, 2),
            Cell("") if largest is None else number(100 * largest / rule.tolerance, 0),
            verdict_cell([verdict.outcome for verdict in judged]),
            Cell(", ".join(_aim_words(bound, judged) for bound in rule.aims)),
            Cell(rule.reason),
        )
        rows.append(Row(cells, TOLERANCES))
    head = (
        "Quantity",
        "Where",
        "Tolerance",
        "Judged",
        "Largest |d| + b + k u",
        "Share used [%]",
        "Worst verdict",
        "Would pass at stricter bounds",
        "Reason",
    )
    return Table("tolerances", "Tolerances and how much of them is used", head, tuple(rows), "transom report")


def debt(tolerances: ToleranceFile) -> Table:
    """Rules that are looser than the general one of their quantity."""
    rows = [
        Row(
            (
                Cell(quantity_words(entry.quantity)),
                Cell(entry.place),
                number(entry.tolerance, 2),
                number(entry.general, 2),
                number(entry.ratio, 1),
                Cell(entry.reason),
            ),
            TOLERANCES,
        )
        for entry in tolerance_debt(tolerances)
    ]
    head = ("Quantity", "Where", "Tolerance", "General tolerance", "Times looser", "Reason")
    return Table("tolerance_debt", "Tolerance debt", head, tuple(rows), "")


BASELINE_ROWS = 60
"""Measures that a report lists against the baseline when all pass."""


def baseline(checked: Sequence[Checked]) -> Table:
    """Measures against their blessed values, what did not pass first, then those that moved most. Without reference
    noise, so that drift shows. check.json holds all."""
    found = [
        (drift, verdict, suite)
        for suite in checked
        for drift, verdict in zip(suite.drifts, suite.baseline_verdicts, strict=False)
    ]
    found.sort(key=lambda entry: (WORST_FIRST.index(entry[1].outcome), -abs(entry[0].difference)))
    count = max(BASELINE_ROWS, sum(verdict.outcome != Outcome.PASS for _, verdict, _ in found))
    rows = []
    for drift, verdict, suite in found[:count]:
        cells = (
            Cell(verdict.outcome, kind="verdict"),
            Cell(drift.case),
            Cell(f"{words(drift.category)}, {drift.place}" if drift.place else words(drift.category)),
            _significant(drift.before),
            _significant(drift.now),
            signed_number(drift.difference, 3),
            number(drift.uncertainty, 3),
            _maybe(verdict.tolerance, 2),
        )
        source = f"{suite.suite}, {suite.blessed}, seed {suite.seed or 'default'}"
        rows.append(Row(cells, source))
    head = ("Verdict", "Case", "Measure", "Blessed", "Now", "Difference [%]", "u [%]", "Tolerance [%]")
    of_all = f": {count} of {len(found)} measures, worst first" if len(found) > count else ""
    return Table("baseline", f"Against the blessed baseline{of_all}", head, tuple(rows), "transom check")


def _significant(value: float | None) -> Cell:
    return Cell("absent", kind="muted") if value is None else Cell(f"{value:.5g}", value)


def _judged_by(rule: Tolerance, results: Results) -> list[Any]:
    """The verdicts that a rule decided."""
    verdicts: list[Any] = list(results.verdicts)
    wanted = (rule.quantity, rule.tolerance, rule.reason)
    return [entry for entry in verdicts if (entry.quantity, entry.tolerance, entry.reason) == wanted]


def _aim_words(bound: float, judged: Sequence[Any]) -> str:
    """At a stricter bound, which is not judged: how many of how many would pass."""
    passed = sum(aim.outcome is Outcome.PASS for entry in judged for aim in entry.aims if aim.bound == bound)
    return f"{passed} of {len(judged)} at {bound:g}"


def outcome_counts(verdicts: Sequence[Verdict] | Sequence[Any]) -> list[tuple[str, int]]:
    found = [(str(outcome), sum(entry.outcome is outcome for entry in verdicts)) for outcome in WORST_FIRST]
    return [(name, count) for name, count in found if count]


def _matrix_cell(found: Sequence[Any], place: tuple[str, str], quantity: str) -> MatrixCell:
    passed = sum(verdict.outcome is Outcome.PASS for verdict in found)
    origins = " · ".join(dict.fromkeys(part for verdict in found for part in verdict.origin.split(" · ")))
    return MatrixCell(_worst(found), passed, len(found), verdict_anchor(*place, quantity), origins)


def _subject_scene(verdict: Any) -> str:
    """Scenes are rows of the matrix; hard cases, of which there are many, share one row a group."""
    return str(verdict.condition if verdict.quantity == "broken_claims" else verdict.scene)


def _worst(verdicts: Sequence[Any]) -> Outcome:
    worst: Outcome = max((verdict.outcome for verdict in verdicts), key=list(Outcome).index)
    return worst


def _maybe(value: float | None, digits: int, *, sign: bool = False) -> Cell:
    if value is None:
        return Cell("")
    return signed_number(value, digits) if sign else number(value, digits)

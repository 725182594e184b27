"""Tables of the chapter on complex fenestration: transport by product, speed, and what other commands have written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from transom.bench import Bench
from transom.errors import InputError, invalid_field
from transom.fenestration.choice import is_file
from transom.judge import Outcome
from transom.products import load_product
from transom.report.numbers import seconds, words
from transom.report.rows_images import HEADLINE_METHOD, verdict_cell
from transom.report.rows_speed import bench_source, timing_words
from transom.report.table import Cell, Row, Table, TablesFile, number, signed_number
from transom.scene.model import Opening, Scene

RUN = "transom run fenestration"
BENCH = "transom bench test_room --glazing south_upper=lumitop_like"


@dataclass(frozen=True)
class Expected:
    """A table that another command writes to build/lobes/NAME.json in the form of tables.json."""

    name: str
    title: str
    command: str


WRITTEN = (
    Expected("cfs_references", "References of rooms with products, against each other", "transom referees"),
    Expected(
        "cfs_representation", "Representation: lobes and residual against an independent ray set", "transom lobes"
    ),
    Expected("cfs_represented", "Represented fraction over number and width of lobes", "transom lobes"),
    Expected("cfs_interpolation", "Interpolation between directions: the paper's against ours", "transom lobes"),
    Expected("cfs_energy", "Energy of tables, and of lobes with their residual", "transom lobes"),
)


def glazing_words(scene: Scene) -> str:
    """What a variant has in place of its scene's glazing: "Laser cut panel", or "Clear glass, 0.82"."""
    replaced = {text.partition("=")[0] for text in scene.glazings}
    return "; ".join(_opening_words(opening) for opening in scene.openings if opening.name in replaced)


def _opening_words(opening: Opening) -> str:
    if opening.product is None:
        return "No glass" if opening.glazing == "none" else f"Clear glass, {opening.visible_transmittance:g}"
    if is_file(opening.product.name):
        return Path(opening.product.name).name
    changes = [f"{words(name).lower()} {value:g}" for name, value in opening.product.parameters]
    return ", ".join([load_product(opening.product.name).title.partition(",")[0], *changes])


def transport(images: Iterable[Any], sensors: Sequence[Any], scenes: Mapping[str, Scene]) -> Table:
    """One row a product and view: errors of the interior, the worst sensor, and their verdicts. scenes: by name."""
    rows = []
    for row in images:
        if row.region != "interior" or row.method != HEADLINE_METHOD:
            continue
        measured = [entry for entry in sensors if (entry.scene, entry.condition) == (row.scene, row.condition)]
        worst = max(measured, key=lambda entry: abs(entry.error_percent), default=None)
        outcomes: list[Outcome | None] = [row.mean_relative_error_verdict, row.bias_verdict, row.block_verdict]
        cells = (
            Cell(glazing_words(scenes[row.scene])),
            number(row.mean_relative_error_percent, 2),
            number(row.mean_relative_error_raw_percent, 2),
            signed_number(row.bias_percent, 2),
            number(row.block_p95_percent, 1),
            signed_number(worst.error_percent, 2) if worst else Cell("–"),
            number(row.reference_standard_error_percent, 2),
            verdict_cell([*outcomes, *(entry.verdict for entry in measured)]),
        )
        rows.append(Row(cells, row.origin, f"{words(scenes[row.scene].variant_of)}, {words(row.view).lower()}"))
    head = (
        "Product",
        "Mean error [%]",
        "raw [%]",
        "Bias [%]",
        "Blocks, p95 [%]",
        "Worst sensor [%]",
        "Noise [%]",
        "Verdict, with sensors",
    )
    return Table("cfs_transport", "Transport: the same light behind every panel", head, tuple(rows), RUN)


def speed(benches: Iterable[Bench]) -> Table:
    """Every time of scenes with products at default settings, by the number of beams."""
    rows = []
    for bench in benches:
        for entry in bench.measurements:
            if entry.sweep != "default" or entry.unit != "s":
                continue
            size = f", {entry.width}×{entry.height}" if entry.width else ""
            values = [Cell(seconds(value), value) for value in (entry.first, entry.median, entry.p95)]
            cells = (Cell(timing_words(entry.quantity) + size), number(entry.beams, 0), *values)
            group = f"{words(bench.scene)}: {entry.patches} patches"
            rows.append(Row(cells, bench_source(bench), group))
    head = ("", "Beams", "First", "Median", "p95")
    return Table("cfs_speed", "Speed with products", head, tuple(rows), BENCH)


def written_table(folder: Path, expected: Expected) -> Table:
    """The table as it was written; without rows where it was not. Raises InputError for a malformed file."""
    file = folder / f"{expected.name}.json"
    if not file.is_file():
        return Table(expected.name, expected.title, ("",), (), expected.command)
    try:
        tables = TablesFile.model_validate_json(file.read_bytes()).tables
    except ValidationError as error:
        raise invalid_field(error, file) from error
    found = next((table for table in tables if table.name == expected.name), None)
    if found is None:
        names = [table.name for table in tables]
        raise InputError("has no table of that name", file=file, field="tables", value=names, remedy=expected.command)
    rows = [Row(tuple(Cell(cell.text, cell.value) for cell in row.cells), row.source, row.group) for row in found.rows]
    return Table(expected.name, found.title, tuple(found.head), tuple(rows), found.command or expected.command)

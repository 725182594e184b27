"""A table of the report: what HTML, PDF, CSV and tables.json all print. A row without a source is refused."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict

from transom.errors import InputError
from transom.files import write_atomic
from transom.report.numbers import fixed, rounded, signed

TABLES_FORMAT = 1

KEY_LENGTH = 12
"""Digits of a run key that are printed: those that end its folder's name."""

CellKind = Literal["", "verdict", "muted"]


@dataclass(frozen=True)
class Cell:
    """A cell. text: as printed. value: the number behind it, not rounded, None where the text is all there is.

    kind: "verdict" where the text is one. title: shown when pointed at. link: the anchor of what the cell is about.
    """

    text: str
    value: float | None = None
    kind: CellKind = ""
    title: str = ""
    link: str = ""


@dataclass(frozen=True)
class Row:
    """Cells under the table's head. group: what the row belongs to, printed once above the rows that share it.
    source: the runs or the publication that the numbers come from. anchor: the place that links lead to."""

    cells: tuple[Cell, ...]
    source: str
    group: str = ""
    anchor: str = ""
    tags: str = ""


@dataclass(frozen=True)
class Table:
    """name: of its CSV file and of its place on the page. command: what makes the rows, said where there are none.

    Raises InputError for a row that does not say where its numbers come from, or has not a cell for each column.
    """

    name: str
    title: str
    head: tuple[str, ...]
    rows: tuple[Row, ...]
    command: str
    note: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if not row.source:
                raise InputError("has a row without provenance", field=self.name, value=[c.text for c in row.cells])
            if len(row.cells) != len(self.head):
                raise InputError(f"has {len(row.cells)} cells in a row of {len(self.head)} columns", field=self.name)

    def part(self, group: str) -> Table:
        """The rows of one group, without its heading."""
        return replace(self, rows=tuple(replace(row, group="") for row in self.rows if row.group == group))

    def first_rows(self, count: int) -> Table:
        return replace(self, rows=self.rows[:count])


class PlainCell(BaseModel):
    """text: as printed; value: the number behind it, or null."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    text: str
    value: float | None


class PlainRow(BaseModel):
    """group: the heading above the row; source: where its numbers come from."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    group: str
    source: str
    cells: list[PlainCell]


class PlainTable(BaseModel):
    """A table of the report. command: what makes its rows."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    title: str
    head: list[str]
    command: str
    rows: list[PlainRow]


class TablesFile(BaseModel):
    """tables.json: the printed tables, cell by cell."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int
    created: datetime
    tables: list[PlainTable]


def plain_tables(tables: Sequence[Table], created: datetime) -> TablesFile:
    return TablesFile(format=TABLES_FORMAT, created=created, tables=[_plain(table) for table in tables])


def write_csv_files(folder: Path, tables: Iterable[Table]) -> None:
    """One file a table: group, the columns with unrounded numbers, and the source of each row."""
    for table in tables:
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["group", *(name or "name" for name in table.head), "source"])
        for row in table.rows:
            values = [cell.text if cell.value is None else f"{cell.value:.10g}" for cell in row.cells]
            writer.writerow([row.group, *values, row.source])
        write_atomic(folder / f"{table.name}.csv", stream.getvalue())


def runs(*keys: str) -> str:
    """The source of numbers that were measured: the run keys, shortened to what ends their folders' names."""
    return " · ".join(key[:KEY_LENGTH] for key in keys if key)


def number(value: float | None, digits: int = 1, title: str = "") -> Cell:
    """A number with so many decimals."""
    return Cell(fixed(value, digits), value, title=title)


def signed_number(value: float | None, digits: int = 1, title: str = "") -> Cell:
    return Cell(signed(value, digits), value, title=title)


def known_number(value: float, uncertainty: float, most_digits: int = 2) -> Cell:
    """A number rounded to its standard uncertainty."""
    return Cell(rounded(value, uncertainty, most_digits), value)


def texts(*parts: str) -> tuple[Cell, ...]:
    return tuple(Cell(part) for part in parts)


def _plain(table: Table) -> PlainTable:
    rows = [
        PlainRow(
            group=row.group,
            source=row.source,
            cells=[PlainCell(text=cell.text, value=cell.value) for cell in row.cells],
        )
        for row in table.rows
    ]
    return PlainTable(name=table.name, title=table.title, head=list(table.head), command=table.command, rows=rows)

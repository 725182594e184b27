"""References of rooms with products against each other: measured, kept as JSON, and laid out as a table."""

from __future__ import annotations

import dataclasses
import importlib
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.files import json_text, write_atomic
from transom.report.table import Cell, Row, Table, known_number, number, plain_tables, signed_number
from transom.scene import load_scene

SCENE, OPENING = "test_room", "south_upper"

TABLE = "cfs_references"
COMMAND = "transom referees"


class RefereeRow(BaseModel):
    """Two methods' answers to one question, with their standard errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    product: str
    quantity: str
    place: str
    first: str
    second: str
    first_value: float
    first_error: float
    second_value: float
    second_error: float
    unit: str
    note: str = ""

    @property
    def difference_percent(self) -> float | None:
        """Second against first; None where the first is 0."""
        return 100 * (self.second_value / self.first_value - 1) if self.first_value else None

    @property
    def uncertainty_percent(self) -> float | None:
        """Joint standard error, of the first value."""
        joint = (self.first_error**2 + self.second_error**2) ** 0.5
        return 100 * joint / self.first_value if self.first_value else None


def measure_rooms(product: str) -> list[RefereeRow]:
    """Portals against volpath and Radiance at sensors of the test room. Minutes of work."""
    scene = load_scene(SCENE)
    condition = resolve_condition(scene.conditions[0], scene.site)
    return _rows(_reference().rooms(scene, condition, OPENING, product))


def measure_microgeometry(product: str) -> list[RefereeRow]:
    """The section tracer against particles through triangles. Seconds of work."""
    return _rows(_reference().microgeometry(product))


def measure_convergence(product: str) -> list[tuple[str, int, float]]:
    """(method, paths, relative standard error) at a sensor of the test room."""
    scene = load_scene(SCENE)
    condition = resolve_condition(scene.conditions[0], scene.site)
    return list(_reference().convergence(scene, condition, OPENING, product))


def read_rows(file: Path) -> list[RefereeRow]:
    """Rows of an earlier run, none where there is no file. Raises InputError for a file of another form."""
    if not file.is_file():
        return []
    try:
        return TypeAdapter(list[RefereeRow]).validate_python(json.loads(file.read_text())["rows"])
    except (ValueError, KeyError, ValidationError) as error:
        remedy = "Delete it, and measure again"
        raise InputError(f"is not a list of comparisons ({error})", file=file, remedy=remedy) from error


def read_convergence(file: Path) -> list[tuple[str, int, float]]:
    """(method, paths, relative standard error) of an earlier run, none where there is no file."""
    if not file.is_file():
        return []
    return [(str(name), int(paths), float(error)) for name, paths, error in json.loads(file.read_text())["convergence"]]


def write_rows(file: Path, rows: Sequence[RefereeRow], convergence: Sequence[tuple[str, int, float]]) -> None:
    """Replaces the file whole."""
    content = {"rows": [row.model_dump() for row in rows], "convergence": [list(point) for point in convergence]}
    write_atomic(file, json_text(content))


def write_table(file: Path, rows: Sequence[RefereeRow], source: str) -> None:
    """The table of the report's chapter, in the form of tables.json."""
    plain = plain_tables([referee_table(rows, source)], datetime.now(UTC).replace(microsecond=0))
    write_atomic(file, json_text(plain.model_dump(mode="json")))


def referee_table(rows: Sequence[RefereeRow], source: str) -> Table:
    """Rows by product; the difference is the second method's from the first."""
    head = ("Quantity", "Place, light", "First, second", "First", "Second", "Unit", "Difference [%]", "u [%]", "Note")
    body = tuple(
        Row(
            (
                Cell(row.quantity),
                Cell(row.place),
                Cell(f"{row.first}, {row.second}"),
                known_number(row.first_value, row.first_error),
                known_number(row.second_value, row.second_error),
                Cell(row.unit),
                Cell("") if row.difference_percent is None else signed_number(row.difference_percent, 2),
                Cell("") if row.uncertainty_percent is None else number(row.uncertainty_percent, 2),
                Cell(row.note),
            ),
            source,
            row.product.replace("_", " ").capitalize(),
        )
        for row in rows
    )
    return Table(TABLE, "References of rooms with products, against each other", head, body, COMMAND)


def _reference() -> Any:
    return importlib.import_module("transom_reference.product_referees")


def _rows(found: Any) -> list[RefereeRow]:
    rows = []
    for item in found:
        given = dataclasses.asdict(item)
        one, other = given.pop("one"), given.pop("other")
        values = {"first_value": one["value"], "first_error": one["error"]}
        values |= {"second_value": other["value"], "second_error": other["error"]}
        rows.append(RefereeRow(**given, **values))
    return rows

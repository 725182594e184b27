"""Sensors as tables: points, normals and, once measured, illuminances with their standard errors, as CSV files."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError
from transom.files import write_atomic
from transom.scene.model import Scene, SensorSet

Float64 = NDArray[np.float64]

PLACE_COLUMNS = ("x", "y", "z", "nx", "ny", "nz")
VALUE_COLUMNS = ("illuminance_lx", "standard_error_lx")


@dataclass(frozen=True)
class SensorTable:
    """N sensors in rows. sets: (N,) name of the set that each belongs to, "" for none. points (N, 3) [m],
    normals (N, 3) unit. illuminance and standard_error: (N,) [lx], or None before they are measured."""

    sets: tuple[str, ...]
    points: Float64
    normals: Float64
    illuminance: Float64 | None = None
    standard_error: Float64 | None = None

    def measured(self, illuminance: Float64, standard_error: Float64) -> SensorTable:
        """The same sensors with values [lx]."""
        return SensorTable(self.sets, self.points, self.normals, illuminance, standard_error)


def scene_sensors(scene: Scene) -> SensorTable | None:
    """All sensor sets of a scene as one table, or None for a scene without sensors."""
    return _joined(scene.sensors) if scene.sensors else None


def write_sensors(path: Path, table: SensorTable) -> None:
    """Writes the table; the set names only where there are some."""
    named = any(table.sets)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    measured = table.illuminance is not None and table.standard_error is not None
    header = (("set",) if named else ()) + PLACE_COLUMNS + (VALUE_COLUMNS if measured else ())
    writer.writerow(header)
    for row, (name, point, normal) in enumerate(zip(table.sets, table.points, table.normals, strict=True)):
        cells: list[str] = [name] if named else []
        cells += [f"{value:.9g}" for value in (*point, *normal)]
        if table.illuminance is not None and table.standard_error is not None:
            cells += [f"{table.illuminance[row]:.7g}", f"{table.standard_error[row]:.4g}"]
        writer.writerow(cells)
    write_atomic(path, stream.getvalue())


def read_sensors(path: Path) -> SensorTable:
    """Reads a table with or without set names and values. Normals are normalised.

    Values may be NaN or infinite: comparing tells whose fault that is. Raises InputError for a missing file, missing or
    unknown columns, a cell that is no number, a place or normal that is not finite, or a normal of no length.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError("does not exist", file=path) from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({error})", file=path) from error
    rows = [row for row in csv.reader(io.StringIO(text)) if row and not row[0].lstrip().startswith("#")]
    if not rows:
        raise InputError("is empty", file=path, remedy=f"Its first line is {','.join(PLACE_COLUMNS)}")
    header = [name.strip() for name in rows[0]]
    missing = [name for name in PLACE_COLUMNS if name not in header]
    unknown = [name for name in header if name not in ("set", *PLACE_COLUMNS, *VALUE_COLUMNS)]
    if missing or unknown or len(set(header)) != len(header):
        problem = f"lacks the column {missing[0]}" if missing else "has an unknown or repeated column"
        raise InputError(
            problem, file=path, field="line 1", value=",".join(header), remedy=f"It is {','.join(PLACE_COLUMNS)}"
        )
    if len(rows) == 1:
        raise InputError("holds no sensor", file=path)
    numbers = {name: np.empty(len(rows) - 1) for name in header if name != "set"}
    sets: list[str] = []
    for index, row in enumerate(rows[1:]):
        place = f"sensor {index + 1}"
        if len(row) != len(header):
            raise InputError(f"has {len(row)} cells where {len(header)} are needed", file=path, field=place)
        cells = dict(zip(header, row, strict=True))
        sets.append(cells.get("set", "").strip())
        for name, column in numbers.items():
            column[index] = _number(cells[name], path, f"{place}, {name}", measured=name in VALUE_COLUMNS)
    points = np.stack([numbers[name] for name in "xyz"], axis=1)
    normals = np.stack([numbers[name] for name in ("nx", "ny", "nz")], axis=1)
    lengths = np.linalg.norm(normals, axis=1)
    if not lengths.all():
        raise InputError(
            "has a normal of no length", file=path, field=f"sensor {int(np.argmin(lengths)) + 1}", remedy="Up is 0,0,1"
        )
    values = [numbers.get(name) for name in VALUE_COLUMNS]
    return SensorTable(tuple(sets), points, normals / lengths[:, None], values[0], values[1])


def _joined(sets: Sequence[SensorSet]) -> SensorTable:
    names = tuple(entry.name for entry in sets for _ in range(len(entry.points)))
    points = np.concatenate([np.asarray(entry.points, np.float64).reshape(-1, 3) for entry in sets])
    normals = np.concatenate([np.asarray(entry.normals, np.float64).reshape(-1, 3) for entry in sets])
    return SensorTable(names, points, normals)


def _number(cell: str, path: Path, place: str, *, measured: bool) -> float:
    try:
        value = float(cell)
    except ValueError as error:
        raise InputError("is not a number", file=path, field=place, value=cell.strip()) from error
    if not (measured or math.isfinite(value)):
        raise InputError("is not finite", file=path, field=place, value=cell.strip())
    return value

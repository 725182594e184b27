"""check.json as the report reads it: what `transom check` found against the blessed baselines."""

from __future__ import annotations

from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from transom.check import Checked
from transom.errors import invalid_field


def read_check(path: Path) -> list[Checked]:
    """The checks of an earlier run; none where there was none. Raises InputError for a malformed file."""
    if not path.is_file():
        return []
    try:
        return TypeAdapter(list[Checked]).validate_json(path.read_bytes())
    except ValidationError as error:
        raise invalid_field(error, path) from error

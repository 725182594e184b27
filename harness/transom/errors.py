"""The exception for bad input: names the file, the field, the value found, what is allowed and what to do."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


class InputError(Exception):
    """Bad input. Its text is one line that a user can act on: `file: field = value <problem>. <remedy>`."""

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        field: str | None = None,
        value: object = None,
        remedy: str | None = None,
    ) -> None:
        place = f"{file}: " if file is not None else ""
        subject = ""
        if field is not None:
            subject = f"{field} = {value!r} " if value is not None else f"{field} "
        text = f"{place}{subject}{problem}".rstrip(". ") + "."
        if remedy:
            text += f" {remedy.rstrip('. ')}."
        super().__init__(text)
        self.file, self.field, self.value, self.remedy = file, field, value, remedy


class StorageError(InputError):
    """A file that cannot be written: the disk is full, or the folder read-only. Going on would lose work."""


def invalid_field(error: ValidationError, path: Path) -> InputError:
    """The first problem of a malformed file as one line: its place, the value found, what is allowed."""
    first = error.errors()[0]
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    value = None if first["type"] == "missing" else first["input"]
    return InputError(f"is refused: {first['msg']}", file=path, field=place or "file", value=value)

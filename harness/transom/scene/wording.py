"""Turns what pydantic found wrong in scene.toml into the one line of an InputError."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from transom.errors import InputError


def shown_path(path: Path) -> str:
    """The path as a user would write it: relative to the working directory where it lies below it."""
    try:
        return str(path.resolve().relative_to(Path.cwd().resolve()))
    except ValueError:
        return str(path)


def near(word: str, known: list[str]) -> str:
    """The question `Did you mean ...?` with the known words nearest to `word`, or nothing."""
    matches = difflib.get_close_matches(word, known, n=3, cutoff=0.66)
    return f"Did you mean {' or '.join(matches)}?" if matches else ""


def field_name(location: tuple[int | str, ...]) -> str:
    """("openings", 2, "name") as openings[2].name."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def input_error(error: ValidationError, model: type[BaseModel], file: Path) -> InputError:
    """The first thing to repair, as one line. Unknown keys come first: they often explain a missing one."""
    found = min(error.errors(), key=lambda item: item["type"] != "extra_forbidden")
    location, kind = found["loc"], found["type"]
    place, field = shown_path(file), field_name(location)
    if kind == "extra_forbidden":
        fields = _fields_at(model, location[:-1])
        word = str(location[-1])
        allowed = f"Allowed here: {', '.join(fields)}"
        return InputError("is an unknown key", file=place, field=field, remedy=near(word, fields) or allowed)
    if kind == "missing":
        return InputError("is missing", file=place, field=field, remedy=_missing_remedy(str(location[-1])))
    if kind == "too_short":
        return InputError("has no entry", file=place, field=field, remedy=f"Add at least one [[{location[0]}]] table")
    if kind == "transom":
        context: dict[str, Any] = found.get("ctx", {})
        if context["field"]:
            field, value = f"{field}.{context['field']}", context["value"]
        else:
            value = found["input"] if not isinstance(found["input"], dict | BaseModel) else None
        return InputError(context["problem"], file=place, field=field, value=value, remedy=context["remedy"] or None)
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return InputError("is not a table", file=place, field=field, value=found["input"], remedy="Write it as [table]")
    if kind == "list_type":
        return InputError(
            "is not a list of tables", file=place, field=field, remedy=f"Write [[{field}]] with two brackets"
        )
    return InputError(f"is wrong: {found['msg']}", file=place, field=field, value=found["input"])


def _missing_remedy(name: str) -> str:
    examples = {
        "format": "Begin the file with format = 1",
        "mesh": "Add a [mesh] table with file, unit and up",
        "views": "Add at least one [[views]] table",
        "conditions": "Add at least one [[conditions]] table",
        "unit": 'Say the unit of the mesh: unit = "m", "cm", "mm", "ft" or "in"',
        "up": 'Say which axis of the mesh points up: up = "z" or up = "y"',
        "display_white_cd_m2": "Add the luminance that pictures show as white, like display_white_cd_m2 = 500",
        "normal": "Add the direction the sensors face, like normal = [0, 0, 1]",
    }
    return examples.get(name, f"Add {name} = ...; scenes/README.md describes it")


def _fields_at(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Names of the fields of the table at `location` inside `model`."""
    current = model
    for part in location:
        if isinstance(part, str) and part in current.model_fields:
            inner = _table_in(current.model_fields[part].annotation)
            if inner is not None:
                current = inner
    return list(current.model_fields)


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table class inside an annotation such as list[Table], dict[str, Table] or Table | None."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for part in get_args(annotation) if (found := _table_in(part)) is not None), None)

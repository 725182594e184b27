"""reports/README.md says what every field of the bench's files is, and of no field that they do not have."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, get_args

import pytest

from transom.bench import QuantityName

REPORTS = Path(__file__).resolve().parents[2] / "reports"
README = (REPORTS / "README.md").read_text(encoding="utf-8")
FILES = {"bench.schema.json": "Bench", "speed_error.schema.json": "SpeedError"}


def documented(name: str) -> list[str]:
    """First cells of the table under the heading of that name."""
    sections = re.findall(rf"^### {name}\n(.*?)(?=^#|\Z)", README, re.MULTILINE | re.DOTALL)
    assert len(sections) == 1, f"reports/README.md has {len(sections)} sections '### {name}'"
    return re.findall(r"^\| `(\w+)` \|", sections[0], re.MULTILINE)


def schema_objects() -> list[tuple[str, list[str]]]:
    """Every object of the files and its fields; the file itself under its own name."""
    found: dict[str, list[str]] = {}
    for file, name in FILES.items():
        schema: dict[str, Any] = json.loads((REPORTS / file).read_text(encoding="utf-8"))
        for part, definition in {name: schema, **schema["$defs"]}.items():
            fields = list(definition["properties"])
            assert found.setdefault(part, fields) == fields, f"{part} differs between the files"
    return sorted(found.items())


@pytest.mark.parametrize(("name", "fields"), schema_objects(), ids=[name for name, _ in schema_objects()])
def test_every_field_is_documented_once_and_no_other(name: str, fields: list[str]) -> None:
    assert sorted(documented(name)) == sorted(fields)


def test_every_quantity_of_the_bench_is_documented() -> None:
    assert sorted(documented("Quantity")) == sorted(get_args(QuantityName))


def test_every_row_says_what_the_field_means() -> None:
    rows = re.findall(r"^\| `\w+` \|.*$", README, re.MULTILINE)
    assert rows
    assert all(len(row.strip("| ").split("|")[-1].strip()) > 0 for row in rows)

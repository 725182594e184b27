"""HTML, PDF, CSV, JSON and JUnit say the same: every printed number in every format, from one report."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import jsonschema
import pytest
from pypdf import PdfReader
from report_project import make_project, render_references

from transom.errors import InputError
from transom.report.build import write_report
from transom.report.numbers import MINUS, THIN
from transom.report.pictures import Drawing, Picture
from transom.report.results import SCHEMAS
from transom.report.table import Row, Table, texts

VIEW_TABLES = {"regions"}
"""Tables that the page prints in parts, one a view."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as monkeypatch:
        root = tmp_path_factory.mktemp("agreement")
        monkeypatch.setenv("TRANSOM_CACHE", str(root / "cache"))
        monkeypatch.setenv("TRANSOM_REFERENCES", str(root / "references"))
        project = make_project(root, monkeypatch)
        render_references()
        write_report(project / "report", project / "build")
        return project / "report"


class TableReader(HTMLParser):
    """Cell texts of the page's tables by name, row by row, with what each row says of its source."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: dict[str, list[tuple[str, list[str]]]] = {}
        self._name: str | None = None
        self._in_cell = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag == "table":
            self._name = values.get("data-table")
        if tag == "tr" and self._name and "title" in values:
            self.rows.setdefault(self._name, []).append((str(values["title"]), []))
        if tag == "td" and self._name:
            self.rows[self._name][-1][1].append("")
            self._in_cell = True

    def handle_endtag(self, tag: str) -> None:
        self._in_cell = self._in_cell and tag != "td"

    def handle_data(self, data: str) -> None:
        if self._in_cell and self._name:
            self.rows[self._name][-1][1][-1] += data


def plain_tables(report: Path) -> dict[str, dict[str, Any]]:
    return {table["name"]: table for table in json.loads((report / "tables.json").read_text())["tables"]}


def number_of(text: str) -> float:
    return float(text.replace(THIN, "").replace(MINUS, "-").replace("+", "").split(" ")[0])


def test_json_files_follow_their_published_schemas(report: Path) -> None:
    for name in ("results", "tables"):
        schema = json.loads((SCHEMAS / f"{name}.schema.json").read_text())
        jsonschema.Draft202012Validator.check_schema(schema)
        jsonschema.validate(json.loads((report / f"{name}.json").read_text()), schema)


def test_page_prints_every_cell_of_the_tables(report: Path) -> None:
    reader = TableReader()
    reader.feed((report / "index.html").read_text())
    for name, table in plain_tables(report).items():
        if name == "matrix" or not table["rows"]:
            continue
        written = [(row["source"], [cell["text"].replace("_", " ") for cell in row["cells"]]) for row in table["rows"]]
        printed = [(source, [text.replace("_", " ") for text in cells]) for source, cells in reader.rows[name]]
        if name in VIEW_TABLES:
            written = [row for row in written if row in printed]
            assert written
        assert printed == written, name


def test_csv_files_hold_the_same_rows_with_their_unrounded_numbers(report: Path) -> None:
    tables = plain_tables(report)
    assert {path.stem for path in (report / "tables").glob("*.csv")} == set(tables)
    for name, table in tables.items():
        rows = list(csv.reader(io.StringIO((report / "tables" / f"{name}.csv").read_text())))
        assert [row[0] for row in rows[1:]] == [row["group"] for row in table["rows"]]
        for line, row in zip(rows[1:], table["rows"], strict=True):
            assert line[-1] == row["source"]
            for text, cell in zip(line[1:-1], row["cells"], strict=True):
                if cell["value"] is None:
                    assert text == cell["text"]
                else:
                    assert float(text) == pytest.approx(cell["value"], rel=1e-9)


def test_printed_numbers_are_the_values_rounded(report: Path) -> None:
    checked = 0
    for table in plain_tables(report).values():
        for row in table["rows"]:
            for cell in row["cells"]:
                plain = re.fullmatch(rf"[+{MINUS}]?[\d{THIN}]+(\.(\d+))?( %)?", cell["text"])
                if cell["value"] is None or not plain or not math.isfinite(cell["value"]):
                    continue
                digits = len(plain.group(2) or "")
                assert number_of(cell["text"]) == pytest.approx(cell["value"], abs=0.50001 * 10.0**-digits)
                checked += 1
    assert checked > 60


def test_pdf_prints_the_tables(report: Path) -> None:
    words = " ".join(page.extract_text() for page in PdfReader(report / "report.pdf").pages).split()
    text = "".join(words)
    for name, table in plain_tables(report).items():
        if name in ("matrix", "verdicts"):
            continue
        for row in table["rows"]:
            for cell in row["cells"]:
                assert "".join(cell["text"].replace("_", " ").split()).replace("-", "") in text.replace("-", ""), name


def test_junit_and_results_hold_the_same_verdicts(report: Path) -> None:
    root = ET.fromstring((report / "junit.xml").read_bytes())
    results = json.loads((report / "results.json").read_text())
    kinds = {"PASS": "pass", "FAIL": "failure", "INCONCLUSIVE": "error", "NO_REFERENCE": "error", "CRASHED": "error"}
    written = [(verdict["suite"], verdict["name"], kinds[verdict["outcome"]]) for verdict in results["verdicts"]]
    found = []
    for suite in root:
        for case in suite.findall("testcase"):
            child = next((entry.tag for entry in case if entry.tag in ("failure", "error")), "pass")
            found.append((suite.get("name"), case.get("name"), child))
    assert found == written


def test_list_of_verdicts_and_matrix_count_alike(report: Path) -> None:
    results, tables = json.loads((report / "results.json").read_text()), plain_tables(report)
    listed = [row["cells"][0]["text"] for row in tables["verdicts"]["rows"]]
    assert sorted(listed) == sorted(verdict["outcome"] for verdict in results["verdicts"])
    counts = [re.search(r"(\d+) of (\d+)", cell["text"]) for row in tables["matrix"]["rows"] for cell in row["cells"]]
    assert sum(int(match.group(2)) for match in counts if match) == len(listed)


def test_every_row_and_verdict_says_where_it_is_from(report: Path) -> None:
    assert all(row["source"] for table in plain_tables(report).values() for row in table["rows"])
    results = json.loads((report / "results.json").read_text())
    keys = {row["engine_key"][:12] for row in results["images"]} | {
        row["engine_key"][:12] for row in results["sensors"]
    }
    origins = {
        verdict["origin"].split(" ")[0] for verdict in results["verdicts"] if verdict["quantity"] == "bias_percent"
    }
    assert origins and origins <= keys


def test_figures_and_rows_without_provenance_are_refused() -> None:
    with pytest.raises(InputError, match="figure without provenance"):
        Picture("a picture", b"", 1, 1, source="")
    with pytest.raises(InputError, match="figure without provenance"):
        Drawing("<svg/>", "a drawing", "a line", source="")
    with pytest.raises(InputError, match="row without provenance"):
        Table("name", "Title", ("a",), (Row(texts("1"), source=""),), "transom report")


def test_missing_parts_are_said_with_the_command_that_makes_them(report: Path) -> None:
    page = (report / "index.html").read_text()
    for command in ("transom run crosscheck", "transom run hard", "transom bench"):
        assert f"<code>{command}" in page

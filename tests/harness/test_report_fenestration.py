"""The chapter on complex fenestration: products side by side, transport judged, and tables that others wrote."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Browser, find_chromium
from report_project import FENESTRATION, make_project, render_references

from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.fenestration.reglazing import load_glazed
from transom.report.build import write_report
from transom.report.fenestration import profile_angle_deg
from transom.report.rows_fenestration import Expected, glazing_words, written_table
from transom.report.table import TABLES_FORMAT, PlainCell, PlainRow, PlainTable, TablesFile
from transom.scene.model import ConditionSpec

BINARY = find_chromium()


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A report of the small project with a suite of products, all of them rendered."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        root = tmp_path_factory.mktemp("chapter")
        monkeypatch.setenv("TRANSOM_CACHE", str(root / "cache"))
        monkeypatch.setenv("TRANSOM_REFERENCES", str(root / "references"))
        project = make_project(root, monkeypatch, sky="clear", more_suites=FENESTRATION)
        render_references(("rooms", "hours", "fenestration"))
        write_report(project / "report", project / "build")
        yield project / "report"


def table(report: Path, name: str) -> dict[str, Any]:
    tables = json.loads((report / "tables.json").read_text())["tables"]
    found: dict[str, Any] = next(entry for entry in tables if entry["name"] == name)
    return found


def test_every_product_is_judged_in_a_row_of_its_own(report: Path) -> None:
    found = table(report, "cfs_transport")
    cells = [[cell["text"] for cell in row["cells"]] for row in found["rows"]]
    assert [row[0] for row in cells] == ["Clear glass, 0.5", "Prismatic panel, angle low 30"]
    assert all(row[-1] == "PASS" for row in cells)
    errors = [row["cells"][2]["value"] for row in found["rows"]]
    assert errors == pytest.approx([1.0, 1.0], abs=0.3), "the fake engine is 1 % too bright"
    assert {row["group"] for row in found["rows"]} == {"Small, top"}


def test_products_are_beside_the_reference_in_a_gallery_and_not_among_the_rooms(report: Path) -> None:
    page = (report / "index.html").read_text()
    chapter = page[page.index('<section id="fenestration">') : page.index('<section id="speed">')]
    gallery = chapter[chapter.index('<div class="gallery">') :]
    for product in ("Clear glass, 0.5", "Prismatic panel, angle low 30"):
        for renderer in ("Transom", "Mitsuba 3"):
            assert f'alt="{product}: {renderer}"' in gallery
    assert chapter.count('class="viewer"') == 2
    rooms = page[page.index('<section id="rooms">') : page.index('<section id="sensors">')]
    assert "window" not in rooms
    headings = [row["group"] for row in table(report, "table_1")["rows"]]
    assert not any("window" in heading for heading in headings)


def test_what_no_command_has_written_is_said_to_be_absent(report: Path) -> None:
    page = (report / "index.html").read_text()
    absent = page[page.index('class="absent-list"') : page.index("</details>")]
    assert "Interpolation between directions" in absent and "Speed with products" in absent


@pytest.mark.skipif(BINARY is None, reason="no Chromium here: the page is not looked at")
def test_the_chapter_fits_a_narrow_window(report: Path, tmp_path: Path) -> None:
    assert BINARY is not None
    with Browser(BINARY, tmp_path / "profile") as browser:
        browser.open(report / "index.html")
        browser.resize(420, 900)
        assert browser.run("document.documentElement.scrollWidth") <= 420
        assert browser.errors == []


def test_a_written_table_comes_back_cell_by_cell(tmp_path: Path) -> None:
    rows = [PlainRow(group="floor", source="seed 7", cells=[PlainCell(text="prism", value=None)])]
    plain = PlainTable(name="cfs_energy", title="Energy", head=["Product"], command="make it", rows=rows)
    file = TablesFile(format=TABLES_FORMAT, created=datetime.now(UTC), tables=[plain])
    (tmp_path / "cfs_energy.json").write_text(file.model_dump_json())
    found = written_table(tmp_path, Expected("cfs_energy", "?", "?"))
    assert (found.title, found.command, found.rows[0].source) == ("Energy", "make it", "seed 7")
    (tmp_path / "cfs_other.json").write_text(file.model_dump_json())
    with pytest.raises(InputError, match="no table of that name"):
        written_table(tmp_path, Expected("cfs_other", "?", "?"))
    (tmp_path / "cfs_bad.json").write_text("{}")
    with pytest.raises(InputError, match=r"cfs_bad\.json"):
        written_table(tmp_path, Expected("cfs_bad", "?", "?"))


def test_glazing_is_told_in_words() -> None:
    glazings = ["south_upper=laser_cut_panel", "south_lower=clear:0.6"]
    assert glazing_words(load_glazed("test_room", glazings)) == "Clear glass, 0.6; Laser cut panel"
    assert glazing_words(load_glazed("test_room", ["south_upper=none"])) == "No glass"


def test_profile_angle_is_the_suns_altitude_at_noon_and_grows_beside_it() -> None:
    """tan(profile) = tan(altitude) / cos(azimuth from the facade's normal)."""
    scene = load_glazed("test_room")
    for hour in ("09:00", "15:30"):
        condition = resolve_condition(ConditionSpec("c", f"2026-03-21T{hour}"), scene.site)
        assert condition.sun_direction is not None
        east, north, up = condition.sun_direction
        altitude, azimuth = np.arcsin(up), np.arctan2(east, -north)
        expected = np.degrees(np.arctan(np.tan(altitude) / np.cos(azimuth)))
        assert profile_angle_deg(condition) == pytest.approx(expected)
    assert profile_angle_deg(resolve_condition(ConditionSpec("c", "2026-06-21T05:00"), scene.site)) is None

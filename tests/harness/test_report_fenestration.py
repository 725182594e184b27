"""The chapter on complex fenestration: products side by side, transport judged, and tables that others wrote."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Browser, find_chromium
from report_project import FENESTRATION, make_project, render_references

from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.fenestration.evaluation import COUNTS, WIDTHS_DEG, Errors, ProductEvaluation
from transom.fenestration.reglazing import load_glazed
from transom.report import rows_fenestration
from transom.report.build import write_report
from transom.report.fenestration import profile_angle_deg
from transom.report.rows_fenestration import glazing_words
from transom.report.table import Table
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
    assert "Interpolation: light moved" in absent and "Speed with products" in absent


@pytest.mark.skipif(BINARY is None, reason="no Chromium here: the page is not looked at")
def test_the_chapter_fits_a_narrow_window(report: Path, tmp_path: Path) -> None:
    assert BINARY is not None
    with Browser(BINARY, tmp_path / "profile") as browser:
        browser.open(report / "index.html")
        browser.resize(420, 900)
        assert browser.run("document.documentElement.scrollWidth") <= 420
        assert browser.errors == []


def evaluation(**changes: Any) -> ProductEvaluation:
    flat = Errors(relative=[[0.01, -0.02], [0.03, 0.0]])
    shares = [[min(1.0, 0.2 * count + 0.01 * width) for count in COUNTS] for width in WIDTHS_DEG]
    known: dict[str, Any] = {
        "product": "prismatic_panel",
        "rays": 512,
        "represented": shares,
        "represented_least": shares,
    }
    known |= {"moved_ours": 0.02, "moved_rank": 0.08, "moved_paper": 0.1, "moved_nearest": 0.12}
    known |= {"traced": flat, "tabulated": flat, "tracer": flat, "sky": flat, "split_difference": 2e-17}
    known |= {"transmittance_mean_difference": -3e-5, "transmittance_uncertainty": 5e-5}
    return ProductEvaluation(**(known | changes))


def texts(found: Table) -> list[list[str]]:
    return [[cell.text for cell in row.cells] for row in found.rows]


def test_an_evaluation_of_lobes_becomes_the_tables_of_the_chapter(tmp_path: Path) -> None:
    file = tmp_path / "evaluation.json"
    file.write_text(json.dumps([evaluation().model_dump()]))
    found = rows_fenestration.read_evaluations(file)
    (row,) = texts(rows_fenestration.representation(found, "made up"))
    assert row[:2] == ["Prismatic panel", "1.50 / 2.70"]
    (row,) = texts(rows_fenestration.interpolation(found, "made up"))
    assert row[1:] == ["2.0", "8.0", "10.0", "12.0", "0.25"]
    (row,) = texts(rows_fenestration.energy(found, "made up"))
    assert row[1:] == ["−0.30", "0.50", "2.0e-13"]
    rows = texts(rows_fenestration.represented(found, "made up"))
    assert [row[0] for row in rows] == ["2", "4", "8", "15", "23", "30"]
    assert rows[4][3] == "83.0"


def test_no_evaluation_is_no_rows_and_a_malformed_one_is_refused_by_name(tmp_path: Path) -> None:
    assert rows_fenestration.read_evaluations(tmp_path / "evaluation.json") == []
    (tmp_path / "evaluation.json").write_text('[{"product": 3}]')
    with pytest.raises(InputError, match=r"evaluation\.json"):
        rows_fenestration.read_evaluations(tmp_path / "evaluation.json")


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

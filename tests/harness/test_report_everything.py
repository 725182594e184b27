"""A report with every kind of row there is: each appears in every format, with its verdict, and in its schema."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import jsonschema
import pytest
from pypdf import PdfReader

from transom.baseline import Drift
from transom.bench import Bench, Measurement
from transom.check import Checked
from transom.comparison import (
    COMPARISON_FORMAT,
    AnalyticComparison,
    Comparison,
    CrossCheck,
    HardCase,
    LadderStep,
    MethodAgreement,
    ModelError,
)
from transom.judge import ToleranceFile, judge
from transom.machine_limits import Utilisation
from transom.provenance import current_provenance
from transom.report.build import write_files
from transom.report.content import Content, Pictures, make_content
from transom.report.fenestration import Chapter, prism_figure
from transom.report.notes import read_notes
from transom.report.results import SCHEMAS, Results, collect_results
from transom.report.speed import Speed
from transom.speed_error import Missing as NotMeasured
from transom.speed_error import SpeedError, SpeedErrorRow
from transom.speed_ratio import SpeedUp

TOLERANCES = ToleranceFile.model_validate(
    {
        "format": 1,
        "tolerances": [
            {"quantity": "analytic_percent", "tolerance": 1.0, "reason": "stated", "aims": [0.1]},
            {"quantity": "analytic_percent", "scene": "cube", "tolerance": 2.0, "reason": "looser at edges"},
            {"quantity": "crosscheck_image_percent", "tolerance": 2.0, "reason": "stated"},
            {"quantity": "crosscheck_sensor_percent", "tolerance": 0.5, "reason": "stated"},
            {"quantity": "broken_claims", "tolerance": 0.5, "reason": "holds or not"},
            {"quantity": "baseline_percent", "tolerance": 0.2, "reason": "no noise"},
        ],
    }
)
NOW = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)


def comparison() -> Comparison:
    known = AnalyticComparison("cube", "L at a corner", "cd/m²", 101.5, 100.0, 0.0, 1.5, "an equation", "engine")
    check = CrossCheck(
        *("room", "door", "interior", "noon", "image mean", "cd/m²", "matched"),
        *("mitsuba", "radiance exact", 100.0, 103.0, -3.0, 0.1, 32, "interpolates its cache"),
    )
    sensor = replace(check, view="", region="desk 3", quantity="sensor", unit="lx", difference_percent=0.1)
    return Comparison(
        COMPARISON_FORMAT,
        "everything",
        "Everything",
        agreements=(MethodAgreement("room", "door", "noon", 100, 3, 0, 3.0, 0.0),),
        analytic=(known, replace(known, program="radiance", value=100.2, error_percent=0.2, batch_count=32)),
        crosschecks=(check, sensor),
        model_errors=(ModelError("room", "door", "floor", "noon", "image mean", "cd/m²", 100.0, 98.5, 1.52, 0.2),),
        ladder=(
            LadderStep("room", "door", "noon", "radiance", 1, "-ab 1", 2.5, None, 9.0, -8.0),
            LadderStep("room", "door", "noon", "radiance", 2, "-ab 5", 80.0, 7.5, 1.6, -0.4),
        ),
        hard_cases=(
            HardCase("grazing_sun", "sun", "finite", "every pixel is finite", True, "76800 of 76800", 0.5),
            HardCase("one_millimetre", "scale", "invariant", "as the room of 4 m", False, "12.5 % apart", 0.5),
        ),
    )


def speed() -> Speed:
    row = SpeedErrorRow("room", "door", "noon", "engine", "default", "hour", (0.1, 0.11), 2.5, 0.1, 0.05)
    other = replace(row, program="mitsuba", setting="32 paths a pixel", seconds=(20.0, 21.0), error_percent=5.5)
    found = SpeedError(
        format=1,
        created=NOW,
        width=320,
        height=240,
        reference_key="abcdef0123456789",
        reference_noise_percent=1.0,
        rows=(row, replace(row, phase="cold", seconds=(4.0,)), other, replace(other, phase="cold")),
        speed_ups=(SpeedUp("mitsuba", "hour", 812.4, 655.1, 990.2, 2.5, "extrapolated"),),
        missing=(NotMeasured("classic", "default", "it is not built"),),
        limits=(),
        load_average=(0.5, 0.6),
        provenance=current_provenance(),
    )
    times = Measurement("solve", "s", "default", 3000, 9000, 500, 6, 1, 0, 0, 0, 4.5, 4.25, 4.75, (4.5, 4.25, 4.0))
    bench = Bench(
        *(1, NOW, "room", "fedcba987654", 40.0, (0.5, 0.6)),
        (times, replace(times, quantity="load", median=0.25), replace(times, quantity="relight_hour", median=0.1)),
        (),
        (Utilisation("relight/gather", "memory_copy", "B/s", 3.25e9, 0.5, "bytes of the weights"),),
        *((), ()),
        current_provenance(),
    )
    return Speed({"room": 0.25}, [bench], found)


def checked() -> Checked:
    drift = Drift(
        *("room/door/noon/rays", "room", "door", "noon", "rays", "baseline_percent", "mean", "floor"),
        *(100.0, 100.7, 0.7, 0.0, 16, None),
    )
    verdicts = judge([drift.subject("baseline")], (), TOLERANCES)
    empty = Comparison(COMPARISON_FORMAT, "quick", "Quick")
    return Checked("quick", "Quick", None, empty, [], [drift], verdicts, "2026-01-01, first blessing", 9.0)


@pytest.fixture(scope="module")
def content() -> Content:
    made = comparison()
    results = collect_results([(made, judge(made.subjects(), made.missing, TOLERANCES))], [])
    chapter = Chapter([], [], prism_figure(), [], [])
    pictures = Pictures(rooms=[], hours=[], factoring=[], day=None, figure_13=[], corners=[], fenestration=chapter)
    return make_content(results, [], pictures, speed(), TOLERANCES, read_notes(), [checked()])


@pytest.fixture(scope="module")
def folder(content: Content, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("everything")
    made = comparison()
    write_files(path, content, [(made, judge(made.subjects(), made.missing, TOLERANCES))])
    return path


EXPECTED = {
    "crosscheck": ("interpolates its cache", "−3.00"),
    "model_error": ("+1.52",),
    "ladder": ("-ab 5", "7.50", "first step"),
    "analytic": ("+1.500", "+0.200", "L at a corner"),
    "hard_cases": ("12.5 % apart", "every pixel is finite"),
    "use_time": ("4.50", "290"),
    "bench": ("4.75",),
    "machine_limits": ("bytes of the weights", "50.0"),
    "speed_error": ("32 paths a pixel", "5.50", "it is not built"),
    "speed_ups": ("812.4", "655.1 to 990.2"),
    "baseline": ("+0.700", "100.7"),
    "tolerance_debt": ("looser at edges",),
    "tolerances": ("1 of 2 at 0.1",),
}


def test_results_follow_the_schema_and_come_back_as_they_were(folder: Path) -> None:
    text = (folder / "results.json").read_text()
    jsonschema.validate(json.loads(text), json.loads((SCHEMAS / "results.schema.json").read_text()))
    assert Results.model_validate_json(text).model_dump_json() + "\n" == text


@pytest.mark.parametrize("name", [name for name in EXPECTED if name != "tolerances"])
def test_every_table_has_its_rows_in_every_format(folder: Path, content: Content, name: str) -> None:
    cells = [
        cell.text.replace("\N{NARROW NO-BREAK SPACE}", " ") for row in content.tables[name].rows for cell in row.cells
    ]
    page = (folder / "index.html").read_text().replace("\N{NARROW NO-BREAK SPACE}", " ")
    paper = "".join("".join(part.extract_text() for part in PdfReader(folder / "report.pdf").pages).split())
    for text in EXPECTED[name]:
        assert any(text in cell for cell in cells), (text, cells)
        assert text in page
        assert "".join(text.split()).replace("-", "") in paper.replace("-", "").replace("\N{HYPHEN}", "")
    assert len((folder / "tables" / f"{name}.csv").read_text().splitlines()) == 1 + len(content.tables[name].rows)


def test_verdicts_are_those_of_their_own_rows(content: Content) -> None:
    outcomes = {name: [row.cells[-1].text for row in content.tables[name].rows] for name in ("hard_cases", "analytic")}
    assert sorted(outcomes["hard_cases"]) == ["FAIL", "PASS"]
    assert content.tables["hard_cases"].rows[0].cells[0].text == "One millimetre", "broken claims first"
    verdicts = [cell.text for cell in content.tables["analytic"].rows[0].cells if cell.kind == "verdict"]
    assert verdicts == ["PASS", "PASS"], "1.5 % and 0.2 %, both within the rule for the cube"
    checks = [cell.text for row in content.tables["crosscheck"].rows for cell in row.cells if cell.kind == "verdict"]
    assert checks == ["FAIL", "PASS"]
    assert content.tables["baseline"].rows[0].cells[0].text == "FAIL"


def test_speed_against_error_is_drawn_and_says_where_it_is_from(content: Content) -> None:
    drawing = content.drawings["speed_error"]
    assert "mean pixel error against time" in drawing.caption
    assert "abcdef012345" in drawing.source and drawing.svg.startswith("<svg")


def test_what_is_there_is_not_said_to_be_missing(content: Content) -> None:
    assert {part.part for part in content.absent} >= {"Figure 13 of the paper", "A day relit"}
    assert not {part.part for part in content.absent} & {content.tables[name].title for name in EXPECTED}

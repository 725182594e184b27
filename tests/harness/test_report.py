"""The report from end to end with fake renderers: one offline page, one JSON file, from the same numbers."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from report_project import FakeEngine, make_project, render_references

from transom.figures import DIFFERENCE_SCALE, TimingBar, false_colour_png, luminance_scale, scale_svg, timings_svg
from transom.images import tone_mapped
from transom.report.build import write_report
from transom.report.numbers import fixed, rounded, seconds, signed
from transom.report.results import SCHEMAS, Results, schema_texts
from transom.timing import Timing, write_timings


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    return make_project(tmp_path, monkeypatch)


class PageReader(HTMLParser):
    """Collects what a browser would load, and checks that tags close."""

    def __init__(self) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.images_without_alt = 0
        self.anchors: set[str] = set()
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag in ("link", "iframe", "object") or (tag == "script" and "src" in values):
            self.sources.append(tag)
        if tag == "img":
            self.sources.append(str(values["src"]))
            self.images_without_alt += not values.get("alt")
        if "id" in values:
            self.anchors.add(str(values["id"]))
        if tag == "a":
            self.links.append(str(values["href"]))


def test_report_is_one_offline_page_with_every_picture_in_it(project: Path) -> None:
    render_references()
    assert write_report(project / "report", project / "build") == 0
    page = (project / "report" / "index.html").read_text()
    reader = PageReader()
    reader.feed(page)
    assert len(reader.sources) == 3 + 2 + 6 + 1, "a viewer, a moment, a strip, the lobes of a product"
    assert all(re.match("data:image/webp;base64,", source) for source in reader.sources)
    assert reader.images_without_alt == 0
    assert all(link.removeprefix("#") in reader.anchors for link in reader.links)
    assert not re.search(r"(src|href)\s*=\s*[\"']?https?:|url\(\s*[\"']?https?:|@import", page)
    assert "PASS" in page and "1.0" in page


def test_results_are_in_their_schema_and_carry_the_required_fields(project: Path) -> None:
    render_references()
    write_report(project / "report", project / "build")
    text = (project / "report" / "results.json").read_text()
    results = Results.model_validate_json(text)
    assert results.timings[0].quantity == "solve"
    plain = json.loads(text)
    required = {
        "scene",
        "view",
        "region",
        "condition",
        "method",
        "mean_relative_error_percent",
        "bias_percent",
        "reference_standard_error_percent",
        "engine_mean_cd_m2",
        "reference_mean_cd_m2",
    }
    assert all(required <= row.keys() for row in plain["images"])
    assert {row["region"] for row in plain["images"]} == {"interior", "floor", "exterior"}
    assert {row["method"] for row in plain["images"]} == {"volumes", "rays"}
    interior = [row for row in plain["images"] if row["region"] == "interior"]
    assert all(row["bias_verdict"] == "PASS" for row in interior)
    assert all(row["bias_percent"] == pytest.approx(1.0, abs=1.0) for row in interior)
    assert [row["verdict"] for row in plain["sensors"]] == ["PASS", "PASS"]


def test_schemas_in_the_repository_are_those_that_the_files_follow() -> None:
    for name, text in schema_texts().items():
        assert (SCHEMAS / name).read_text() == text, "write them anew: transom.report.results.write_schemas()"


def test_missing_references_are_verdicts_and_exit_code_4(project: Path) -> None:
    assert write_report(project / "report", project / "build") == 4
    plain = json.loads((project / "report" / "results.json").read_text())
    assert {verdict["outcome"] for verdict in plain["verdicts"]} >= {"NO_REFERENCE"}
    assert "transom run references" in (project / "report" / "index.html").read_text()


def test_crash_is_a_verdict_and_the_other_cases_still_count(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    render_references()
    monkeypatch.setattr(FakeEngine, "crashes", True)
    assert write_report(project / "report", project / "build") == 4
    plain = json.loads((project / "report" / "results.json").read_text())
    crashed = [verdict for verdict in plain["verdicts"] if verdict["outcome"] == "CRASHED"]
    assert "asked to crash" in crashed[0]["reason"]
    assert plain["sensors"], "sensors did not crash"


def test_wrong_engine_fails(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    render_references()
    monkeypatch.setattr(FakeEngine, "error", 0.12)
    assert write_report(project / "report", project / "build") == 1


def test_changed_tolerance_judges_again_without_rendering(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from transom.judge import exit_code
    from transom.workflow import judge_compared

    render_references()
    write_report(project / "report", project / "build")
    monkeypatch.setattr(FakeEngine, "crashes", True)
    path = project / "scenes" / "tolerances.toml"
    path.write_text(path.read_text().replace("tolerance = 3.0", "tolerance = 0.001"))
    assert exit_code(judge_compared("rooms", project / "build")) in (1, 3)


def test_report_without_rendering_uses_the_timings_that_are_there(project: Path) -> None:
    render_references()
    write_report(project / "report", project / "build")
    timings = [Timing("small", "solve", "s", 7.0, 7.0, 7.0, 1, 2, 40)]
    write_timings(project / "build" / "runs" / "timings.json", timings)
    write_report(project / "report", project / "build", render=False)
    assert json.loads((project / "report" / "results.json").read_text())["timings"][0]["median"] == 7.0


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"), [(916.4049, 0.03, "916.40"), (916.4049, 0.3, "916.4"), (916.4, 4, "916")]
)
def test_values_are_rounded_to_their_uncertainty(value: float, uncertainty: float, text: str) -> None:
    assert rounded(value, uncertainty) == text


def test_numbers_as_text() -> None:
    assert fixed(None) == fixed(float("nan")) == "–"
    assert fixed(-0.04, 1) == "0.0"
    assert signed(-1.26, 1) == "\N{MINUS SIGN}1.3"
    assert signed(1.26, 1) == "+1.3"
    assert seconds(0.01234).startswith("12.3")
    assert seconds(0.01234).endswith("ms")
    assert seconds(61.7).startswith("61.7")


def test_tone_mapping_has_a_fixed_scale() -> None:
    grey_levels = tone_mapped(np.array([[[0.0] * 3, [500.0] * 3, [1000.0] * 3, [9000.0] * 3]]), 1000.0)
    assert grey_levels[0, :, 0].tolist() == [0, 188, 255, 255], "half of white is 188 in sRGB"


def test_equal_values_have_equal_colours_in_different_pictures() -> None:
    first = false_colour_png(np.array([[10.0, 100.0, 1000.0]]), luminance_scale(1000.0))
    second = false_colour_png(np.array([[10.0, 100.0, 1000.0]]), luminance_scale(1000.0))
    assert first == second
    position = DIFFERENCE_SCALE.position(np.array([-50.0, 0.0, 50.0, np.nan]))
    np.testing.assert_array_equal(position, [0.0, 0.5, 1.0, np.nan])


def test_scales_and_timings_are_svg_with_units() -> None:
    assert "luminance [cd/m²]" in scale_svg(luminance_scale(1000.0))
    text = timings_svg([TimingBar("room: relight", 1e-3, 2e-3, (1.0, 3.0))])
    assert text.startswith("<svg") and "time [s]" in text

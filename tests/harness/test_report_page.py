"""The page in headless Chromium: it works offline and by keyboard alone, can be read, and says no wrong number."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium import Browser, find_chromium
from report_project import make_project, render_references

from transom import visible
from transom.colour import luminance
from transom.figures import DIFFERENCE_SCALE, palette
from transom.products import load_product
from transom.report.build import write_report
from transom.report.pictures import difference_and_noise, find_pictures
from transom.report.viewer import log_codes, log_values
from transom.suite import load_suite

BINARY = find_chromium()
needs_chromium = pytest.mark.skipif(
    BINARY is None, reason="no Chromium here (apt-get install chromium, or set CHROMIUM): the page is not looked at"
)

VIEWER = "[...viewers.values()][0]"
PROBE = (
    "Object.fromEntries([...document.querySelectorAll('.viewer [data-probe]')]"
    ".map(element => [element.dataset.probe, element.textContent]))"
)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A report of the small project, whose references are rendered."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        root = tmp_path_factory.mktemp("page")
        monkeypatch.setenv("TRANSOM_CACHE", str(root / "cache"))
        monkeypatch.setenv("TRANSOM_REFERENCES", str(root / "references"))
        project = make_project(root, monkeypatch, sky="clear")
        render_references()
        write_report(project / "report", project / "build")
        yield project / "report"


@pytest.fixture
def browser(report: Path, tmp_path: Path) -> Iterator[Browser]:
    assert BINARY is not None
    with Browser(BINARY, tmp_path / "profile") as opened:
        opened.open(report / "index.html")
        opened.run("document.querySelector('.viewer').scrollIntoView()")
        opened.wait(f"viewers.size > 0 && !{VIEWER}.live.hidden")
        yield opened


def test_codes_keep_values_to_a_part_in_five_thousand() -> None:
    values = np.array([0.0, 0.01, 1.0, 813.7, 2e4, 1e6, np.nan])
    back = log_values(log_codes(values))
    np.testing.assert_allclose(back, values, rtol=2e-4)
    assert back[0] == 0.0 and np.isnan(back[-1])


@needs_chromium
def test_page_loads_nothing_and_raises_no_error(browser: Browser) -> None:
    foreign = [url for url in browser.requests if not url.startswith(("file:", "data:", "blob:"))]
    assert foreign == []
    assert browser.errors == []


@needs_chromium
def test_probe_says_what_the_runs_hold(browser: Browser, report: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRANSOM_CACHE", str(report.parent / "cache"))
    monkeypatch.setenv("TRANSOM_REFERENCES", str(report.parent / "references"))
    suite = load_suite("rooms")
    entry, view = suite.cases[0], suite.cases[0].views[0]
    found = find_pictures(entry, view)
    assert found.volumes is not None and found.reference is not None
    ours, truth = found.volumes.image(), found.reference.image()
    difference, _, _ = difference_and_noise(ours, truth, visible.first_surfaces(entry.scene, view))
    column, row = 3, 5
    browser.run(f"{VIEWER}.setProbe([{column}, {row}])")
    index = row * view.width + column
    value = browser.run(f"{VIEWER}.pixels.ours.luminance[{index}]")
    assert value == pytest.approx(float(luminance(ours.mean)[row, column]), rel=3e-4)
    value = browser.run(f"{VIEWER}.pixels.difference[{index}]")
    assert value == pytest.approx(difference[row, column], abs=0.05)
    lux = browser.run(f"{VIEWER}.pixels.ours.illuminance[{index}]")
    assert lux == pytest.approx(np.pi * float(luminance(ours.mean)[row, column]) / 0.5, rel=1e-3)
    texts = browser.run(PROBE)
    assert texts["pixel"] == "3, 5"
    assert texts["ours"].endswith("cd/m²") and texts["oursLux"].endswith("lx")
    printed = float(texts["difference"].removesuffix("%").strip().replace("−", "-"))
    assert printed == pytest.approx(difference[row, column], abs=0.1)
    browser.run(f"{VIEWER}.setProbe([3, 0])")
    assert browser.run(PROBE)["oursLux"] == "n/a", "the first row sees no surface"


@needs_chromium
def test_false_colour_is_that_of_the_printed_scale(browser: Browser) -> None:
    values = np.array([-30.0, -10.0, -2.5, 0.0, 4.0, 10.0])
    colours = browser.run(
        f"[...falseColour({values.tolist()}, 6, 1, SHARED.difference).getContext('2d').getImageData(0, 0, 6, 1).data]"
    )
    places = np.round(DIFFERENCE_SCALE.position(values) * 254).astype(int)
    np.testing.assert_array_equal(np.reshape(colours, (6, 4))[:, :3], palette(DIFFERENCE_SCALE)[places])


@needs_chromium
def test_viewer_works_by_keyboard_alone(browser: Browser) -> None:
    browser.run("document.querySelector('.viewer .live').focus()")
    divider = "document.querySelector('.viewer .divider input').value"
    for key, value in (("1", "100"), ("2", "0"), ("ArrowRight", "2"), ("Escape", "50"), ("ArrowLeft", "48")):
        browser.press(key)
        assert browser.run(divider) == value, key
    for key, side, name in (("n", "right", "noise"), ("d", "right", "difference"), ("e", "left", "illuminance")):
        browser.press(key)
        assert browser.run(f"{VIEWER}.{side}") == name
        legend = f"document.querySelector('.viewer .legend[data-scale={name}]').hidden"
        assert browser.run(legend) is False, "the printed scale follows"
    browser.press("ArrowDown", shift=True)
    assert browser.run(PROBE)["pixel"] == "6, 5"
    browser.press("+")
    assert browser.run("document.querySelector('.viewer [data-zoom=level]').textContent") == "2×"
    windows = browser.run(f"[{VIEWER}.window(), {VIEWER}.window()]")
    assert windows[0][2] == 6.0, "half of the picture, in both panes"
    browser.press("Escape")
    assert browser.run(f"{VIEWER}.zoom") == 0


@needs_chromium
def test_flip_shows_the_reference_in_the_left_pane(browser: Browser) -> None:
    pixel = "[...document.querySelector('[data-pane=left]').getContext('2d').getImageData(90, 90, 1, 1).data]"
    browser.run("document.querySelector('.viewer .live').focus()")
    browser.run(f"{VIEWER}.pixels.reference.luminance.fill(5000)")
    browser.press("l")
    browser.press("1")
    ours = browser.run(pixel)
    browser.press("2")
    assert browser.run(pixel) != ours


@needs_chromium
def test_everything_can_be_reached_by_tabbing_and_has_a_name(browser: Browser) -> None:
    browser.run("document.activeElement.blur(); window.scrollTo(0, 0)")
    seen = set()
    for _ in range(120):
        browser.press("Tab")
        seen.add(browser.run("document.activeElement.tagName + ' ' + (document.activeElement.className || '')"))
    assert seen >= {"A skip", "A cell pass", "DIV live", "SUMMARY ", "INPUT ", "SELECT ", "BUTTON "}
    unnamed = browser.run(
        "[...document.querySelectorAll('button, input, select')].filter(e => !(e.labels?.[0]?.textContent.trim() || "
        "e.textContent.trim() || e.ariaLabel)).length"
    )
    assert unnamed == 0
    assert browser.run("[...document.images].filter(e => !e.alt).length") == 0


@needs_chromium
def test_day_plays_when_asked_to_and_can_be_stopped(browser: Browser) -> None:
    visible_frame = (
        "[...document.querySelectorAll('.day .frames img')].filter(e => !e.hidden).map(e => e.dataset.label)"
    )
    browser.prefer("prefers-reduced-motion", "reduce")
    browser.call("Page.reload")
    browser.wait("document.readyState === 'complete' && !!document.querySelector('.day.ready')")
    browser.run("document.querySelector('.day').scrollIntoView()")
    assert browser.run(visible_frame) == ["12:00"]
    assert browser.run("document.querySelector('.day button').textContent") == "Play", "reduced motion is respected"
    browser.run("document.querySelector('.day input').focus()")
    browser.press("ArrowRight")
    assert browser.run(visible_frame) == ["13:00"]
    browser.run("document.querySelector('.day button').focus()")
    browser.press("Enter")
    browser.wait(f"{visible_frame}[0] === '15:00'")
    browser.press("Escape")
    assert browser.run("document.querySelector('.day button').getAttribute('aria-pressed')") == "false"


@needs_chromium
def test_filters_leave_the_rows_that_fit(browser: Browser) -> None:
    browser.run("filterForm.elements.text.value = 'sensors'; filterForm.dispatchEvent(new Event('input'))")
    shown = browser.run("verdictRows.filter(row => !row.element.hidden).map(row => row.element.textContent)")
    assert len(shown) == 2 and all("Sensors" in text for text in shown)
    browser.run("document.querySelector('.matrix a.cell').click()")
    browser.wait("!document.getElementById(location.hash.slice(1)).hidden")


@needs_chromium
def test_text_has_the_contrast_that_wcag_asks_for(browser: Browser) -> None:
    """Success criterion 1.4.3 of WCAG 2.2: 4.5 to 1 for text, on the page's own backgrounds."""
    poor = browser.run(
        """(() => {
          const shade = (text) => {
            const [r, g, b] = text.match(/[\\d.]+/g).map(Number);
            const linear = [r, g, b].map((v) => ((v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
            return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
          };
          const ground = (element) => {
            for (let e = element; e; e = e.parentElement) {
              const colour = getComputedStyle(e).backgroundColor;
              if (!/, 0\\)$|transparent/.test(colour)) return colour;
            }
            return "rgb(255, 255, 255)";
          };
          const found = new Set();
          for (const element of document.querySelectorAll("body *")) {
            const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
            if (!own || !element.checkVisibility()) continue;
            if (element.closest("svg, script, style, .tag, .hidden, .skip")) continue;
            const [a, b] = [shade(getComputedStyle(element).color), shade(ground(element))].sort((x, y) => y - x);
            if ((a + 0.05) / (b + 0.05) < 4.5) found.add(element.tagName + "." + element.className);
          }
          return [...found];
        })()"""
    )
    assert [name for name in poor if name != "SPAN.none"] == []


@needs_chromium
def test_page_fits_a_narrow_window(browser: Browser) -> None:
    browser.resize(420, 900)
    assert browser.run("document.documentElement.scrollWidth") <= 420


PRISM = "document.querySelector('.prism')"


def set_prism(browser: Browser, **values: float) -> list[tuple[float, float]]:
    """Moves the sliders of the prism figure; the exits that it found, (degrees upwards, share)."""
    for name, value in values.items():
        place = f"{PRISM}.querySelector('input[name={name}]')"
        browser.run(f"{place}.value = {value}; {place}.dispatchEvent(new Event('input'))")
    exits = browser.run(f"JSON.parse({PRISM}.dataset.exits)")
    return [(exit_["angle"], exit_["share"]) for exit_ in exits]


@needs_chromium
@pytest.mark.parametrize(
    ("profile", "low", "high"), [(40, 42, 5), (48, 42, 70), (25, 30, 60), (10, 42, 5), (50, 60, 60), (60, 10, 80)]
)
def test_prism_figure_sends_light_where_the_tracer_does(browser: Browser, profile: int, low: int, high: int) -> None:
    found = set_prism(browser, profile=profile, angle_low=low, angle_high=high)
    product = load_product("prismatic_panel").with_parameters({"angle_low": low, "angle_high": high})
    sun = np.radians(profile)
    traced = product.section().trace([0.0, -np.sin(sun), np.cos(sun)], 4096)
    angles = np.degrees(np.arctan2(traced.transmitted.directions[:, 1], traced.transmitted.directions[:, 2]))
    for angle, share in [entry for entry in found if entry[1] > 0.01]:
        near = np.abs(angles - angle) < 0.1
        assert traced.transmitted.flux[near].sum() == pytest.approx(share, abs=0.003), angle
    assert sum(share for _, share in found) == pytest.approx(traced.transmitted.total, abs=0.003)
    reflected = float(browser.run(f"{PRISM}.dataset.reflected"))
    assert reflected == pytest.approx(traced.reflected.total, abs=0.003)


@needs_chromium
def test_prism_figure_prints_what_it_found(browser: Browser) -> None:
    (angle, share), *_ = set_prism(browser, profile=40, angle_low=42, angle_high=5)
    first = browser.run(f"[...{PRISM}.querySelectorAll('tbody tr:first-child td')].map(cell => cell.textContent)")
    assert first == [f"{abs(angle):.1f}° down", f"{100 * share:.1f} %"]
    assert browser.run(f"{PRISM}.querySelectorAll('svg line').length") > 20


@needs_chromium
def test_prism_figure_works_by_keyboard_and_can_be_reset(browser: Browser) -> None:
    slider = f"{PRISM}.querySelector('input[name=angle_high]')"
    browser.run(f"{slider}.focus()")
    before = browser.run(f"{PRISM}.dataset.exits")
    browser.press("ArrowRight")
    assert browser.run(f"{slider}.value") == "6"
    assert browser.run(f"{slider}.getAttribute('aria-valuetext')") == "6 degrees"
    assert browser.run(f"{PRISM}.dataset.exits") != before
    browser.run(f"{PRISM}.querySelector('button').focus()")
    browser.press("Enter")
    assert browser.run(f"{slider}.value") == "5"
    assert browser.run(f"{PRISM}.dataset.exits") == before


@needs_chromium
def test_prism_figure_takes_the_sun_of_a_condition(browser: Browser) -> None:
    choice = f"{PRISM}.querySelector('select')"
    browser.run(f"{choice}.selectedIndex = 1; {choice}.dispatchEvent(new Event('change'))")
    profile = float(browser.run(f"{choice}.value"))
    assert float(browser.run(f"{PRISM}.querySelector('input[name=profile]').value")) == pytest.approx(profile, abs=0.5)

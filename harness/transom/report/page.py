"""The page: gathers tables and pictures, and fills the template. One file, nothing loaded from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from transom.errors import InputError
from transom.figures import (
    DIFFERENCE_SCALE,
    ILLUMINANCE_SCALE,
    LUMINANCE_SCALE,
    NOISE_SCALE,
    TimingBar,
    scale_svg,
    timings_svg,
)
from transom.files import write_atomic
from transom.judge import Outcome
from transom.report import rows as tables
from transom.report.numbers import fixed, seconds, signed, words
from transom.report.pictures import (
    Picture,
    comparison_pictures,
    factoring_pictures,
    find_pictures,
    toned_picture,
)
from transom.report.results import Results
from transom.report.rows import HEADLINE_METHOD, PAPER_RANGES_S, TIMING_WORDS, TableRow
from transom.suite import Suite, SuiteCase

TEMPLATES = Path(__file__).resolve().parents[3] / "reports" / "templates"


@dataclass(frozen=True)
class Figure:
    """One of the numbers at the top."""

    value: str
    label: str
    note: str


@dataclass(frozen=True)
class ViewSection:
    """One view in one condition."""

    anchor: str
    title: str
    condition: str
    pictures: list[Picture]
    rows: list[TableRow]


@dataclass(frozen=True)
class RoomSection:
    """One scene of a suite shown view by view."""

    title: str
    description: str
    views: list[ViewSection]


@dataclass(frozen=True)
class HourCell:
    """One moment of the grid: ours, the reference's, and the mean relative error in words."""

    ours: Picture | None
    reference: Picture | None
    error: str


@dataclass(frozen=True)
class HourGrid:
    """Figure 12: dates down, hours across; cells[date][hour], None where nothing was asked."""

    title: str
    white: str
    hours: list[str]
    days: list[tuple[str, list[HourCell | None]]]


@dataclass(frozen=True)
class Strip:
    """Figure 5 for one view."""

    title: str
    white: str
    pictures: list[Picture]


def write_page(path: Path, suites: Sequence[Suite], results: Results) -> None:
    """Writes the page. Raises InputError where the templates are missing (outside the project's own checkout)."""
    if not TEMPLATES.is_dir():
        raise InputError("does not exist", file=TEMPLATES, remedy="Run the report from a checkout of the project")
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["svg"] = _safe
    page = environment.get_template("report.html").render(
        results=results,
        headline=_headline(results),
        table_1=tables.table_1(_view_images(suites, results)),
        verdict_counts=_verdict_counts(results),
        open_verdicts=tables.verdict_rows(results.verdicts),
        rooms=[room for suite in suites if _shows_views(suite) for room in _rooms(suite, results)],
        sensors=tables.sensor_rows(results.sensors),
        timings=tables.timing_rows(results.timings),
        timing_figure=timings_svg(_timing_bars(results)) if results.timings else "",
        hours=[grid for suite in suites if suite.layout == "hours" for grid in _hour_grids(suite, results)],
        factoring=[strip for suite in suites if _shows_views(suite) for strip in _strips(suite)],
        analytic=tables.analytic_rows(results.analytic),
        agreements=tables.agreement_rows(results.agreements),
        scales={scale.quantity: scale_svg(scale) for scale in _SCALES},
        provenance=_provenance(results),
        bundles=_bundle_rows(results),
    )
    write_atomic(path, page)


_SCALES = (LUMINANCE_SCALE, ILLUMINANCE_SCALE, DIFFERENCE_SCALE, NOISE_SCALE)


def _safe(text: str) -> str:
    """Our own SVG goes into the page as it is."""
    import markupsafe

    return markupsafe.Markup(text)


def _shows_views(suite: Suite) -> bool:
    return suite.layout == "views" and suite.reference == "mitsuba"


def _view_images(suites: Sequence[Suite], results: Results) -> list[Any]:
    names = {suite.name for suite in suites if _shows_views(suite)}
    return [row for row in results.images if row.suite in names]  # type: ignore[attr-defined]


def _headline(results: Results) -> list[Figure]:
    """Worst and median of what the page is about."""
    figures: list[Figure] = []
    rows: list[Any] = [
        row
        for row in results.images
        if row.region == "interior" and row.method == HEADLINE_METHOD  # type: ignore[attr-defined]
    ]
    if rows:
        errors, biases = [row.mean_relative_error_percent for row in rows], [row.bias_percent for row in rows]
        figures.append(
            Figure(
                f"{fixed(max(errors), 1)} %",
                "largest mean pixel error of a view",
                f"median over {len(rows)} views {fixed(float(np.median(errors)), 1)} %; the paper 7.4 to 8.8 %",
            )
        )
        figures.append(
            Figure(
                f"{signed(max(biases, key=abs), 1)} %",
                "largest bias of a view's mean luminance",
                f"median of sizes {fixed(float(np.median(np.abs(biases))), 1)} %; the paper −5.9 to −12.5 %",
            )
        )
    sensors: list[Any] = list(results.sensors)
    if sensors:
        sizes = [abs(row.error_percent) for row in sensors]
        figures.append(
            Figure(
                f"{fixed(float(np.percentile(sizes, 95)), 1)} %",
                "error of illuminance, 95 % of sensors within",
                f"median {fixed(float(np.median(sizes)), 2)} %, worst {fixed(max(sizes), 1)} % of {len(sizes)} sensors",
            )
        )
    relights = [timing for timing in results.timings if timing.quantity == "relight"]
    if relights:
        slowest = max(relights, key=lambda timing: timing.median)
        solve = max(timing.median for timing in results.timings if timing.quantity == "solve")
        note = f"slowest room, median of {slowest.count}; solve {seconds(solve)}; the paper 1 to 3 s and 10 s"
        figures.append(Figure(seconds(slowest.median), "to relight a room", note))
    return figures


def _verdict_counts(results: Results) -> list[tuple[str, int]]:
    found = [(str(outcome), sum(entry.outcome is outcome for entry in results.verdicts)) for outcome in Outcome]
    return [(name, count) for name, count in found if count]


def _rooms(suite: Suite, results: Results) -> list[RoomSection]:
    rooms: dict[str, RoomSection] = {}
    for entry in suite.cases:
        scene = entry.scene
        room = rooms.setdefault(scene.name, RoomSection(scene.title, scene.description, []))
        for view in entry.views:
            found = find_pictures(entry, view)
            images = [row for row in results.images if _is_row_of(row, suite, entry, view.name)]
            room.views.append(
                ViewSection(
                    anchor=f"{scene.name}-{view.name}-{entry.condition.name}",
                    title=words(view.name),
                    condition=condition_words(entry),
                    pictures=comparison_pictures(entry, view, found),
                    rows=tables.region_rows(images),
                )
            )
    return list(rooms.values())


def condition_words(entry: SuiteCase) -> str:
    """The condition in one line: moment, sky, levels and sun."""
    condition = entry.condition
    moment = datetime.fromisoformat(condition.spec.time)
    parts = [f"{moment.day} {moment:%B}, {moment:%H:%M}", entry.scene.site.name, f"sky {condition.spec.sky}"]
    parts.append(f"diffuse horizontal {fixed(condition.diffuse_horizontal_lx, 0)} lx")
    if condition.sun_direction is not None:
        altitude = float(np.degrees(np.arcsin(condition.sun_direction[2])))
        parts.append(f"sun {fixed(condition.direct_normal_lx, 0)} lx at {fixed(altitude, 0)}° altitude")
    else:
        parts.append("no sun")
    return "; ".join(parts)


def _hour_grids(suite: Suite, results: Results) -> list[HourGrid]:
    grids: list[HourGrid] = []
    for scene_name in dict.fromkeys(entry.scene.name for entry in suite.cases):
        entries = [entry for entry in suite.cases if entry.scene.name == scene_name]
        for view in entries[0].views:
            cells: dict[tuple[str, str], HourCell] = {}
            for entry in entries:
                found = find_pictures(entry, view)
                errors = [
                    row.mean_relative_error_percent  # type: ignore[attr-defined]
                    for row in results.images
                    if _is_row_of(row, suite, entry, view.name)
                    and row.region == "interior"  # type: ignore[attr-defined]
                    and row.method == HEADLINE_METHOD  # type: ignore[attr-defined]
                ]
                cells[_day_and_hour(entry)] = HourCell(
                    toned_picture("Transom", found.volumes, view) if found.volumes else None,
                    toned_picture("Mitsuba 3", found.reference, view) if found.reference else None,
                    f"{fixed(errors[0], 1)} %" if errors else "",
                )
            days = list(dict.fromkeys(day for day, _ in cells))
            hours = sorted({hour for _, hour in cells})
            grid = [(day, [cells.get((day, hour)) for hour in hours]) for day in days]
            white = f"{fixed(view.display_white_cd_m2, 0)} cd/m²"
            grids.append(HourGrid(f"{entries[0].scene.title}, view {words(view.name)}", white, hours, grid))
    return grids


def _day_and_hour(entry: SuiteCase) -> tuple[str, str]:
    moment = datetime.fromisoformat(entry.condition.spec.time)
    sky = "" if entry.condition.sun_direction is not None else " (no sun)"
    return f"{moment.day} {moment:%B}{sky}", f"{moment:%H:%M}"


def _strips(suite: Suite) -> list[Strip]:
    strips = []
    for scene_name in dict.fromkeys(entry.scene.name for entry in suite.cases):
        entry = next(case for case in suite.cases if case.scene.name == scene_name)
        view = entry.views[0]
        pictures = factoring_pictures(view, find_pictures(entry, view))
        white = f"{fixed(view.display_white_cd_m2, 0)} cd/m²"
        if pictures:
            strips.append(Strip(f"{entry.scene.title}, view {words(view.name)}", white, pictures))
    return strips


def _timing_bars(results: Results) -> list[TimingBar]:
    return [
        TimingBar(
            f"{words(timing.scene)}: {TIMING_WORDS[timing.quantity].split(' (')[0].lower()}",
            timing.median,
            timing.p95,
            PAPER_RANGES_S.get(timing.quantity),
        )
        for timing in results.timings
        if timing.unit == "s"
    ]


def _is_row_of(row: Any, suite: Suite, entry: SuiteCase, view: str) -> bool:
    place = (suite.name, entry.scene.name, entry.condition.name, view)
    return (row.suite, row.scene, row.condition, row.view) == place


def _provenance(results: Results) -> list[tuple[str, str]]:
    found = results.provenance
    return [
        ("Created", f"{results.created:%Y-%m-%d %H:%M} UTC"),
        ("Source", found.commit or "not in a repository"),
        ("Machine", f"{found.processor}, {found.logical_cores} logical cores, {found.memory_gib} GiB"),
        ("System", found.system),
        ("Python", found.python),
        ("Packages", ", ".join(f"{name} {version}" for name, version in found.packages.items())),
    ]


def _bundle_rows(results: Results) -> list[tuple[str, str, str]]:
    """Which run each compared case comes from: what, our key, the reference's key."""
    found: dict[tuple[str, str, str], None] = {}
    for row in [*results.images, *results.sensors]:
        case: Any = row
        place = getattr(case, "view", "") or "sensors"
        label = f"{case.scene} / {place} / {case.condition} / {case.method}"
        found[(label, case.engine_key[:12], case.reference_key[:12])] = None
    return list(found)

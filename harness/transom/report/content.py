"""Everything that a report says, gathered once: HTML, PDF, CSV and JSON are written from the same object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from transom.check import Checked
from transom.figures import TimingBar, timings_svg
from transom.judge import ToleranceFile
from transom.report import rows_images, rows_references, rows_speed, rows_verdicts
from transom.report.day import Day
from transom.report.fenestration import Chapter
from transom.report.figure_13 import CornerError, corner_table
from transom.report.notes import NotesSection
from transom.report.numbers import fixed, seconds, signed, words
from transom.report.pictures import Drawing
from transom.report.results import Results
from transom.report.sections import FENESTRATION, HourGrid, RoomSection, Strip, suite_rows
from transom.report.speed import Speed, speed_drawing
from transom.report.table import Table

REPRODUCE = "transom report"


@dataclass(frozen=True)
class Headline:
    """One of the numbers at the top. source: what it is the worst or the median of."""

    value: str
    label: str
    note: str
    source: str


@dataclass(frozen=True)
class Absence:
    """A part that is not in the report, and the command that makes it."""

    part: str
    command: str


@dataclass(frozen=True)
class Pictures:
    """The parts of the report that are pictures."""

    rooms: list[RoomSection]
    hours: list[HourGrid]
    factoring: list[Strip]
    day: Day | None
    figure_13: list[Strip]
    corners: list[CornerError]
    fenestration: Chapter


@dataclass(frozen=True)
class Content:
    """The report. tables: by name, in the order of the page. drawings: by the name of the table that they are of."""

    results: Results
    headline: list[Headline]
    verdict_counts: list[tuple[str, int]]
    matrix: rows_verdicts.Matrix
    tables: dict[str, Table]
    drawings: dict[str, Drawing]
    pictures: Pictures
    notes: list[NotesSection]
    absent: list[Absence]
    provenance: list[tuple[str, str]]


def make_content(
    results: Results,
    images: Sequence[Any],
    pictures: Pictures,
    speed: Speed,
    tolerances: ToleranceFile,
    notes: list[NotesSection],
    checked: Sequence[Checked] = (),
    fenestration: Sequence[Table] = (),
) -> Content:
    """images: rows of the suites that are shown view by view. checked: of `transom check`, where it has run.
    fenestration: tables of that chapter."""
    build = engine_source(results)
    matrix = rows_verdicts.matrix(results)
    tables = [
        rows_verdicts.matrix_table(matrix),
        rows_verdicts.verdict_list(results),
        rows_images.table_1(images),
        rows_images.regions([*images, *suite_rows(results.images, [FENESTRATION])]),
        rows_images.sensors(results.sensors),
        rows_references.crosschecks(results.crosschecks),
        rows_references.model_errors(results.model_errors),
        rows_references.ladder(results.ladder),
        corner_table(pictures.corners),
        rows_references.analytic(results.analytic, results.verdicts),
        rows_references.hard_cases(results.hard_cases),
        rows_speed.use_time(rows_speed.use_times(results.timings, speed.benches, speed.loads_s, build)),
        rows_speed.timings(results.timings, build),
        rows_speed.benches(speed.benches),
        rows_speed.machine_limits(speed.benches),
        rows_speed.speed_error(speed.speed_error),
        rows_speed.speed_ups(speed.speed_error),
        rows_verdicts.baseline(checked),
        rows_images.agreements(results.agreements),
        rows_verdicts.tolerance_use(tolerances, results),
        rows_verdicts.debt(tolerances),
        *fenestration,
    ]
    drawings: dict[str, Drawing] = {}
    if results.timings:
        label = "Median and 95th percentile of each time, logarithmic"
        caption = "Median (dot) and 95th percentile (end of the line). Grey: what the paper reports on its machine."
        drawings["timings"] = Drawing(timings_svg(_timing_bars(results)), caption, label, build)
    if speed.speed_error is not None and speed.speed_error.rows:
        drawings["speed_error"] = speed_drawing(speed.speed_error)
    absent = [Absence(table.title, table.command) for table in tables if not table.rows and table.command]
    if not pictures.figure_13:
        absent.append(Absence("Figure 13 of the paper", "transom run crosscheck"))
    absent += [Absence(order.caption, order.command) for order, plot in pictures.fenestration.plots if plot is None]
    if pictures.day is None:
        absent.append(Absence("A day relit", REPRODUCE))
    absent += [
        Absence(f"Reference of {words(room.title)}, {view.title.lower()}", "transom run references")
        for room in [*pictures.rooms, *pictures.fenestration.rooms]
        for view in room.views
        if view.viewer is None
    ]
    return Content(
        results=results,
        headline=_headline(results),
        verdict_counts=rows_verdicts.outcome_counts(results.verdicts),
        matrix=matrix,
        tables={table.name: table for table in tables},
        drawings=drawings,
        pictures=pictures,
        notes=notes,
        absent=absent,
        provenance=_provenance(results),
    )


def engine_source(results: Results) -> str:
    """The source of timings: the revision and the machine."""
    found = results.provenance
    return f"revision {found.commit or 'unknown'}, {found.processor}, {found.logical_cores} logical cores"


def _headline(results: Results) -> list[Headline]:
    """Worst and median of what the page is about."""
    found: list[Headline] = []
    images: list[Any] = list(results.images)
    rows = [row for row in images if row.region == "interior" and row.method == rows_images.HEADLINE_METHOD]
    if rows:
        errors, biases = [row.mean_relative_error_percent for row in rows], [row.bias_percent for row in rows]
        worst = max(rows, key=lambda row: row.mean_relative_error_percent)
        note = f"median over {len(rows)} views {fixed(float(np.median(errors)), 1)} %; the paper 7.4 to 8.8 %"
        value = f"{fixed(max(errors), 1)} %"
        found.append(Headline(value, "largest mean pixel error of a view", note, worst.origin))
        worst = max(rows, key=lambda row: abs(row.bias_percent))
        note = f"median of sizes {fixed(float(np.median(np.abs(biases))), 1)} %; the paper −5.9 to −12.5 %"
        value = f"{signed(worst.bias_percent, 1)} %"
        found.append(Headline(value, "largest bias of a view's mean luminance", note, worst.origin))
    sensors: list[Any] = list(results.sensors)
    if sensors:
        sizes = [abs(row.error_percent) for row in sensors]
        note = f"median {fixed(float(np.median(sizes)), 2)} %, worst {fixed(max(sizes), 1)} % of {len(sizes)} sensors"
        value = f"{fixed(float(np.percentile(sizes, 95)), 1)} %"
        origin = max(sensors, key=lambda row: abs(row.error_percent)).origin
        found.append(Headline(value, "error of illuminance, 95 % of sensors within", note, origin))
    relights = [timing for timing in results.timings if timing.quantity == "relight"]
    if relights:
        slowest = max(relights, key=lambda timing: timing.median)
        solve = max((timing.median for timing in results.timings if timing.quantity == "solve"), default=float("nan"))
        note = f"slowest room, median of {slowest.count}; solve {seconds(solve)}; the paper 1 to 3 s and 10 s"
        found.append(Headline(seconds(slowest.median), "to relight a room", note, engine_source(results)))
    return found


def _timing_bars(results: Results) -> list[TimingBar]:
    return [
        TimingBar(
            f"{words(timing.scene)}: {rows_speed.timing_words(timing.quantity).split(' (')[0].lower()}",
            timing.median,
            timing.p95,
            rows_speed.PAPER_RANGES_S.get(timing.quantity),
        )
        for timing in results.timings
        if timing.unit == "s"
    ]


def _provenance(results: Results) -> list[tuple[str, str]]:
    found = results.provenance
    return [
        ("Created", f"{results.created:%Y-%m-%d %H:%M} UTC"),
        ("Source", found.commit or "not in a repository"),
        ("Machine", f"{found.processor}, {found.logical_cores} logical cores, {found.memory_gib} GiB"),
        ("System", found.system),
        ("Python", found.python),
        ("Packages", ", ".join(f"{name} {version}" for name, version in found.packages.items())),
        ("Comparisons", ", ".join(f"{record.suite} {record.digest}" for record in results.suites)),
    ]

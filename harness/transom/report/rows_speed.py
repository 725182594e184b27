"""Tables of speed: timings beside the paper's, use time beside the heliodon's, and speed at equal error."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from transom.report.numbers import fixed, seconds, words
from transom.report.rows_references import PROGRAM_WORDS
from transom.report.table import Cell, Row, Table, number
from transom.timing import Timing

PAPER_RANGES_S: dict[str, tuple[float, float]] = {
    "solve": (10.0, 10.0),
    "relight": (1.0, 3.0),
    "frame_volumes": (1 / 30, 1 / 30),
    "plot_8x8": (60.0, 180.0),
}
"""Cutler et al. 2008, section 4.3.1, on a 2.13 GHz Core 2 Duo: "approximately 10 seconds", "1-3 seconds", "> 30 frames
per second" and "1-3 minutes"."""

PAPER_WORDS = {
    "solve": "about 10 s",
    "relight": "1 to 3 s",
    "frame_volumes": "above 30 frames per second",
    "plot_8x8": "1 to 3 min",
}

HELIODON_SETUP_S = 86.0
HELIODON_SUN_S = 29.0
HELIODON = "Glaser, Smith & Cutler 2006, as cited by Cutler et al. 2008, section 5"
"""Average times of users at a physical heliodon: to set a model up on the table, and to set a new sun position."""

TIMING_WORDS = {
    "load": "Load the scene",
    "solve": "Solve (geometry and reflectance)",
    "relight": "Relight (a new sun and sky)",
    "relight_hour": "Relight (a new hour)",
    "relight_sky": "Relight (a new sky only)",
    "relight_glazing": "Relight (new glazing)",
    "frame_volumes": "Frame, shadow volumes",
    "frame_rays": "Frame, shadow rays",
    "sensors": "Sensors",
    "plot_8x8": "Plot of 8 x 8 moments",
    "peak_memory": "Peak memory",
}


def timing_words(quantity: str) -> str:
    return TIMING_WORDS.get(quantity, words(quantity))


def timings(entries: Iterable[Timing], source: str) -> Table:
    """Every timing: first, median and p95 of how many, beside the paper's. source: the build and machine."""
    rows = []
    for timing in entries:
        counts = f"{fixed(timing.triangles, 0)} triangles, {fixed(timing.patches, 0)} patches"
        if timing.unit == "s":
            values = [Cell(seconds(value), value) for value in (timing.first, timing.median, timing.p95)]
        else:
            values = [Cell(""), Cell(f"{fixed(timing.median, 0)} {timing.unit}", timing.median), Cell("")]
        label = timing_words(timing.quantity) + (f", {timing.width}×{timing.height}" if timing.width else "")
        cells = (Cell(label), *values, number(timing.count, 0), Cell(PAPER_WORDS.get(timing.quantity, "")))
        rows.append(Row(cells, source, f"{words(timing.scene)}: {counts}"))
    head = ("", "First", "Median", "p95", "Repeats", "Paper (2.13 GHz Core 2 Duo)")
    return Table("timings", "Times of the engine", head, tuple(rows), "transom report")


def use_time(entries: Sequence[Timing], loads_s: dict[str, float], source: str) -> Table:
    """The paper's use-time comparison: a heliodon's set-up against load and solve, its new sun against a relight."""
    rows = [
        Row(
            (
                Cell("Physical heliodon"),
                Cell("model put on the table"),
                Cell(seconds(HELIODON_SETUP_S), HELIODON_SETUP_S),
                Cell(seconds(HELIODON_SUN_S), HELIODON_SUN_S),
                Cell("1"),
                Cell("1"),
            ),
            HELIODON,
        )
    ]
    by_scene: dict[str, dict[str, float]] = {}
    for timing in entries:
        by_scene.setdefault(timing.scene, {})[timing.quantity] = timing.median
    for scene, found in by_scene.items():
        if "solve" not in found or "relight" not in found:
            continue
        load = loads_s.get(scene)
        begin = found["solve"] + (load or 0.0)
        what = "load and solve" if load is not None else "solve (loading not timed)"
        cells = (
            Cell(f"Transom, {words(scene).lower()}"),
            Cell(what),
            Cell(seconds(begin), begin),
            Cell(seconds(found["relight"]), found["relight"]),
            number(HELIODON_SETUP_S / begin, 0),
            number(HELIODON_SUN_S / found["relight"], 0),
        )
        rows.append(Row(cells, source))
    head = ("", "Set-up", "Set-up takes", "A new sun takes", "Set-up, times faster", "New sun, times faster")
    return Table("use_time", "Time in use, beside a heliodon", head, tuple(rows), "transom report")


def speed_error(entries: Iterable[Any], source: str) -> Table:
    """Time and error of each program at each setting."""
    rows = []
    for row in entries:
        median = float(np.median(row.seconds))
        cells = (
            Cell(PROGRAM_WORDS.get(row.program, row.program)),
            Cell(row.setting),
            Cell({"cold": "cold start", "hour": "a new hour"}.get(row.phase, row.phase)),
            Cell(seconds(median), median),
            number(len(row.seconds), 0),
            number(row.error_percent, 2),
            number(row.error_uncertainty_percent, 2),
        )
        rows.append(Row(cells, source, f"{words(row.scene)}, {row.view}, {row.condition}"))
    head = ("Program", "Setting", "Phase", "Time, median", "Repeats", "Mean pixel error [%]", "u [%]")
    return Table("speed_error", "Speed against error", head, tuple(rows), "transom bench --speed-error")


def speed_ups(entries: Iterable[Any], source: str) -> Table:
    """How many times faster the engine is at equal error, with the interval."""
    rows = []
    for row in entries:
        cells = (
            Cell(PROGRAM_WORDS.get(row.program, row.program)),
            Cell({"cold": "cold start", "hour": "a new hour"}.get(row.phase, row.phase)),
            number(row.at_error_percent, 2),
            number(row.ratio, 1),
            Cell(f"{fixed(row.low, 1)} to {fixed(row.high, 1)}"),
        )
        rows.append(Row(cells, source))
    head = ("Against", "Phase", "At mean pixel error [%]", "Times faster", "Interval")
    return Table("speed_ups", "Speed at equal error", head, tuple(rows), "transom bench --speed-error")

"""Tables of speed: timings beside the paper's, use time beside the heliodon's, and speed at equal error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from transom.bench import Bench
from transom.report.numbers import fixed, seconds, words
from transom.report.rows_references import program_words
from transom.report.table import KEY_LENGTH, Cell, Row, Table, number
from transom.speed_error import SpeedError
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

SPEED_ERROR_COMMAND = "transom bench SCENE --speed-error"

PHASE_WORDS = {"cold": "from nothing", "hour": "a further hour"}

TIMING_WORDS = {
    "load": "Load the scene",
    "solve": "Solve (geometry and reflectance)",
    "relight": "Relight (a new sun and sky)",
    "new_product": "New product (traced, and its light)",
    "reglaze": "New glazing (edit and relight)",
    "recolour": "New reflectance (edit and relight)",
    "move_object": "Object moved (edit and relight)",
    "add_object": "Object added (edit and relight)",
    "remove_object": "Object removed (edit and relight)",
    "relight_hour": "Relight (a new hour)",
    "relight_sky": "Relight (a new sky only)",
    "relight_overcast": "Relight (overcast, no beam)",
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


@dataclass(frozen=True)
class UseTime:
    """What a user waits for at one scene [s]: load_s None where it was not timed."""

    scene: str
    load_s: float | None
    solve_s: float
    relight_s: float
    source: str


def use_times(
    entries: Sequence[Timing], benches: Sequence[Bench], loads_s: Mapping[str, float], source: str
) -> list[UseTime]:
    """From the benches where there are any, else from the report's own timings."""
    found: dict[str, UseTime] = {}
    by_scene: dict[str, dict[str, float]] = {}
    for timing in entries:
        by_scene.setdefault(timing.scene, {})[timing.quantity] = timing.median
    for scene, medians in by_scene.items():
        if "solve" in medians and "relight" in medians:
            found[scene] = UseTime(scene, loads_s.get(scene), medians["solve"], medians["relight"], source)
    for bench in benches:
        medians = {entry.quantity: entry.median for entry in bench.measurements if entry.sweep == "default"}
        if {"load", "solve", "relight_hour"} <= medians.keys():
            times = (medians["load"], medians["solve"], medians["relight_hour"])
            found[bench.scene] = UseTime(bench.scene, *times, bench_source(bench))
    return list(found.values())


def use_time(found: Sequence[UseTime]) -> Table:
    """The paper's use-time comparison: a heliodon's set-up against load and solve, its new sun against a relight."""
    rows = [
        Row(
            (
                Cell("Physical heliodon"),
                Cell("model put on the table"),
                Cell(seconds(HELIODON_SETUP_S), HELIODON_SETUP_S),
                Cell(seconds(HELIODON_SUN_S), HELIODON_SUN_S),
                number(1, 0),
                number(1, 0),
            ),
            HELIODON,
        )
    ]
    for times in found:
        begin = times.solve_s + (times.load_s or 0.0)
        cells = (
            Cell(f"Transom, {words(times.scene).lower()}"),
            Cell("load and solve" if times.load_s is not None else "solve (loading not timed)"),
            Cell(seconds(begin), begin),
            Cell(seconds(times.relight_s), times.relight_s),
            number(HELIODON_SETUP_S / begin, 0),
            number(HELIODON_SUN_S / times.relight_s, 0),
        )
        rows.append(Row(cells, times.source))
    head = ("", "Set-up", "Set-up takes", "A new sun takes", "Set-up, times faster", "New sun, times faster")
    return Table("use_time", "Time in use, beside a heliodon", head, tuple(rows), "transom report")


def bench_source(bench: Bench) -> str:
    found = bench.provenance
    return f"engine {bench.engine_build}, {found.processor}, {bench.created:%Y-%m-%d %H:%M}"


def benches(found: Sequence[Bench]) -> Table:
    """Every quantity of every point of the sweeps."""
    rows = []
    for bench in found:
        for entry in bench.measurements:
            values = [Cell(seconds(value), value) for value in (entry.first, entry.median, entry.p95)]
            if entry.unit != "s":
                values = [Cell(""), Cell(f"{fixed(entry.median, 0)} {entry.unit}", entry.median), Cell("")]
            size = f", {entry.width}×{entry.height}" if entry.width else ""
            cells = (
                Cell(timing_words(entry.quantity) + size),
                Cell(entry.sweep),
                number(entry.patches, 0),
                number(entry.openings, 0),
                *values,
                number(len(entry.samples), 0),
            )
            rows.append(Row(cells, bench_source(bench), words(bench.scene)))
    head = ("", "Varied", "Patches", "Panes", "First", "Median", "p95", "Repeats")
    return Table("bench", "Times against patches and openings", head, tuple(rows), "transom bench SCENE")


def machine_limits(found: Sequence[Bench]) -> Table:
    """Phases against what the machine can do: memory bandwidth for products, rays for visibility."""
    rows = [
        Row(
            (
                Cell(entry.phase),
                Cell(entry.counted),
                Cell(f"{fixed(entry.rate / 1e9, 3)} G{entry.unit}", entry.rate),
                Cell(words(entry.limit)),
                number(100 * entry.share, 1),
            ),
            bench_source(bench),
            words(bench.scene),
        )
        for bench in found
        for entry in bench.utilisations
    ]
    head = ("Phase", "Counted", "Rate", "Limit of the machine", "Share of it [%]")
    return Table("machine_limits", "Against the limits of the machine", head, tuple(rows), "transom bench SCENE")


def speed_error(found: SpeedError | None) -> Table:
    """Time and error of each program at each setting; what could not be measured, and why."""
    rows = []
    for row in found.rows if found else ():
        median = float(np.median(row.seconds))
        cells = (
            Cell(program_words(row.program)),
            Cell(row.setting),
            Cell(PHASE_WORDS[row.phase]),
            Cell(seconds(median), median),
            number(len(row.seconds), 0),
            number(row.error_percent, 2),
            number(row.error_uncertainty_percent, 2),
            Cell(row.dominated_by or "–"),
        )
        rows.append(Row(cells, _speed_source(found), f"{words(row.scene)}, {row.view}, {row.condition}"))
    for missing in found.missing if found else ():
        said = (Cell(program_words(missing.program)), Cell(missing.setting), Cell(missing.reason, kind="muted"))
        rows.append(Row((*said, *[Cell("")] * 5), _speed_source(found), "Not measured"))
    head = (
        "Program",
        "Setting",
        "Phase",
        "Time, median",
        "Repeats",
        "Mean pixel error [%]",
        "u [%]",
        "As fast and as right",
    )
    return Table("speed_error", "Speed against error", head, tuple(rows), SPEED_ERROR_COMMAND)


def speed_ups(found: SpeedError | None) -> Table:
    """How many times faster the engine is at equal error, with the interval."""
    rows = []
    for row in found.speed_ups if found else ():
        cells = (
            Cell(program_words(row.program)),
            Cell(PHASE_WORDS[row.phase]),
            number(row.at_error_percent, 2),
            number(row.ratio, 1),
            Cell(f"{fixed(row.low, 1)} to {fixed(row.high, 1)}"),
            Cell(row.kind.replace("_", " ")),
        )
        rows.append(Row(cells, _speed_source(found)))
    head = ("Against", "Phase", "At mean pixel error [%]", "Times faster", "95 % interval", "How it was found")
    return Table("speed_ups", "Speed at equal error", head, tuple(rows), SPEED_ERROR_COMMAND)


def _speed_source(found: SpeedError | None) -> str:
    if found is None:
        return ""
    return f"reference {found.reference_key[:KEY_LENGTH]}, {found.provenance.processor}, {found.created:%Y-%m-%d %H:%M}"

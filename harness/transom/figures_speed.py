"""Figures of speed: error against time with error bars on both axes, and time against patches and by phase."""

from __future__ import annotations

import io
from typing import Any, Literal

import matplotlib as mpl
import numpy as np

from transom.bench import Bench, Measurement
from transom.bench_growth import SWEEPS, Growth
from transom.speed_error import SpeedError

STYLES: dict[str, tuple[str, str]] = {
    "engine": ("#0072b2", "o"),
    "classic": ("#56b4e9", "D"),
    "mitsuba": ("#d55e00", "s"),
    "radiance": ("#009e73", "^"),
}
"""Colour and marker by program; colours of Okabe and Ito (2008), told apart with any colour vision."""

OTHER_STYLE = ("#999999", "v")
_SETTINGS: dict[Any, object] = {"svg.fonttype": "none", "svg.hashsalt": "transom", "font.size": 9}
LEAST_NAMED_PERCENT = 6.0
"""Phases with a smaller share have no words in the figure; every one is in the file."""

COVERAGE = 1.959964
"""Error bars are 95 % intervals."""

PHASES: tuple[tuple[Literal["cold", "hour"], str], ...] = (
    ("cold", "From nothing: load, prepare, render"),
    ("hour", "Each further hour"),
)


SCALING: tuple[tuple[str, str, str, str], ...] = (
    ("solve", "solve", "#0072b2", "o"),
    ("relight_hour", "relight, a new hour", "#d55e00", "s"),
    ("frame_rays", "frame, shadow rays", "#009e73", "^"),
)
PHASE_COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00", "#cc79a7", "#999999", "#f0e442")


def scaling_figure(bench: Bench, file_format: Literal["svg", "png"] = "svg") -> bytes:
    """Left: median time [s] over the number of patches, from fastest to slowest sample. Right: the phases of a solve
    and of a relighting at default settings, as shares of the phases' sum."""
    from matplotlib.figure import Figure

    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        left, right = figure.subplots(1, 2)
        for quantity, label, colour, marker in SCALING:
            rows = [row for row in bench.measurements if row.quantity == quantity and row.sweep != "openings"]
            rows.sort(key=lambda row: row.patches)
            medians = np.array([row.median for row in rows])
            bars = [medians - [min(row.samples) for row in rows], [max(row.samples) for row in rows] - medians]
            patches = [row.patches for row in rows]
            left.errorbar(patches, medians, yerr=bars, color=colour, marker=marker, linewidth=1.0, label=label)
        left.set_xscale("log")
        left.set_yscale("log")
        left.set_xlabel("patches")
        left.set_ylabel("time [s]")
        left.legend(frameon=False)
        rows = [
            row for row in bench.measurements if row.sweep == "default" and row.quantity in ("solve", "relight_hour")
        ]
        for place, row in enumerate(reversed(rows)):
            _phase_bar(right, place, row)
        right.set_yticks(range(len(rows)), [row.quantity.replace("_", " ") for row in reversed(rows)])
        right.set_xlabel("share of the phases' time [%]")
        for axes in (left, right):
            _plain(axes)
        return _saved(figure, file_format)


GROWTH: tuple[tuple[str, str, str, str], ...] = (
    ("load_s", "load", "#999999", "v"),
    ("solve_s", "solve", "#0072b2", "o"),
    ("relight_s", "relight, a new hour", "#d55e00", "s"),
    ("frame_s", "frame, shadow rays", "#009e73", "^"),
)


def growth_figure(found: Growth, file_format: Literal["svg", "png"] = "svg") -> bytes:
    """Time [s], above, and peak memory [MiB], below, over patches, openings and triangles of the growing hall. The
    dotted line grows in proportion."""
    from matplotlib.figure import Figure

    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(9.6, 5.4), layout="constrained")
        panels = figure.subplots(2, 3, sharex="col", sharey="row", height_ratios=(2, 1))
        for column, axis in enumerate(SWEEPS):
            rows = [row for row in found.rows if row.axis == axis]
            size = np.array([getattr(row, axis) for row in rows], dtype=float)
            times, memory = panels[0, column], panels[1, column]
            for field, label, colour, marker in GROWTH:
                seconds = [getattr(row, field) for row in rows]
                times.plot(size, seconds, color=colour, marker=marker, linewidth=1.0, label=label)
            megabytes = np.array([row.peak_memory_mib for row in rows])
            memory.plot(size, megabytes, color="#0072b2", marker="o", linewidth=1.0)
            times.plot(size, rows[0].solve_s * size / size[0], ":", color="#999999", linewidth=0.8)
            memory.set_xlabel(axis)
            for axes in (times, memory):
                axes.set_xscale("log")
                axes.set_yscale("log")
                _plain(axes)
        panels[0, 0].set_ylabel("time [s]")
        panels[1, 0].set_ylabel("peak memory [MiB]")
        panels[0, 0].legend(frameon=False)
        return _saved(figure, file_format)


def speed_error_figure(found: SpeedError, file_format: Literal["svg", "png"] = "svg") -> bytes:
    """Mean relative error [%] against time [s] for each program over its settings, cold and for each further hour.

    Bars: 95 % of the error, and the fastest and slowest sample. Filled points are on the frontier, hollow ones are
    dominated. The dotted line shows what a path tracer gains by waiting: error ~ 1/sqrt(time).
    """
    from matplotlib.figure import Figure

    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(9.6, 4.2), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (phase, title) in zip(panels, PHASES, strict=True):
            _panel(axes, found, phase)
            axes.set_title(title, loc="left", fontsize=10)
            axes.set_xlabel("time [s]")
        panels[0].set_ylabel("mean relative error of the interior's pixels [%]")
        panels[0].legend(frameon=False, loc="best")
        separate_labels(figure)
        return _saved(figure, file_format)


def separate_labels(figure: Any) -> None:
    """Raises each annotation of a figure until it stands on none of the lower ones in its panel."""
    figure.draw_without_rendering()
    points_a_pixel = 72 / figure.dpi
    for axes in figure.axes:
        placed: list[Any] = []
        for label in sorted(axes.texts, key=lambda text: text.get_window_extent().y0):
            box = label.get_window_extent()
            while any(box.overlaps(other) for other in placed):
                step = 0.25 * box.height
                label.xyann = (label.xyann[0], label.xyann[1] + step * points_a_pixel)
                box = box.translated(0, step)
            placed.append(box)


def _panel(axes: Any, found: SpeedError, phase: Literal["cold", "hour"]) -> None:
    rows = [row for row in found.rows if row.phase == phase]
    for program in dict.fromkeys(row.program for row in rows):
        colour, marker = STYLES.get(program, OTHER_STYLE)
        own = sorted((row for row in rows if row.program == program), key=lambda row: np.median(row.seconds))
        medians = [float(np.median(row.seconds)) for row in own]
        axes.plot(medians, [row.error_percent for row in own], color=colour, linewidth=0.8, alpha=0.5, zorder=1)
        for index, (row, median) in enumerate(zip(own, medians, strict=True)):
            half = min(COVERAGE * row.error_uncertainty_percent + row.error_bias_percent, 0.95 * row.error_percent)
            axes.errorbar(
                median,
                row.error_percent,
                xerr=[[median - min(row.seconds)], [max(row.seconds) - median]],
                yerr=half,
                color=colour,
                marker=marker,
                markersize=6,
                markerfacecolor="white" if row.dominated_by else colour,
                linewidth=1.0,
                label=program if index == 0 else None,
                zorder=2,
            )
            axes.annotate(row.setting, (median, row.error_percent), (6, 5), textcoords="offset points", fontsize=6.5)
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_xlim()
    noisy = [row for row in rows if row.program == "mitsuba"]
    if noisy:
        last = min(noisy, key=lambda row: row.error_percent)
        times = np.geomspace(low, high, 2)
        bottom, top = axes.get_ylim()
        line = last.error_percent * np.sqrt(float(np.median(last.seconds)) / times)
        axes.plot(times, line, ":", color=STYLES["mitsuba"][0], linewidth=0.8, zorder=0)
        axes.set_xlim(low, high)
        axes.set_ylim(bottom, top)
    _plain(axes)


def _phase_bar(axes: Any, place: int, row: Measurement) -> None:
    """One stacked bar; phases of phases are in their parent's part."""
    phases = [phase for phase in row.phases if phase.name.count("/") == 1]
    total, begin = sum(phase.median for phase in phases) or 1.0, 0.0
    for phase, colour in zip(phases, PHASE_COLOURS, strict=False):
        share = 100 * phase.median / total
        axes.barh(place, share, left=begin, height=0.5, color=colour, edgecolor="white")
        if share > LEAST_NAMED_PERCENT:
            words = f"{phase.name.split('/')[1]}\n{1e3 * phase.median:.3g} ms"
            axes.text(begin + share / 2, place + 0.3, words, ha="center", va="bottom", fontsize=7)
        begin += share


def _plain(axes: Any) -> None:
    axes.grid(which="major", color="#e6e3dc", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _saved(figure: Any, file_format: Literal["svg", "png"]) -> bytes:
    stream = io.BytesIO()
    metadata = {"Date": None} if file_format == "svg" else None
    figure.savefig(stream, format=file_format, metadata=metadata, dpi=150, transparent=file_format == "svg")
    content = stream.getvalue()
    return content[content.index(b"<svg") :] if file_format == "svg" else content

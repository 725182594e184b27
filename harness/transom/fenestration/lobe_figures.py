"""Figures of an evaluation: the fraction of light that lobes represent, light moved between directions, room errors."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from transom.fenestration.evaluation import COUNTS, WIDTHS_DEG, ProductEvaluation

DPI = 110
COLUMNS = 4
LIMITS = (0.0, 1.05)


def represented_figure(found: Sequence[ProductEvaluation]) -> bytes:
    """PNG: mean fraction of the transmitted light in k greedy lobes, over k, a line for each width alpha; one panel a
    product, all on one scale. The dotted line is the least over incident directions at 23 degrees."""
    rows = -(-len(found) // COLUMNS)
    figure = Figure(figsize=(2.9 * COLUMNS, 2.5 * rows), dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    colours = ["#440154", "#414487", "#2a788e", "#22a884", "#7ad151", "#c9bb10"]
    for place, axis in enumerate(axes.ravel()):
        if place >= len(found):
            axis.set_visible(False)
            continue
        product = found[place]
        for row, (width, colour) in enumerate(zip(WIDTHS_DEG, colours, strict=True)):
            axis.plot(COUNTS, product.represented[row], color=colour, marker="o", markersize=3, label=f"{width:g}°")
        least = product.represented_least[WIDTHS_DEG.index(23.0)]
        axis.plot(COUNTS, least, color=colours[WIDTHS_DEG.index(23.0)], linestyle=":")
        axis.set_title(product.product.replace("_", " "), fontsize=9)
        axis.set_ylim(*LIMITS)
        axis.grid(alpha=0.3)
    figure.supxlabel("lobes k")
    figure.supylabel("fraction of transmitted light in k lobes [1]")
    axes[0, 0].legend(title="full angle alpha", fontsize=7, title_fontsize=7, loc="lower right")
    return _png(figure)


def moved_figure(found: Sequence[ProductEvaluation]) -> bytes:
    """PNG: share of the light that is put more than 11.5 degrees from where it goes, for directions left out of a grid
    of 12 degrees."""
    figure = Figure(figsize=(10, 4), dpi=DPI, layout="constrained")
    axis = figure.subplots()
    places = np.arange(len(found))
    bars = (
        ("assigned along edges", "#2a788e", [p.moved_ours for p in found]),
        ("the same lobes by rank", "#c9bb10", [p.moved_rank for p in found]),
        ("paper: 3 lobes of 23°, by rank", "#d35f5f", [p.moved_paper for p in found]),
    )
    for k, (label, colour, values) in enumerate(bars):
        axis.bar(places + 0.27 * (k - 1), 100 * np.array(values), 0.25, color=colour, label=label)
    axis.set_xticks(places, [p.product.replace("_", "\n") for p in found], fontsize=8)
    axis.set_ylabel("light moved by more than 11.5° [%]")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False)
    return _png(figure)


def room_figure(found: Sequence[ProductEvaluation]) -> bytes:
    """PNG: median (mark) and 90th percentile (line end) of the error of floor and desk illuminance, over 24 suns."""
    figure = Figure(figsize=(10, 4), dpi=DPI, layout="constrained")
    axis = figure.subplots()
    places = np.arange(len(found))
    for k, (label, colour, errors) in enumerate(
        (
            ("traced at the actual sun", "#2a788e", [p.traced for p in found]),
            ("from directions 6° apart", "#d35f5f", [p.tabulated for p in found]),
            ("clear sky", "#7a7a7a", [p.sky for p in found]),
        )
    ):
        x = places + 0.25 * (k - 1)
        middle = 100 * np.array([max(e.quantile(0.5), FLOOR) for e in errors])
        high = 100 * np.array([max(e.quantile(0.9), FLOOR) for e in errors])
        axis.vlines(x, middle, high, color=colour)
        axis.plot(x, middle, "o", color=colour, label=label)
    axis.set_yscale("log")
    axis.set_xticks(places, [p.product.replace("_", "\n") for p in found], fontsize=8)
    axis.set_ylabel("error of floor and desk illuminance [%]")
    axis.grid(axis="y", alpha=0.3)
    axis.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False)
    return _png(figure)


FLOOR = 1e-4
"""Relative error below which a mark stands at the lower border: the axis is logarithmic."""


def _png(figure: Figure) -> bytes:
    content = io.BytesIO()
    figure.savefig(content, format="png")
    return content.getvalue()

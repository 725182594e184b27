"""Pictures of configuration plots: false colour in which green is light to read by, as in the paper's Figure 10."""

from __future__ import annotations

import calendar
import io
import textwrap
from collections.abc import Mapping

from transom.configuration import DAY, HOUR, READING_LX, Axis, Plot
from transom.report.numbers import fixed, words

LEVELS_LX = (0.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0, 100_000.0)
COLOURS = (
    "#1d2b53",
    "#3a5a9b",
    "#8fb2dc",
    "#d3efc3",
    "#86cb7d",
    "#2f9152",
    "#fbd38a",
    "#ee8b3b",
    "#b8331f",
)
"""Blue below READING_LX, green within, orange and red above."""

DARK_FROM = (0, 1, 5, 8)
"""Colours on which print is white."""

TITLE_LETTERS = 62
"""In a line above each panel."""

MOST_PRINTED = 12
"""Cells along an axis up to which each says its number."""


def configuration_png(plot: Plot, notes: Mapping[str, str] | None = None) -> bytes:
    """One panel a target, on one scale, with the daylight autonomy in the title. notes: kept in the file."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.figure import Figure

    count, columns, rows = len(plot.targets), len(plot.x.values), len(plot.y.values)
    colours, norm = ListedColormap(COLOURS), BoundaryNorm(LEVELS_LX, len(COLOURS))
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(1.3 + 4.4 * count, 4.6), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, count, squeeze=False)[0]
        for panel, name, values in zip(panels, plot.targets, plot.illuminance_lx, strict=True):
            shown = panel.imshow(values, origin="lower", aspect="auto", cmap=colours, norm=norm)
            panel.set_title(words(name), fontsize=10)
            panel.set_xticks(range(columns), _labels(plot.x), rotation=0 if columns <= MOST_PRINTED else 90)
            panel.set_yticks(range(rows), _labels(plot.y))
            panel.set_xlabel(axis_words(plot.x))
            panel.set_ylabel(axis_words(plot.y))
            panel.tick_params(length=0)
            if max(columns, rows) <= MOST_PRINTED:
                for row in range(rows):
                    for column in range(columns):
                        band = int(norm(values[row, column]))
                        ink = "white" if band in DARK_FROM else "#222222"
                        text = fixed(_two_digits(values[row, column]), 0)
                        panel.text(column, row, text, ha="center", va="center", fontsize=7, color=ink)
        low, high = (fixed(value, 0) for value in READING_LX)
        bar = figure.colorbar(shown, ax=list(panels), ticks=LEVELS_LX[1:-1], shrink=0.9)
        bar.ax.set_yticklabels([fixed(value, 0) for value in LEVELS_LX[1:-1]])
        bar.set_label(f"illuminance [lx]; green: {low} to {high} lx, to read by")
        figure.suptitle("\n".join(_lines(plot, count)), fontsize=9)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=150, metadata={"Software": None, **(notes or {})})
    return stream.getvalue()


def autonomy_words(plot: Plot) -> str:
    """The daylight autonomy of the plot in words."""
    cells = int(plot.daylight.sum())
    low, high = (fixed(value, 0) for value in READING_LX)
    targets = "every target" if len(plot.targets) > 1 else "the target"
    share = fixed(plot.autonomy_percent(), 0)
    return f"daylight autonomy {share} % ({targets} at {low} to {high} lx, of {cells} cells with daylight)"


def axis_words(axis: Axis) -> str:
    if axis.name == DAY:
        return "day of the year"
    if axis.name == HOUR:
        return "hour [civil standard time]"
    unit = " [°]" if axis.name.startswith("angle") else ""
    return words(axis.name).lower() + unit


def _lines(plot: Plot, panels: int) -> list[str]:
    """The title in lines that fit above so many panels."""
    letters = TITLE_LETTERS * panels
    return textwrap.wrap(plot.scene, letters) + textwrap.wrap(autonomy_words(plot), letters)


def _labels(axis: Axis) -> list[str]:
    if axis.name == DAY:
        return [_date(round(value)) for value in axis.values]
    return [f"{value:.4g}" for value in axis.values]


def _date(day: int) -> str:
    """Of a year of 365 days: 80 is 21 March."""
    month = 1
    while day > calendar.monthrange(2026, month)[1]:
        day -= calendar.monthrange(2026, month)[1]
        month += 1
    return f"{day} {calendar.month_abbr[month]}"


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")

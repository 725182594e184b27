"""Configuration plots of the report: the paper's Figures 4g, 4h and 10, as `transom plot` draws them."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from transom.commands.choices import chosen_condition
from transom.configuration import compute_plot, csv_text, read_axis
from transom.fenestration.reglazing import load_glazed
from transom.figures_configuration import autonomy_words, configuration_png
from transom.files import write_atomic
from transom.provenance import current_provenance
from transom.report.pictures import Picture, webp_bytes

YEAR = ("day=15:349:8", "hour=9:16:8")
ANGLES = ("angle_low=10:80:8", "angle_high=10:80:8")


@dataclass(frozen=True)
class PlotOrder:
    """A plot of the report: the words of its `transom plot` command. name: of its files in build/plots."""

    name: str
    caption: str
    scene: str
    glazing: tuple[str, ...]
    axes: tuple[str, str]
    time: str | None = None

    @property
    def command(self) -> str:
        words = ["transom plot", self.scene, *(f"--glazing '{text}'" for text in self.glazing)]
        words += [f"--x {self.axes[0]}", f"--y {self.axes[1]}", *([f"--time {self.time}"] if self.time else [])]
        return " ".join([*words, f"-o build/plots/{self.name}.png"])


ORDERS = (
    PlotOrder(
        "figure_4g",
        "The paper's Figure 4g: the floor's centre over the two facet angles of a prismatic panel, 21 March, 10:00",
        "test_room",
        ("south_upper=prismatic_panel",),
        ANGLES,
    ),
    PlotOrder(
        "figure_4h",
        "The paper's Figure 4h: the same point over day and hour, the panel fixed",
        "test_room",
        ("south_upper=prismatic_panel(angle_high=70)",),
        YEAR,
    ),
    PlotOrder(
        "figure_10_glass",
        "The paper's Figure 10, where it begins: two desks over day and hour, plain glass",
        "desk_office",
        (),
        YEAR,
    ),
    PlotOrder(
        "figure_10_angles",
        "The paper's Figure 10, a step: two desks over the facet angles of a panel in the transom, 21 June, 12:00",
        "desk_office",
        ("south_transom=prismatic_panel",),
        ANGLES,
        "2026-06-21T12:00",
    ),
)

SOURCE = "Source"
"""Name of the PNG text that says what a plot was made from."""


def make_plots(build: Path, note: Callable[[str], None]) -> None:
    """Draws every plot anew into BUILD/plots: a picture and its table."""
    for order in ORDERS:
        note(f"Plot {order.name}")
        scene = load_glazed(order.scene, order.glazing)
        x, y = (read_axis(text, "axis") for text in order.axes)
        plot = compute_plot(scene, chosen_condition(scene, None, order.time, None), x, y)
        machine = current_provenance()
        source = f"revision {machine.commit or 'unknown'}; {autonomy_words(plot)}; {plot.cells_s:.2f} s after a solve"
        file = build / "plots" / f"{order.name}.png"
        write_atomic(file.with_suffix(".csv"), csv_text(plot))
        write_atomic(file, configuration_png(plot, {SOURCE: source}))


def find_plots(build: Path) -> list[tuple[PlotOrder, Picture | None]]:
    """Each plot of the report, None where it has not been drawn by the report."""
    return [(order, _picture(order, build / "plots" / f"{order.name}.png")) for order in ORDERS]


def png_picture(caption: str, content: bytes, source: str) -> Picture:
    """A figure that was drawn as a PNG; what the file says of its own source goes before `source`."""
    image = Image.open(io.BytesIO(content))
    pixels = np.asarray(image.convert("RGB"))
    own = str(image.info.get(SOURCE, ""))
    return Picture(caption, webp_bytes(pixels, lossless=True), image.width, image.height, own or source)


def _picture(order: PlotOrder, file: Path) -> Picture | None:
    return png_picture(order.caption, file.read_bytes(), order.command) if file.is_file() else None

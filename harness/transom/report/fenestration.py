"""The chapter on complex fenestration: one room with many products beside the reference, and a prism to play with."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from transom.bundle import Bundle
from transom.daylight.condition import Condition, resolve_condition
from transom.fenestration.panels import panel_axes
from transom.products import load_product
from transom.products.lobe_plot import SunDirection, plot_lobes
from transom.report import rows_fenestration
from transom.report.numbers import fixed, words
from transom.report.pictures import Picture, find_pictures, illustration
from transom.report.plots import PlotOrder, find_plots, png_picture
from transom.report.results import Results
from transom.report.rows_fenestration import EVALUATE, glazing_words
from transom.report.sections import FENESTRATION, RoomSection, condition_words, error_words, rooms, suite_rows
from transom.report.speed import Speed
from transom.report.table import Table
from transom.scene import load_scene
from transom.scene.model import View
from transom.suite import Suite

PRISM_PRODUCT = "prismatic_panel"
PRISM_SCENE = "test_room"
FACING_SOUTH = np.array([0.0, -1.0, 0.0])

LOBE_PRODUCT = "laser_cut_panel"
LOBE_SUNS = (SunDirection(30.0, 0.0), SunDirection(50.0, 40.0))
LOBE_FIGURES = (
    ("evaluation_represented.png", "Fraction of the transmitted light in k lobes of full angle alpha, by product"),
    ("evaluation_moved.png", "Light put more than 11.5° from where it goes, for directions left out of the table"),
    (
        "evaluation_room.png",
        "Errors of floor and desk illuminance: median (mark), 90th percentile (end of line)",
    ),
)

FIGURES = {
    "test_room": "The paper's Figures 4 and 7: the upper panes of the test room",
    "partition_office": "The paper's Figure 8: the upper panes of the west windows of the partition office",
}


@dataclass(frozen=True)
class GalleryCell:
    """One product: ours and the reference's picture, None where there is none, and the mean error in words."""

    title: str
    ours: Picture | None
    reference: Picture | None
    error: str


@dataclass(frozen=True)
class Gallery:
    """One view of one scene with its products, on one scale. white: of all pictures, with its unit."""

    title: str
    condition: str
    white: str
    cells: list[GalleryCell]


@dataclass(frozen=True)
class Slider:
    """One variable of the prism figure [degrees]."""

    name: str
    label: str
    low: int
    high: int
    value: int


@dataclass(frozen=True)
class PrismSun:
    """A moment that can be chosen: its words, and the sun's profile angle at a south facade [degrees] as text."""

    label: str
    profile: str


@dataclass(frozen=True)
class PrismFigure:
    """The interactive figure. parameters: of the product, JSON for the page's script."""

    title: str
    parameters: str
    sliders: list[Slider]
    suns: list[PrismSun]
    source: str


@dataclass(frozen=True)
class Chapter:
    """Everything of the chapter but its tables. rooms: a viewer for each product that has a reference. plots: those of
    transom.report.plots, None where there is none. lobes: figures of lobes, the paper's Figure 6 first."""

    galleries: list[Gallery]
    rooms: list[RoomSection]
    prism: PrismFigure
    plots: list[tuple[PlotOrder, Picture | None]]
    lobes: list[Picture]


def make_chapter(suites: Sequence[Suite], results: Results, build: Path) -> Chapter:
    """From the runs of the suite that are there."""
    chosen = [suite for suite in suites if suite.name == FENESTRATION]
    return Chapter(
        galleries=[gallery for suite in chosen for gallery in galleries(suite, results)],
        rooms=[room for suite in chosen for room in rooms(suite)],
        prism=prism_figure(),
        plots=find_plots(build),
        lobes=[figure_6(), *lobe_figures(build)],
    )


def chapter_tables(suites: Sequence[Suite], results: Results, speed: Speed, build: Path) -> list[Table]:
    """Transport by product, how well lobes stand for products, and speed."""
    scenes = {entry.scene.name: entry.scene for suite in suites for entry in suite.cases if suite.name == FENESTRATION}
    images, sensors = (suite_rows(rows, [FENESTRATION]) for rows in (results.images, results.sensors))
    file = build / "lobes" / "evaluation.json"
    found = rows_fenestration.read_evaluations(file)
    source = f"transom lobes --evaluate, SHA-256 {hashlib.sha256(file.read_bytes()).hexdigest()[:12]}" if found else ""
    return [
        rows_fenestration.transport(images, sensors, scenes),
        rows_fenestration.references(build / "lobes"),
        rows_fenestration.representation(found, source),
        rows_fenestration.represented(found, source),
        rows_fenestration.interpolation(found, source),
        rows_fenestration.energy(found, source),
        rows_fenestration.speed(speed.variants),
    ]


def galleries(suite: Suite, results: Results) -> list[Gallery]:
    """Each scene of the suite that has variants, with one cell a variant, in the order of the suite."""
    found = []
    for base in dict.fromkeys(entry.scene.variant_of or entry.scene.name for entry in suite.cases):
        entries = [entry for entry in suite.cases if (entry.scene.variant_of or entry.scene.name) == base]
        view = entries[0].views[0]
        cells = []
        for entry in entries:
            pictures = find_pictures(entry, view)
            error = error_words(results, suite, entry, view.name)
            title = glazing_words(entry.scene)
            cells.append(
                GalleryCell(
                    title,
                    _shown(f"{title}: Transom", pictures.volumes or pictures.rays, view),
                    _shown(f"{title}: Mitsuba 3", pictures.reference, view),
                    error,
                )
            )
        white = f"{fixed(view.display_white_cd_m2, 0)} cd/m²"
        found.append(Gallery(FIGURES.get(base, words(base)), condition_words(entries[0]), white, cells))
    return found


def prism_figure() -> PrismFigure:
    """The prismatic panel with its own numbers, under the suns of the test room."""
    product, scene = load_product(PRISM_PRODUCT), load_scene(PRISM_SCENE)
    parameters = product.record.parameters
    suns = []
    for spec in scene.conditions:
        condition = resolve_condition(spec, scene.site)
        profile = profile_angle_deg(condition)
        if profile is not None:
            suns.append(PrismSun(spec.name, f"{profile:.1f}"))
    sliders = [
        Slider("profile", "Sun, profile angle", 0, 85, round(float(suns[0].profile))),
        Slider("angle_low", "Lower facet", 1, 89, round(parameters["angle_low"])),
        Slider("angle_high", "Upper facet", 1, 89, round(parameters["angle_high"])),
    ]
    names = ("pitch", "base", "index", "absorption")
    data = json.dumps({name: parameters[name] for name in names})
    source = f"btdf_measurements/{PRISM_PRODUCT}/product.toml"
    return PrismFigure(product.title, data, sliders, suns, source)


def figure_6() -> Picture:
    """The paper's Figure 6: the laser cut panel's light of two suns, with the paper's lobes."""
    product = load_product(LOBE_PRODUCT)
    tracer = product.tracer()
    drawn = plot_lobes(product.title, LOBE_SUNS, [tracer.trace(sun.incident) for sun in LOBE_SUNS])
    caption = f"After the paper's Figure 6: {product.title.lower()}, two suns, lobes of 23° by share"
    return png_picture(caption, drawn, f"btdf_measurements/{LOBE_PRODUCT}/product.toml")


def lobe_figures(build: Path) -> list[Picture]:
    """Figures that `transom lobes --evaluate` drew."""
    files = [(build / "lobes" / name, caption) for name, caption in LOBE_FIGURES]
    return [png_picture(caption, file.read_bytes(), EVALUATE) for file, caption in files if file.is_file()]


def profile_angle_deg(condition: Condition) -> float | None:
    """Height of the sun in the section across a south facade [degrees]; None for a sun that is not before it."""
    if condition.sun_direction is None:
        return None
    _, y, z = panel_axes(FACING_SOUTH) @ -condition.sun_direction
    return float(np.degrees(np.arctan2(-y, z))) if z > 0 else None


def _shown(caption: str, bundle: Bundle | None, view: View) -> Picture | None:
    return illustration(caption, bundle, view) if bundle is not None else None

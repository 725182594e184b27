"""Configuration plots: illuminance where it is wanted, over two variables of time or of a glazing product.

The paper's Figure 10 [Cutler et al. 2008, section 3.5]: hours and days show when a design works; facet angles of a
prismatic panel at one moment show which panel would.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition, resolve_condition
from transom.engine import Engine, SolveOptions
from transom.errors import InputError
from transom.fenestration.choice import is_file
from transom.fenestration.reglazing import reglazed
from transom.products import load_product
from transom.scene.model import ConditionSpec, Opening, Scene, SensorSet

Float64 = NDArray[np.float64]

HOUR, DAY = "hour", "day"
TIME_RANGES = {HOUR: (0.0, 23.99), DAY: (1.0, 365.0)}

MOST_VALUES = 64
"""On one axis: a plot of 64 x 64 is 4096 relightings."""

READING_LX = (200.0, 2000.0)
"""Illuminance that suits reading [Cutler et al. 2008, section 3.5]."""

SENSOR_RAYS = 2048
"""A sensor, over the hemisphere and towards the openings: what is left of noise is far below a colour of the plot."""


@dataclass(frozen=True)
class Axis:
    """One variable and its values, rising: "hour" (civil standard time), "day" (of the year, 1 is 1 January), or a
    parameter of the product in an opening, in its own unit."""

    name: str
    values: tuple[float, ...]

    @property
    def is_time(self) -> bool:
        return self.name in TIME_RANGES


@dataclass(frozen=True)
class Plot:
    """Illuminance over two variables.

    targets: names of the sensor sets. illuminance_lx: (T, Y, X), mean over the points of each set. daylight: (Y, X),
    whether there is any light outdoors. solve_s, cells_s: time for the first light, and for all cells after it.
    """

    scene: str
    x: Axis
    y: Axis
    targets: tuple[str, ...]
    illuminance_lx: Float64
    daylight: NDArray[np.bool_]
    solve_s: float
    cells_s: float

    def suits_reading(self) -> NDArray[np.bool_]:
        """Whether every target has READING_LX, (Y, X)."""
        low, high = READING_LX
        return np.asarray(((self.illuminance_lx >= low) & (self.illuminance_lx <= high)).all(axis=0))

    def autonomy_percent(self) -> float:
        """Daylight autonomy as the paper means it: the share of cells with daylight in which every target has light to
        read by, and not too much [%]; NaN without daylight."""
        count = int(self.daylight.sum())
        return 100.0 * float((self.suits_reading() & self.daylight).sum()) / count if count else float("nan")


def read_axis(text: str, field: str) -> Axis:
    """NAME=FIRST:LAST:COUNT, evenly spaced, or NAME=A,B,C. Raises InputError for anything else."""
    name, equals, range_text = (part.strip() for part in text.partition("="))
    parts = range_text.split(":")
    try:
        if len(parts) == 3:
            values = tuple(float(v) for v in np.linspace(float(parts[0]), float(parts[1]), int(parts[2])))
        else:
            values = tuple(float(part) for part in range_text.split(","))
    except ValueError:
        values = ()
    rises = all(b > a for a, b in itertools.pairwise(values))
    if not equals or not name or not values or not np.isfinite(values).all() or not rises or len(values) > MOST_VALUES:
        remedy = f"Write NAME=FIRST:LAST:COUNT with up to {MOST_VALUES} rising values, such as hour=9:16:8"
        raise InputError("is not an axis", field=field, value=text, remedy=remedy)
    low, high = TIME_RANGES.get(name, (-np.inf, np.inf))
    if values[0] < low or values[-1] > high:
        raise InputError(f"has a {name} outside {low:g}..{high:g}", field=field, value=text)
    return Axis(name, values)


def compute_plot(
    scene: Scene,
    spec: ConditionSpec,
    x: Axis,
    y: Axis,
    *,
    opening: str | None = None,
    options: SolveOptions | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Plot:
    """Illuminance of the scene's target sensors in every cell.

    spec: moment and sky of what no axis varies; with another moment its levels follow from the sky. opening: where the
    product is whose parameters vary; None for the only one. Raises InputError before anything is computed for an axis
    that the scene does not have, or a product that some cell could not have.
    """
    targets = target_sensors(scene)
    if x.name == y.name:
        raise InputError("is on both axes", field="--y", value=x.name, remedy="Vary two different things")
    cells = [(row, column) for row in range(len(y.values)) for column in range(len(x.values))]
    chosen = {(row, column): {x.name: x.values[column], y.name: y.values[row]} for row, column in cells}
    glazings = {cell: _glazing(scene, values, opening) for cell, values in chosen.items()}
    scenes = {glazing: reglazed(scene, glazing) for glazing in dict.fromkeys(glazings.values())}
    conditions = {cell: resolve_condition(_moment(spec, values), scene.site) for cell, values in chosen.items()}
    illuminance = np.zeros((len(targets), len(y.values), len(x.values)))
    begin = time.perf_counter()
    engine = Engine.solve(next(iter(scenes.values())), options)
    solved = time.perf_counter()
    done = 0
    for glazing, variant in scenes.items():
        if engine.scene is not variant:
            engine.replace_products(variant)
        for row, column in cells:
            if glazings[row, column] != glazing:
                continue
            illuminance[:, row, column] = _illuminance(engine, conditions[row, column], targets)
            done += 1
            if progress is not None:
                progress(done, len(cells))
    daylight = np.array([conditions[cell].diffuse_horizontal_lx > 0 for cell in cells]).reshape(illuminance.shape[1:])
    names = tuple(entry.name for entry in targets)
    finished = time.perf_counter()
    return Plot(scene.name, x, y, names, illuminance, daylight, solved - begin, finished - solved)


def target_sensors(scene: Scene) -> tuple[SensorSet, ...]:
    """The sensor sets that a scene calls targets. Raises InputError without one."""
    targets = tuple(entry for entry in scene.sensors if entry.target)
    if not targets:
        raise InputError("has no target sensors", file=scene.file, remedy="Set target = true in a [[sensors]] table")
    return targets


def csv_text(plot: Plot) -> str:
    """One row a cell: the two variables, illuminance of each target [lx], and whether all suit reading."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([plot.x.name, plot.y.name, *(f"{name}_lx" for name in plot.targets), "suits_reading"])
    suits = plot.suits_reading()
    for row, y in enumerate(plot.y.values):
        for column, x in enumerate(plot.x.values):
            values = [f"{value:.6g}" for value in plot.illuminance_lx[:, row, column]]
            writer.writerow([f"{x:.10g}", f"{y:.10g}", *values, int(suits[row, column])])
    return stream.getvalue()


def csv_file(picture: Path) -> Path:
    return picture.with_suffix(".csv")


def _illuminance(engine: Engine, condition: Condition, targets: Sequence[SensorSet]) -> Float64:
    """Mean illuminance of each target (T,) [lx]."""
    engine.relight(condition)
    points, normals = (np.concatenate([getattr(entry, name) for entry in targets]) for name in ("points", "normals"))
    total = engine.illuminance(points, normals, rays=SENSOR_RAYS, opening_rays=SENSOR_RAYS)["total"][:, 1]
    ends = np.cumsum([len(entry.points) for entry in targets])
    return np.array([part.mean() for part in np.split(total, ends[:-1])])


def _moment(spec: ConditionSpec, values: dict[str, float]) -> ConditionSpec:
    """The condition at another hour or day: a scene's absolute levels belong to its own moment."""
    if not values.keys() & TIME_RANGES.keys():
        return spec
    written = datetime.fromisoformat(spec.time)
    day = written.replace(hour=0, minute=0, second=0)
    if DAY in values:
        day = datetime(written.year, 1, 1) + timedelta(days=round(values[DAY]) - 1)
    hour = values.get(HOUR, written.hour + written.minute / 60)
    moment = day + timedelta(minutes=round(60 * hour))
    return replace(
        spec,
        name=f"{moment:%m%d_%H%M}",
        time=f"{moment:%Y-%m-%dT%H:%M}",
        zenith_luminance_cd_m2=None,
        diffuse_horizontal_illuminance_lx=None,
        direct_normal_illuminance_lx=None,
    )


def _glazing(scene: Scene, values: dict[str, float], opening: str | None) -> tuple[str, ...]:
    """What reglazes the scene to the parameters of a cell; empty where no axis is one."""
    changes = {name: value for name, value in values.items() if name not in TIME_RANGES}
    if not changes:
        return ()
    entry = _varied_opening(scene, opening)
    assert entry.product is not None
    known = load_product(entry.product.name).record.parameters
    for name in changes:
        if not re.fullmatch(r"\w+", name) or name not in known:
            remedy = f"Choose from hour, day, {', '.join(known)}"
            raise InputError(f"is not a variable of {entry.product.name}", field="axis", value=name, remedy=remedy)
    parameters = {**dict(entry.product.parameters), **changes}
    words = ",".join(f"{name}={value!r}" for name, value in parameters.items())
    return (f"{entry.name}={entry.product.name}({words})",)


def _varied_opening(scene: Scene, name: str | None) -> Opening:
    """The opening whose product has parameters to vary."""
    filled = [entry for entry in scene.openings if entry.product is not None and not is_file(entry.product.name)]
    found = [entry for entry in filled if name in (None, entry.name)]
    if len(found) == 1:
        return found[0]
    raise InputError(
        f"has {len(filled)} openings with a product whose parameters could vary",
        file=scene.file,
        field="--opening",
        value=name,
        remedy="Name one with --opening, or put a product there: --glazing OPENING=prismatic_panel",
    )

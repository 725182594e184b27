"""Pictures of where a product sends light, as in figure 6 of Cutler et al. 2008: the room's hemisphere with its lobes.

One disc an incident direction: the middle is the normal into the room, the rim its plane; up is up, and right is as
seen from the room looking out. All discs of a picture share one printed scale.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from transom.products.section import Exits, Traced

Float64 = NDArray[np.float64]

CELL_DEG = 3.0
"""Side of the cells in which leaving light is shown, in polar angle and, at the rim, in azimuth."""

LOBES = 3
LOBE_WIDTH_DEG = 23.0
"""The paper's k and alpha (full angle)."""

LEAST_SHARE = 0.005
"""Of the transmitted light: a cone with less is no lobe worth a circle."""

LABEL = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.7}
DECADES = 4
COLUMNS = 4


@dataclass(frozen=True)
class SunDirection:
    """Where the sun stands before a vertical panel [degrees]. azimuth: from the panel's normal, positive to the
    right as seen from the room looking out (towards west for a panel that looks south)."""

    altitude_deg: float
    azimuth_deg: float

    @property
    def incident(self) -> Float64:
        """Direction of its light in the frame of the product (3,)."""
        h, a = math.radians(self.altitude_deg), math.radians(self.azimuth_deg)
        return np.array([-math.cos(h) * math.sin(a), -math.sin(h), math.cos(h) * math.cos(a)])


@dataclass(frozen=True)
class ShownLobe:
    """A lobe: its mean direction (3,) and its share of the transmitted light."""

    direction: Float64
    share: float


def strongest_lobes(exits: Exits, count: int = LOBES, width_deg: float = LOBE_WIDTH_DEG) -> list[ShownLobe]:
    """Greedy lobes [Cutler et al. 2008, section 3.4]: the cone of `width_deg` about an exit that holds most light,
    then the one that holds most of the rest. At most `count`; their directions are means by flux."""
    total = exits.total
    if total <= 0:
        return []
    strongest = np.argsort(exits.flux)[::-1][:2000]  # a cone about a weak exit is not the fullest
    directions, left = exits.directions, exits.flux.copy()
    reach = math.cos(math.radians(width_deg / 2))
    within = directions[strongest] @ directions.T >= reach
    lobes: list[ShownLobe] = []
    for _ in range(count):
        held = within @ left
        best = int(np.argmax(held))
        if held[best] <= LEAST_SHARE * total:
            break
        chosen = within[best]
        mean = (directions[chosen] * left[chosen, None]).sum(axis=0)
        lobes.append(ShownLobe(mean / np.linalg.norm(mean), float(held[best] / total)))
        left = np.where(chosen, 0.0, left)
    return lobes


def plot_lobes(title: str, suns: Sequence[SunDirection], traced: Sequence[Traced]) -> bytes:
    """A PNG of the transmitted light of each sun, with its strongest lobes and their widths."""
    density = [_density(light.transmitted) for light in traced]
    highest = max((float(values.max()) for values in density), default=0.0)
    top = 10 ** math.ceil(math.log10(highest)) if highest > 0 else 1.0
    columns = min(COLUMNS, len(suns))
    rows = math.ceil(len(suns) / columns)
    figure = Figure(figsize=(max(3.1 * columns + 0.9, 5.5), 3.5 * rows + 0.7), layout="constrained")
    norm = LogNorm(top / 10**DECADES, top)
    mesh = None
    for number, (sun, light, values) in enumerate(zip(suns, traced, density, strict=True)):
        axes = figure.add_subplot(rows, columns, number + 1)
        mesh = axes.pcolormesh(*_cell_corners(), np.where(values > 0, values, np.nan), norm=norm, cmap="viridis")
        _draw_frame(axes)
        lobes = strongest_lobes(light.transmitted)
        for lobe in lobes:
            circle = _small_circle(lobe.direction)
            axes.plot(circle[:, 0], circle[:, 1], color="tab:orange", linewidth=1.5)
            x, y = _place(lobe.direction[None])[0]
            axes.annotate(
                f"{100 * lobe.share:.0f} %",
                (x, y),
                (15, 0),
                textcoords="offset points",
                fontsize=8,
                va="center",
                bbox=LABEL,
            )
        axes.plot(*_place(sun.incident[None])[0], marker="o", color="tab:blue", markersize=7, markeredgecolor="white")
        held = 100 * sum(lobe.share for lobe in lobes)
        axes.set_title(
            f"sun {sun.altitude_deg:g}° high, {sun.azimuth_deg:+g}° aside\n"
            f"T = {light.transmitted.total:.3f}; {len(lobes)} lobes hold {held:.0f} %",
            fontsize=9,
        )
    if mesh is not None:
        bar = figure.colorbar(mesh, ax=figure.axes, shrink=0.75, pad=0.02)
        bar.set_label("share of the incident light per solid angle [1/sr]", fontsize=9)
    figure.suptitle(
        f"{title}: light in the room\nblue: where unbent light would go; orange: lobes of {LOBE_WIDTH_DEG:g}° "
        "with their share of T",
        fontsize=9,
    )
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()


def _place(directions: Float64) -> Float64:
    """Points (N, 2) of the disc: radius is the polar angle over 90 degrees."""
    flat = np.hypot(directions[:, 0], directions[:, 1])
    radius = np.arctan2(flat, directions[:, 2]) / (np.pi / 2)
    return np.asarray(directions[:, :2] * (radius / np.maximum(flat, 1e-12))[:, None])


def _edges() -> tuple[Float64, Float64]:
    return np.linspace(0, 90, round(90 / CELL_DEG) + 1), np.linspace(0, 360, round(360 / CELL_DEG) + 1)


def _cell_corners() -> tuple[Float64, Float64]:
    theta, phi = np.meshgrid(_edges()[0] / 90, np.radians(_edges()[1]), indexing="ij")
    return theta * np.cos(phi), theta * np.sin(phi)


def _density(exits: Exits) -> Float64:
    """Flux by solid angle [1/sr] in cells of polar angle and azimuth."""
    theta_edges, phi_edges = _edges()
    theta = np.degrees(np.arccos(np.clip(exits.directions[:, 2], -1, 1)))
    phi = np.degrees(np.arctan2(exits.directions[:, 1], exits.directions[:, 0])) % 360
    flux = np.histogram2d(theta, phi, (theta_edges, phi_edges), weights=exits.flux)[0]
    solid = -np.diff(np.cos(np.radians(theta_edges)))[:, None] * np.radians(CELL_DEG)
    return np.asarray(flux / solid)


def _small_circle(axis: Float64) -> Float64:
    """Points (N, 2) of the edge of a lobe; what lies behind the panel is left out."""
    across = np.cross(axis, [1.0, 0, 0] if abs(axis[0]) < 0.9 else [0, 1.0, 0])
    across /= np.linalg.norm(across)
    turn = np.linspace(0, 2 * np.pi, 121)[:, None]
    half = math.radians(LOBE_WIDTH_DEG / 2)
    ring = math.cos(half) * axis + math.sin(half) * (np.cos(turn) * across + np.sin(turn) * np.cross(axis, across))
    return np.where(ring[:, [2]] >= 0, _place(ring), np.nan)


def _draw_frame(axes: object) -> None:
    from matplotlib.axes import Axes
    from matplotlib.patches import Circle

    assert isinstance(axes, Axes)
    for angle in (30, 60, 90):
        axes.add_patch(Circle((0, 0), angle / 90, fill=False, color="0.6", linewidth=0.6))
    for angle in (30, 60):
        axes.text(0.01, -angle / 90, f"{angle}°", fontsize=6, color="0.4", va="top")
    axes.plot([-1, 1], [0, 0], color="0.8", linewidth=0.5, zorder=0)
    axes.plot([0, 0], [-1, 1], color="0.8", linewidth=0.5, zorder=0)
    axes.text(0, 1.02, "up", fontsize=7, ha="center", va="bottom", color="0.3")
    axes.set_aspect("equal")
    axes.set_xlim(-1.08, 1.08)
    axes.set_ylim(-1.08, 1.1)
    axes.set_axis_off()

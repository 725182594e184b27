"""Figures as pixels and as SVG: false colour, signed differences and their scales, and timings.

Compared pictures share one printed scale. Magnitudes are in viridis on a logarithmic scale; signed errors diverge
around zero. A pixel without a value (sky, ground, black reflectance) is neutral grey.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from transom.colour import luminance
from transom.images import tone_mapped
from transom.scene.model import Scene
from transom.visible import FirstSurfaces

Float64 = NDArray[np.float64]

NO_VALUE_GREY = 205
"""sRGB level of pixels without a value."""

NO_VALUE_INDEX = 255
"""Place of that grey in the palette, after 255 steps of the scale."""

SCALE_STEPS = 64

CRISP = 'shape-rendering="crispEdges"'
"""Without it the steps of a scale are drawn with seams between them."""

TONE_TICKS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Labels of a toned picture's scale, as shares of its white."""


@dataclass(frozen=True)
class Scale:
    """A colour scale with printed limits. kind: "log" for magnitudes, "signed" linear around 0, "linear" from low.

    ticks: the values printed. Values outside the limits take the colours of the limits.
    """

    quantity: str
    unit: str
    kind: Literal["log", "signed", "linear"]
    low: float
    high: float
    ticks: tuple[float, ...]

    def position(self, values: NDArray[np.floating]) -> Float64:
        """Values -> 0..1 along the scale; NaN stays NaN."""
        plain = np.asarray(values, np.float64)
        if self.kind == "log":
            with np.errstate(divide="ignore", invalid="ignore"):
                plain = np.log10(np.where(plain > 0, plain, np.where(np.isnan(plain), np.nan, 1e-30)))
            low, high = math.log10(self.low), math.log10(self.high)
        else:
            low, high = self.low, self.high
        return np.clip((plain - low) / (high - low), 0.0, 1.0)

    @property
    def map_name(self) -> str:
        return {"log": "viridis", "signed": "RdBu_r", "linear": "cividis"}[self.kind]


def luminance_scale(white_cd_m2: float) -> Scale:
    """Three decades of luminance about a view's fixed white: from a hundredth of it to ten times it."""
    low, high = white_cd_m2 / 100, white_cd_m2 * 10
    marks = (step * 10.0**decade for decade in range(-3, 7) for step in (1, 3))
    return Scale("luminance", "cd/m²", "log", low, high, tuple(mark for mark in marks if low <= mark <= high))


ILLUMINANCE_SCALE = Scale("illuminance", "lx", "log", 30, 100_000, (30, 200, 500, 2000, 10_000, 100_000))
"""200 and 2000 lx are the paper's limits for reading."""
DIFFERENCE_SCALE = Scale("signed relative difference", "%", "signed", -10, 10, (-10, -5, 0, 5, 10))
NOISE_SCALE = Scale("standard error of the reference", "%", "linear", 0, 5, (0, 1, 2, 3, 4, 5))


def palette(scale: Scale) -> NDArray[np.uint8]:
    """The scale's 255 colours, sRGB (255, 3)."""
    colours = np.asarray(mpl.colormaps[scale.map_name](np.linspace(0, 1, NO_VALUE_INDEX)))[:, :3]
    return np.round(255 * colours).astype(np.uint8)


def false_colour_png(values: NDArray[np.floating], scale: Scale) -> bytes:
    """False colour (h, w) as a PNG with a palette: 255 steps of the scale, and grey for NaN."""
    position = scale.position(values)
    unknown = np.isnan(position)
    indices = np.where(unknown, NO_VALUE_INDEX, np.round(np.nan_to_num(position) * (NO_VALUE_INDEX - 1)))
    picture = Image.fromarray(indices.astype(np.uint8), "P")
    picture.putpalette(palette(scale).tobytes() + bytes([NO_VALUE_GREY] * 3))
    stream = io.BytesIO()
    picture.save(stream, "PNG", optimize=True)
    return stream.getvalue()


def scale_svg(scale: Scale) -> str:
    """The printed scale: a bar with its ticks, quantity and unit, as inline SVG that follows the page's font."""
    colours = mpl.colormaps[scale.map_name](np.linspace(0, 1, SCALE_STEPS))
    positions = [float(position) for position in scale.position(np.array(scale.ticks, float))]
    labels = [(position, _tick(value, scale)) for position, value in zip(positions, scale.ticks, strict=True)]
    return _bar_svg([mpl.colors.to_hex(colour) for colour in colours], labels, f"{scale.quantity} [{scale.unit}]")


def tone_scale_svg(white_cd_m2: float) -> str:
    """The printed scale of toned pictures: greys from black to the view's fixed white, as they are shown."""
    shares = np.linspace(0, 1, SCALE_STEPS)
    greys = tone_mapped(np.repeat((shares * white_cd_m2)[None, :, None], 3, axis=2), white_cd_m2)[0, :, 0]
    labels = [(share, f"{white_cd_m2 * share:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")) for share in TONE_TICKS]
    colours = [f"#{level:02x}{level:02x}{level:02x}" for level in (int(grey) for grey in greys)]
    return _bar_svg(colours, labels, "luminance [cd/m²], linear; brighter is white")


def _bar_svg(colours: Sequence[str], labels: Sequence[tuple[float, str]], title: str) -> str:
    """A bar of colours with labels at places 0..1 along it."""
    width, left, bar = 320, 18, 284
    step = bar / len(colours)
    parts = [
        f'<rect x="{left + index * step:.2f}" y="0" width="{step + 0.3:.2f}" height="9" fill="{colour}" {CRISP}/>'
        for index, colour in enumerate(colours)
    ]
    for position, label in labels:
        x = left + bar * position
        parts.append(f'<path d="M{x:.1f} 9v3" stroke="currentColor"/>')
        parts.append(f'<text x="{x:.1f}" y="22" text-anchor="middle">{label}</text>')
    return (
        f'<svg class="scale" viewBox="0 0 {width} 36" role="img" aria-label="{title}">{"".join(parts)}'
        f'<text x="{left + bar / 2}" y="34" text-anchor="middle" class="quantity">{title}</text></svg>'
    )


def illuminance_image(rgb: NDArray[np.floating], scene: Scene, surfaces: FirstSurfaces) -> Float64:
    """Illuminance of what each pixel sees (h, w) [lx]: E = pi L / rho by colour channel, for diffuse surfaces.

    NaN where a pixel sees no surface of the interior, an emitter, or a surface whose reflectance has a zero channel.
    """
    reflectance = np.array([material.reflectance for material in scene.materials], np.float64)
    emits = np.array([max(material.luminance) > 0 for material in scene.materials])
    material = scene.mesh.face_material[np.maximum(surfaces.face, 0)]
    rho = reflectance[material]
    known = surfaces.interior & (surfaces.face >= 0) & (rho.min(axis=2) > 0) & ~emits[material]
    per_channel = np.divide(math.pi * np.asarray(rgb, np.float64), rho, out=np.zeros_like(rho), where=rho > 0)
    return np.where(known, luminance(per_channel), np.nan)


@dataclass(frozen=True)
class TimingBar:
    """One row of the timing figure [s]: what was timed, its median and 95th percentile, and the paper's figure."""

    label: str
    median_s: float
    p95_s: float
    paper_s: tuple[float, float] | None = None


def timings_svg(bars: Sequence[TimingBar]) -> str:
    """Median and p95 of each timing on one logarithmic axis, with the paper's range as a grey band."""
    from matplotlib.figure import Figure

    settings: dict[Any, object] = {"svg.fonttype": "none", "svg.hashsalt": "transom", "font.size": 9}
    with mpl.rc_context(settings):
        figure = Figure(figsize=(9.6, 0.26 * len(bars) + 0.75), layout="constrained")
        axes = figure.subplots()
        for row, bar in enumerate(reversed(bars)):
            if bar.paper_s is not None:
                low, high = bar.paper_s
                axes.barh(row, high - low, left=low, height=0.62, color="#d9d6cf", zorder=1)
                axes.plot([low, low], [row - 0.31, row + 0.31], color="#a9a59b", linewidth=1.2, zorder=1)
            axes.plot([bar.median_s, bar.p95_s], [row, row], color="#1f4e79", linewidth=1.6, zorder=2)
            axes.plot([bar.median_s], [row], "o", color="#1f4e79", markersize=4.5, zorder=3)
        axes.set_xscale("log")
        axes.set_yticks(range(len(bars)), [bar.label for bar in reversed(bars)])
        axes.set_xlabel("time [s]")
        axes.grid(axis="x", color="#e6e3dc", linewidth=0.7)
        axes.set_axisbelow(True)
        for side in ("top", "right", "left"):
            axes.spines[side].set_visible(False)
        axes.tick_params(axis="y", length=0)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None}, transparent=True)
    text = stream.getvalue()
    return text[text.index("<svg") :]


def _tick(value: float, scale: Scale) -> str:
    text = f"{abs(value):,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    sign = ("+" if value > 0 else "\N{MINUS SIGN}" if value < 0 else "") if scale.kind == "signed" else ""
    return sign + text

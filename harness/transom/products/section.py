"""Sections of products: lines between media, repeated along y; and light traced through them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from transom import _engine

Float64 = NDArray[np.float64]
Point = tuple[float, float]

KINDS = {
    "interface": _engine.LineKind.INTERFACE,
    "gap": _engine.LineKind.GAP,
    "mirror": _engine.LineKind.MIRROR,
    "diffuse": _engine.LineKind.DIFFUSE,
}


@dataclass(frozen=True)
class Line:
    """From a to b as (y, z) [m]; the sides and numbers as in engine/include/transom/section.h."""

    a: Point
    b: Point
    kind: str = "interface"
    left: int = 0
    right: int = 0
    reflectance: float = 0.0
    reflectance_right: float = 0.0
    transmittance: float = 0.0
    openness: float = 0.0


@dataclass(frozen=True)
class Exits:
    """Light that left: directions of propagation (N, 3) and shares of the incident flux (N,)."""

    directions: Float64
    flux: Float64

    @property
    def total(self) -> float:
        return float(self.flux.sum())


@dataclass(frozen=True)
class Traced:
    """Where the light of one incidence went; the shares add up to 1."""

    transmitted: Exits
    reflected: Exits
    absorbed: float
    unfinished: float


@dataclass(frozen=True)
class Sweep:
    """Light of N incident directions. incidence (M,): of each exit, the row of its incident direction.
    transmittance, reflectance: (N,), direct-hemispherical."""

    transmitted: Exits
    incidence: NDArray[np.int64]
    transmittance: Float64
    reflectance: Float64


@dataclass(frozen=True)
class Section:
    """One period of a product. media: (index of refraction, absorption [1/m]), the first is air."""

    period_m: float
    media: tuple[tuple[float, float], ...]
    lines: tuple[Line, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def depth(self) -> tuple[float, float]:
        """Least and greatest z of its lines [m]."""
        z = [point[1] for line in self.lines for point in (line.a, line.b)]
        return min(z), max(z)

    @cached_property
    def _core(self) -> _engine.Section:
        low, high = self.depth
        margin = max(high - low, self.period_m) * 0.05
        core = _engine.Section(self.period_m, low - margin, high + margin)
        for index, absorption in self.media:
            core.add_medium(index, absorption)
        for line in self.lines:
            for a, b in _within_period(line.a, line.b, self.period_m):
                core.add_line(
                    a,
                    b,
                    KINDS[line.kind],
                    line.left,
                    line.right,
                    line.reflectance,
                    line.reflectance_right,
                    line.transmittance,
                    line.openness,
                )
        core.validate()
        return core

    def trace(self, direction: Sequence[float] | Float64, rays: int = 1024, seed: int = 1) -> Traced:
        """Sends parallel unpolarised light along `direction` (z > 0: from outdoors) through the product."""
        x, y, z = (float(v) for v in direction)
        sent, back, absorbed, unfinished = _engine.trace_section(self._core, (x, y, z), rays, seed)
        return Traced(Exits(sent[:, :3], sent[:, 3]), Exits(back[:, :3], back[:, 3]), absorbed, unfinished)

    def sweep(self, directions: Float64, rays: int = 16, seed: int = 1) -> Sweep:
        """Sends light along each of `directions` (N, 3) through the product: many directions, few rays each."""
        exits, incidence, sent, back = _engine.trace_section_sweep(
            self._core, np.ascontiguousarray(directions, np.float64), rays, seed
        )
        return Sweep(Exits(exits[:, :3], exits[:, 3]), incidence.astype(np.int64), sent, back)


def polyline(points: Sequence[Point], **side: object) -> list[Line]:
    """Lines through points, all with the same sides."""
    return [Line(a, b, **side) for a, b in itertools.pairwise(points)]  # type: ignore[arg-type]


def _within_period(a: Point, b: Point, period: float) -> list[tuple[Point, Point]]:
    """A line cut at the borders of the period and moved into it."""
    (y0, z0), (y1, z1) = a, b
    low, high = min(y0, y1), max(y0, y1)
    cuts = [0.0, 1.0]
    if high > low:
        borders = np.arange(np.floor(low / period), np.ceil(high / period) + 1) * period
        cuts += [float((border - y0) / (y1 - y0)) for border in borders]
    cuts = sorted({round(cut, 15) for cut in cuts if 0 <= cut <= 1})
    pieces: list[tuple[Point, Point]] = []
    for t0, t1 in itertools.pairwise(cuts):
        shift = np.floor((y0 + 0.5 * (t0 + t1) * (y1 - y0)) / period) * period
        start = (min(max(y0 + t0 * (y1 - y0) - shift, 0.0), period), z0 + t0 * (z1 - z0))
        end = (min(max(y0 + t1 * (y1 - y0) - shift, 0.0), period), z0 + t1 * (z1 - z0))
        if start != end:
            pieces.append((start, end))
    return pieces

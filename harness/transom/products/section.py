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
    "interface": _engine.SurfaceKind.INTERFACE,
    "gap": _engine.SurfaceKind.GAP,
    "mirror": _engine.SurfaceKind.MIRROR,
    "diffuse": _engine.SurfaceKind.DIFFUSE,
}


@dataclass(frozen=True)
class Line:
    """From a to b as (y, z) [m]; sides, bow and numbers as in engine/include/transom/section.h and optical_surface.h.
    left is the front of its surface."""

    a: Point
    b: Point
    kind: str = "interface"
    left: int = 0
    right: int = 0
    reflectance: float = 0.0
    reflectance_right: float = 0.0
    transmittance: float = 0.0
    openness: float = 0.0
    bow: float = 0.0

    def points(self, count: int = 24) -> list[Point]:
        """Points along it, for drawings and for tracers that know no arcs: its ends, and `count` more of an arc."""
        if self.bow == 0:
            return [self.a, self.b]
        a, b = np.array(self.a), np.array(self.b)
        chord = float(np.linalg.norm(b - a))
        left = np.array([-(b - a)[1], (b - a)[0]]) / chord
        half = 2 * np.arctan2(2 * self.bow, chord)  # of the angle that the arc turns through
        radius = chord / (2 * np.sin(half))
        turns = np.linspace(-half, half, count + 2)
        middle = (a + b) / 2 - radius * np.cos(half) * left
        along = (b - a) / chord
        places = middle + radius * (np.outer(np.sin(turns), along) + np.outer(np.cos(turns), left))
        return [self.a, *((float(y), float(z)) for y, z in places[1:-1]), self.b]


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
        z = [point[1] for line in self.lines for point in line.points()]
        return min(z), max(z)

    @property
    def is_diffuse(self) -> bool:
        """Whether any of its lines scatters."""
        return any(line.kind == "diffuse" for line in self.lines)

    @cached_property
    def _core(self) -> _engine.Section:
        low, high = self.depth
        margin = max(high - low, self.period_m) * 0.05
        core = _engine.Section(self.period_m, low - margin, high + margin)
        for index, absorption in self.media:
            core.add_medium(index, absorption)
        for line in self.lines:
            surface = _engine.Surface(
                KINDS[line.kind],
                line.left,
                line.right,
                line.reflectance,
                line.reflectance_right,
                line.transmittance,
                line.openness,
            )
            core.add_line(line.a, line.b, line.bow, surface)
        core.validate()
        return core

    def trace(self, direction: Sequence[float] | Float64, rays: int = 1024, seed: int = 1) -> Traced:
        """Sends parallel unpolarised light along `direction` (z > 0: from outdoors) through the product."""
        x, y, z = (float(v) for v in direction)
        sent, back, absorbed, unfinished = _engine.trace_section(self._core, (x, y, z), rays, seed)
        return Traced(Exits(sent[:, :3], sent[:, 3]), Exits(back[:, :3], back[:, 3]), absorbed, unfinished)

    def sweep(self, directions: Float64, rays: int = 16, seed: int = 1) -> Sweep:
        """Sends light along each of `directions` (N, 3) through the product: many directions, few rays each."""
        return swept(_engine.sweep_section(self._core, np.ascontiguousarray(directions, np.float64), rays, seed))


def swept(found: tuple[Float64, NDArray[np.uint32], Float64, Float64]) -> Sweep:
    """What the engine's sweeps give, by name."""
    exits, incidence, sent, back = found
    return Sweep(Exits(exits[:, :3], exits[:, 3]), incidence.astype(np.int64), sent, back)


def polyline(points: Sequence[Point], **side: object) -> list[Line]:
    """Lines through points, all with the same sides."""
    return [Line(a, b, **side) for a, b in itertools.pairwise(points)]  # type: ignore[arg-type]

"""Light that left a product, split into tight lobes and a residual by bins: together exactly what left."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis, square_from_disc
from transom.fenestration.through import Lobe, SunThrough

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

CELLS = 192
"""Cells along a side of the square on which the hemisphere is laid out before lobes are sought: about 0.5 degrees."""

LINE = 3.0
"""A lobe so many times longer than broad counts as a line."""

CANDIDATES = 96
"""Brightest cells that are tried as the middle of a lobe."""


@dataclass(frozen=True)
class Splitting:
    """How tight lobes are. count: at most so many. width_rad: full angle of the cone that one gathers. narrow_rad: full
    angle of the cone that is taken instead where it holds at least half of that light, so that sharp beams keep their
    direction. least_share: of the incident flux, below which light is not worth a lobe. contrast: how much brighter the
    cone must be than the ring around it, three times as wide: diffuse light is no lobe.
    """

    count: int = 8
    width_rad: float = math.radians(4.0)
    narrow_rad: float = math.radians(0.6)
    least_share: float = 0.006
    contrast: float = 2.0


TIGHT = Splitting()


def split(directions: Float64, flux: Float64, basis: AngleBasis, how: Splitting = TIGHT) -> SunThrough:
    """Exits (N, 3) with their shares of the incident flux (N,) as lobes, brightest first, and a residual by bin."""
    remaining = np.array(flux, np.float64)
    lobes: list[Lobe] = []
    if remaining.size:
        towards, carried, cell = gathered(directions, remaining)
        lobe_of = np.full(len(carried), -1)
        candidates = towards[np.argsort(-carried, kind="stable")[:CANDIDATES]]
        inside = candidates @ towards.T > math.cos(how.width_rad / 2)
        left = carried.copy()
        is_open = np.ones(len(candidates), bool)
        while len(lobes) < how.count and is_open.any():
            best = int(np.argmax(np.where(is_open, inside @ left, -1.0)))
            found = _cone(towards, left, candidates[best], how)
            if found is None:
                is_open[best] = False
                continue
            lobes.append(_lobe(towards[found], left[found]))
            lobe_of[found] = len(lobes) - 1
            left[found] = 0.0
        remaining[lobe_of[cell] >= 0] = 0.0
    residual = np.bincount(basis.bin_of(directions), remaining, basis.count).astype(np.float64)
    return SunThrough(tuple(sorted(lobes, key=lambda lobe: -lobe.share)), residual)


def gathered(directions: Float64, flux: Float64) -> tuple[Float64, Float64, Int64]:
    """Mean directions (C, 3) and sums (C,) of the exits in each cell that has any, and the cell of each exit (N,)."""
    square = square_from_disc(directions[:, 0], directions[:, 1])
    column, row = np.minimum((square * CELLS).astype(np.int64), CELLS - 1).T
    _, cell = np.unique(row * CELLS + column, return_inverse=True)
    count = int(cell.max()) + 1
    sums = np.bincount(cell, flux, count)
    vectors = np.stack([np.bincount(cell, flux * directions[:, axis], count) for axis in range(3)], axis=1)
    lengths = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(lengths, 1e-300)[:, None], sums.astype(np.float64), cell.astype(np.int64)


def _cone(towards: Float64, left: Float64, axis: Float64, how: Splitting) -> Int64 | None:
    """Cells within the cone about `axis`, moved twice to the mean of what it holds; None if that is no lobe."""
    half = how.width_rad / 2
    near = np.flatnonzero((towards @ axis > math.cos(5 * half)) & (left > 0))
    around, light = towards[near], left[near]
    for _ in range(3):
        within = around @ axis > math.cos(half)
        mean = light[within] @ around[within]
        length = float(np.linalg.norm(mean))
        if length == 0:
            return None
        axis = mean / length
    share = float(light[within].sum())
    if share < how.least_share:
        return None
    ring = float(light[(around @ axis > math.cos(3 * half)) & ~within].sum())
    if share < how.contrast * ring * (1 - math.cos(half)) / (math.cos(half) - math.cos(3 * half)):
        return None
    peak = around[np.argmax(np.where(within, light, 0.0))]
    narrow = around @ peak > math.cos(how.narrow_rad / 2)
    return near[narrow] if light[narrow].sum() >= share / 2 else near[within]


def _lobe(towards: Float64, flux: Float64) -> Lobe:
    """Direction: mean by flux. Width: of the cone, evenly filled, with the same mean squared angle from its middle.
    A lobe three times as long as broad is a line with the same variance."""
    mean = flux @ towards
    direction = mean / np.linalg.norm(mean)
    share = float(flux.sum())
    apart = towards - direction
    moments = (apart * flux[:, None]).T @ apart / share
    variances, axes = np.linalg.eigh(moments)
    along = axes[:, 2] - (axes[:, 2] @ direction) * direction
    is_line = variances[2] > LINE**2 * max(float(variances[1]), 0.0)
    length = math.sqrt(3 * float(variances[2])) if variances[2] > 0 else 0.0
    width = 2 * math.sqrt(2 * max(0.0, float(np.trace(moments))))
    return Lobe(direction, share, width, length * along if is_line and length > 0 else None)

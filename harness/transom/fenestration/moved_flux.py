"""How much light a prediction puts somewhere else: the flux that must be moved by more than an angle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import maximum_flow

from transom.bsdf.directions import AngleBasis, square_from_disc
from transom.fenestration.through import SunThrough

Float64 = NDArray[np.float64]

ANGLE_RAD = math.radians(11.5)
UNITS = 1_000_000
"""Parts into which all light is divided: flows are whole numbers."""

CELLS = 48
"""Cells along the side of the square of directions in which light is gathered before flows are sought: 2 degrees."""


def as_points(through: SunThrough, basis: AngleBasis) -> tuple[Float64, Float64]:
    """Lobes and residual as directions (N, 3) and shares (N,); a bin stands at its middle."""
    lit = np.flatnonzero(through.residual > 0)
    directions = np.array([lobe.direction for lobe in through.lobes]).reshape(-1, 3)
    shares = np.array([lobe.share for lobe in through.lobes])
    return np.vstack([directions, basis.centres[lit]]), np.concatenate([shares, through.residual[lit]])


def moved_share(
    predicted: tuple[Float64, Float64], true: tuple[Float64, Float64], angle_rad: float = ANGLE_RAD
) -> float:
    """The least share of the light, 0..1, that must turn by more than `angle_rad` to make of one distribution the
    other; both are directions (N, 3) and flux (N,), taken with the same total. A flow that is as great as possible."""
    (from_points, supply), (to_points, demand) = _gathered(*predicted), _gathered(*true)
    if not supply.sum() or not demand.sum():
        return 0.0 if not supply.sum() and not demand.sum() else 1.0
    near = from_points @ to_points.T >= math.cos(angle_rad)
    rows, columns = np.nonzero(near)
    n, m = len(supply), len(demand)
    source, sink = n + m, n + m + 1
    units = [np.round(UNITS * part / part.sum()).astype(np.int32) for part in (supply, demand)]
    starts = np.concatenate([np.full(n, source), rows, n + np.arange(m)])
    ends = np.concatenate([np.arange(n), n + columns, np.full(m, sink)])
    capacity = np.concatenate([units[0], np.full(len(rows), UNITS, np.int32), units[1]])
    graph = coo_array((capacity, (starts, ends)), shape=(n + m + 2, n + m + 2)).tocsr()
    return max(0.0, 1 - float(maximum_flow(graph, source, sink).flow_value) / UNITS)


def _gathered(directions: Float64, flux: Float64) -> tuple[Float64, Float64]:
    square = square_from_disc(directions[:, 0], directions[:, 1])
    cells = np.minimum((square * CELLS).astype(np.int64), CELLS - 1) @ np.array([CELLS, 1])
    _, cell = np.unique(cells, return_inverse=True)
    sums = np.bincount(cell, flux)
    vectors = np.stack([np.bincount(cell, flux * directions[:, axis]) for axis in range(3)], axis=1)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None], sums.astype(np.float64)

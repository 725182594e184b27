"""The sky divided into bins: Tregenza's 145 patches and Reinhart's subdivisions of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

STEEP_ORDER = 4
STEEP_ANGLE_RAD = math.radians(6)
"""Nodes a bin and direction where the sky is steep, and the angle around the sun within which it is: one hour's
irradiance of a wall is then right to 1.1e-4 for every CIE sky, and for Perez's from clearness 1 to 9. With 3 x 3 nodes
in all bins it is to 1.2e-3."""

TREGENZA_ROW_COUNTS = (30, 30, 24, 24, 18, 12, 6)
"""Bins in each row from the horizon up, below the zenith cap. [Tregenza 1987]"""


class SkyBins:
    """Reinhart's division MF:m of the upper hemisphere into 144 m² + 1 bins; m = 1 is Tregenza's (145), m = 4 has 2305.

    The 7 m rows below the zenith cap are equally high, 90 / (7 m + 1/2) degrees, and have m times Tregenza's counts;
    the cap is one bin with half a row's angle as its radius. Bins are numbered row by row from the horizon up; within
    a row, bin k of n spans azimuths 2 pi k / n to 2 pi (k + 1) / n from +x (east) towards +y (north). The last is the
    cap. The ground, which Radiance counts as bin 0, is not one of them.

    subdivision: m. count: number of bins. row_altitude_edges (rows + 1,) [rad], 0 to pi/2, cap included.
    row_counts (rows,). row_offsets (rows,): first bin of each row. solid_angles (count,) [sr], their sum 2 pi.
    directions (count, 3): centres. mean_sin_altitude (count,): sin(altitude) averaged over the bin's solid angle.
    smooth, steep: unit vectors (count, nodes, 3) in each bin and weights (count, nodes) for means over it, more where
    the sky is steep: in the first row, and where a bin's centre is closer to the sun than steep_cosine says.
    """

    def __init__(self, subdivision: int = 1) -> None:
        if subdivision < 1:
            raise ValueError(f"subdivision = {subdivision}: must be at least 1")
        m = subdivision
        self.subdivision = m
        row_height = math.pi / 2 / (7 * m + 0.5)
        self.row_altitude_edges: Float64 = np.append(row_height * np.arange(7 * m + 1), math.pi / 2)
        self.row_counts: Int32 = np.append(m * np.repeat(TREGENZA_ROW_COUNTS, m), 1).astype(np.int32)
        self.row_offsets: Int32 = (np.cumsum(self.row_counts) - self.row_counts).astype(np.int32)
        self.count = int(self.row_counts.sum())

        sines = np.sin(self.row_altitude_edges)
        self.solid_angles: Float64 = np.repeat(2 * math.pi * np.diff(sines) / self.row_counts, self.row_counts)
        self.mean_sin_altitude: Float64 = np.repeat((sines[1:] + sines[:-1]) / 2, self.row_counts)
        altitudes = (self.row_altitude_edges[1:] + self.row_altitude_edges[:-1]) / 2
        altitudes[-1] = math.pi / 2
        row = np.repeat(np.arange(len(self.row_counts)), self.row_counts)
        turn = (np.arange(self.count) - self.row_offsets[row] + 0.5) / self.row_counts[row]
        self.directions: Float64 = _unit_vectors(altitudes[row], 2 * math.pi * turn)
        order = {1: 10, 2: 4}.get(m, 2)  # the larger the bins, the more nodes
        self.smooth, self.steep = self._quadrature(order), self._quadrature(max(order, STEEP_ORDER))
        self.steep_cosine = math.cos(STEEP_ANGLE_RAD + self.row_altitude_edges[1])

    def index(self, directions: Float64) -> Int32:
        """Bin of each direction (N, 3), unit vectors -> (N,); -1 below the horizon."""
        altitude = np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))
        row = np.clip(np.searchsorted(self.row_altitude_edges, altitude, side="right") - 1, 0, len(self.row_counts) - 1)
        turn = np.arctan2(directions[:, 1], directions[:, 0]) / (2 * math.pi) % 1.0
        column = np.minimum(turn * self.row_counts[row], self.row_counts[row] - 1).astype(np.int32)
        return np.where(altitude < 0, -1, self.row_offsets[row] + column).astype(np.int32)

    def mean(self, luminance: Callable[[Floats], Floats], steep: Float64) -> Floats:
        """Mean over each bin's solid angle (count,) of luminance(unit vectors (N, 3)) -> (N,).

        steep: unit vector (3,) around which, as along the horizon, the sky changes so much within a bin that more nodes
        are taken.
        """
        mean = _weighted(luminance, *self.smooth)
        is_steep = self.directions @ steep > self.steep_cosine
        is_steep[: self.row_counts[0]] = True
        mean[is_steep] = _weighted(luminance, self.steep[0][is_steep], self.steep[1][is_steep])
        return mean

    def _quadrature(self, order: int) -> tuple[Float64, Float64]:
        """Unit vectors (count, order², 3) and weights (count, order²), summing to 1 a bin, for means over its solid
        angle: Gauss-Legendre in sin(altitude) and azimuth."""
        node, weight = np.polynomial.legendre.leggauss(order)
        node, weight = (node + 1) / 2, weight / 2
        row = np.repeat(np.arange(len(self.row_counts)), self.row_counts)
        sines = np.sin(self.row_altitude_edges)
        height = np.arcsin(sines[:-1, None] + node * np.diff(sines)[:, None])[row]
        turn = (np.arange(self.count) - self.row_offsets[row])[:, None] + node
        azimuth = 2 * math.pi * turn / self.row_counts[row][:, None]
        azimuth[-1] = 2 * math.pi * (np.arange(order) + 0.5) / order  # Around the cap equal steps converge faster.
        weights = np.broadcast_to(np.outer(weight, weight).ravel(), (self.count, order * order)).copy()
        weights[-1] = np.repeat(weight / order, order)
        shape = (self.count, order, order)
        nodes = _unit_vectors(
            np.broadcast_to(height[:, :, None], shape).reshape(self.count, -1),
            np.broadcast_to(azimuth[:, None, :], shape).reshape(self.count, -1),
        )
        return nodes, weights


def _weighted(luminance: Callable[[Floats], Floats], nodes: Floats, weights: Floats) -> Floats:
    mean: Floats = np.einsum("ij,ij->i", luminance(nodes.reshape(-1, 3)).reshape(weights.shape), weights)
    return mean


def _unit_vectors(altitude: Float64, azimuth: Float64) -> Float64:
    """Unit vectors (..., 3) for altitudes and azimuths [rad] from +x towards +y."""
    across = np.cos(altitude)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(altitude)], axis=-1)

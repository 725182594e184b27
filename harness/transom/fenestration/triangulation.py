"""Directions measured on a grid: which three surround a direction, and with what weights."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SphericalTriangulation:
    """Delaunay's triangulation of directions (N, 3), z > 0: the convex hull of points on a sphere, without the faces
    of a point at the other pole [Renka 1997, ACM TOMS 23(3), section 2]."""

    directions: Float64

    @cached_property
    def triangles(self) -> Int64:
        """(F, 3), rows of `directions`."""
        points = np.vstack([self.directions, [[0.0, 0.0, -1.0]]])
        faces = ConvexHull(points, qhull_options="Qt QJ1e-9").simplices.astype(np.int64)
        return np.asarray(faces[(faces < len(self.directions)).all(axis=1)])

    @cached_property
    def _inverses(self) -> Float64:
        corners = self.directions[self.triangles]
        volumes = np.linalg.det(corners)
        flat = np.abs(volumes) < 1e-12
        corners = np.where(flat[:, None, None], np.eye(3), corners)
        return np.where(flat[:, None, None], np.nan, np.linalg.inv(np.swapaxes(corners, 1, 2)))

    def locate(self, direction: Float64) -> tuple[Int64, Float64]:
        """Corners (3,) of the triangle around a direction (3,), and its weights (3,), >= 0, their sum 1.

        Weights are those for which the corners' unit vectors add up to a multiple of the direction. They are linear in
        the projection from the centre of the sphere, so that light which passes straight, or is mirrored, is
        interpolated without error. A direction outside all triangles goes to the border of the nearest.
        """
        weights = self._inverses @ np.asarray(direction, np.float64)
        face = int(np.nanargmax(weights.min(axis=1)))
        found = np.maximum(weights[face], 0.0)
        return self.triangles[face], found / found.sum()

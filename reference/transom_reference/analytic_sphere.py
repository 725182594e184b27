"""A sphere made of triangles: its geometry, and the light in it by collocation with exact point-to-triangle factors.

In a sphere every point exchanges as much light with every other: what is reflected illuminates all of it alike,
Phi rho / (S (1 - rho)) [Sumpner 1892; Goebel 1967]. A polyhedron deviates from that between neighbouring triangles; the
mean over its own area is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]


@dataclass(frozen=True)
class Icosphere:
    """An icosahedron whose triangles were cut in four `level` times, vertices on the sphere.

    vertices (V, 3) [m]; triangles (T, 3), counter-clockwise from inside.
    """

    vertices: Float64
    triangles: Int32

    def corners(self) -> Float64:
        """(T, 3, 3) [m]."""
        return self.vertices[self.triangles]

    def areas(self) -> Float64:
        a, b, c = self.corners().transpose(1, 0, 2)
        return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    def centroids(self) -> Float64:
        return np.asarray(self.corners().mean(axis=1))

    def normals(self) -> Float64:
        """Unit normals (T, 3), inwards."""
        a, b, c = self.corners().transpose(1, 0, 2)
        vector = np.cross(b - a, c - a)
        return np.asarray(vector / np.linalg.norm(vector, axis=1, keepdims=True))


def icosphere(radius: float, level: int) -> Icosphere:
    """20 x 4^level triangles inscribed in a sphere about the origin."""
    golden = (1 + math.sqrt(5)) / 2
    vertices = [
        np.array(corner, np.float64)
        for s in (-1, 1)
        for t in (-golden, golden)
        for corner in ((0, s, t), (s, t, 0), (t, 0, s))
    ]
    edge = 2.0
    triangles = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if all(abs(np.linalg.norm(vertices[p] - vertices[q]) - edge) < 1e-9 for p, q in ((i, j), (j, k), (i, k)))
    ]
    vertices = [vertex / np.linalg.norm(vertex) for vertex in vertices]
    for _ in range(level):
        middle: dict[tuple[int, int], int] = {}
        finer = []
        for i, j, k in triangles:
            halves = []
            for p, q in ((i, j), (j, k), (k, i)):
                key = (min(p, q), max(p, q))
                if key not in middle:
                    middle[key] = len(vertices)
                    vertices.append((vertices[p] + vertices[q]) / np.linalg.norm(vertices[p] + vertices[q]))
                halves.append(middle[key])
            a, b, c = halves
            finer += [(i, a, c), (j, b, a), (k, c, b), (a, b, c)]
        triangles = finer
    points = np.array(vertices)
    rows = []
    for i, j, k in triangles:
        outward = np.dot(np.cross(points[j] - points[i], points[k] - points[i]), points[i]) > 0
        rows.append((i, k, j) if outward else (i, j, k))
    return Icosphere(radius * points, np.array(rows, np.int32))


def lamp_illuminance(points: Float64, normals: Float64, lamp: Float64, intensity_cd: float) -> Float64:
    """I cos(theta) / d² of an isotropic lamp at points (N, 3) with normals (N, 3) [lx]."""
    offsets = lamp - points
    distance2 = (offsets**2).sum(axis=1)
    return np.asarray(intensity_cd * np.maximum(np.einsum("ij,ij->i", offsets, normals), 0) / distance2**1.5)


def reflected_illuminance(
    sphere: Icosphere, points: Float64, normals: Float64, lamp: Float64, intensity_cd: float, reflectance: float
) -> Float64:
    """Illuminance [lx] of points (N, 3) just inside the polyhedron by reflected light alone.

    Triangles of constant radiosity, balanced at their centroids; the lamp's flux on each is exact, by its solid angle.
    The rows of the exchange are divided by their sums, which are 1 but for rounding.
    """
    centroids, own = sphere.centroids(), sphere.normals()
    exchange = point_to_triangles(centroids, own, sphere.corners())
    exchange /= exchange.sum(axis=1, keepdims=True)
    direct = intensity_cd * solid_angles(sphere.corners() - lamp) / sphere.areas()
    count = len(direct)
    radiosity = np.linalg.solve(np.eye(count) - reflectance * exchange, reflectance * direct)
    gather = point_to_triangles(points, normals, sphere.corners())
    return np.asarray(gather @ radiosity / gather.sum(axis=1))


def solid_angles(corners: Float64) -> Float64:
    """Solid angles (T,) [sr] of triangles (T, 3, 3) from the origin [Van Oosterom & Strackee 1983]."""
    a, b, c = corners.transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(edge, axis=1) for edge in (a, b, c))
    volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    below = la * lb * lc + lc * (a * b).sum(axis=1) + lb * (a * c).sum(axis=1) + la * (b * c).sum(axis=1)
    return np.asarray(2 * np.arctan2(volume, below))


def point_to_triangles(points: Float64, normals: Float64, corners: Float64) -> Float64:
    """Form factors (N, T) from points to triangles (T, 3, 3) wholly in front of them, by Lambert's contour integral."""
    result = np.zeros((len(points), len(corners)))
    for row, (point, normal) in enumerate(zip(points, normals, strict=True)):
        towards = corners - point
        towards = towards / np.linalg.norm(towards, axis=2, keepdims=True)
        total = np.zeros(len(corners))
        for k in range(3):
            start, end = towards[:, k], towards[:, (k + 1) % 3]
            across = np.cross(start, end)
            length = np.linalg.norm(across, axis=1)
            angle = np.arctan2(length, np.einsum("ij,ij->i", start, end))
            with np.errstate(divide="ignore", invalid="ignore"):
                total += np.where(length > 1e-12, angle / length * (across @ normal), 0.0)
        result[row] = np.abs(total) / (2 * math.pi)
        # The triangle that the point lies on, or just above, sends it nothing.
        result[row][(towards @ normal).max(axis=1) < 1e-9] = 0.0
    return result

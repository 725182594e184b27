"""Polygons to planar convex quads and triangles: what may stay a quad, and how everything else is cut."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Float64

PLANAR_TOLERANCE = 1e-5
"""Largest distance of a quad's fourth corner from the plane of the other three, per length of its diagonal."""

FLAT_TOLERANCE = 1e-9
"""Area per squared diameter below which a face counts as having none."""

STRAIGHT_TOLERANCE = 1e-7
"""Sine of the turn below which a corner counts as straight."""


def area_vector(points: Float64) -> Float64:
    """Normal of a polygon with corners (n, 3), as long as its area [m²] (Newell's sum)."""
    centred = points - points[0]
    total: Float64 = 0.5 * np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    return total


def diameter(points: Float64) -> float:
    """Diagonal of the bounding box [m]."""
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))


def has_no_area(points: Float64) -> bool:
    """Whether the polygon is a line or a point."""
    return float(np.linalg.norm(area_vector(points))) <= FLAT_TOLERANCE * diameter(points) ** 2


def is_plain(points: Float64) -> NDArray[np.bool_]:
    """Which of the triangles (N, 3, 3) or quads (N, 4, 3) can stay as they are: with area, planar, strictly convex.

    The same tests as `has_no_area` and `split_polygon`, for many faces at once.
    """
    centred = points - points[:, :1]
    normal = 0.5 * np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
    area = np.linalg.norm(normal, axis=1)
    size = np.linalg.norm(points.max(axis=1) - points.min(axis=1), axis=1)
    plain: NDArray[np.bool_] = area > FLAT_TOLERANCE * size**2
    if points.shape[1] == 3:
        return plain
    before, after = points - np.roll(points, 1, axis=1), np.roll(points, -1, axis=1) - points
    turn = np.einsum("fcd,fd->fc", np.cross(before, after), normal)
    scale = area[:, None] * np.linalg.norm(before, axis=2) * np.linalg.norm(after, axis=2)
    plane = np.cross(centred[:, 1], centred[:, 2])
    offset = np.abs(np.einsum("fd,fd->f", centred[:, 3], plane))
    planar = offset <= PLANAR_TOLERANCE * size * np.linalg.norm(plane, axis=1)
    convex: NDArray[np.bool_] = np.all(turn > STRAIGHT_TOLERANCE * scale, axis=1)
    stays: NDArray[np.bool_] = plain & planar & convex
    return stays


def without_repeats(corners: tuple[int, ...]) -> list[int]:
    """Positions of the corners that differ from the one before, so that a quad a, b, c, c becomes a triangle."""
    kept = [i for i in range(len(corners)) if corners[i] != corners[i - 1]]
    return kept if len(kept) >= 3 else list(range(len(corners)))


def split_polygon(points: Float64) -> list[tuple[int, ...]]:
    """Faces as positions in `points` (n, 3): one triangle, one planar convex quad, or triangles.

    Quads that are bent, concave or have a straight corner are cut through the corner where that gives two proper
    triangles. Polygons of more corners are fan triangulated when convex, otherwise by cutting ears
    [Meisters 1975, "Polygons have ears"]; cut-offs without area are left out.
    """
    count = len(points)
    if count == 3:
        return [(0, 1, 2)]
    if count == 4:
        return _split_quad(points)
    if len(_weak_corners(points)) == 0:
        return [(0, i, i + 1) for i in range(1, count - 1)]
    return _cut_ears(points)


def _split_quad(points: Float64) -> list[tuple[int, ...]]:
    weak = _weak_corners(points)
    if len(weak) == 1:
        first = int(weak[0])
        a, b, c, d = ((first + step) % 4 for step in range(4))
        return [(a, b, c), (a, c, d)]
    plane = np.cross(points[1] - points[0], points[2] - points[0])
    height = abs(float(np.dot(points[3] - points[0], plane))) / max(float(np.linalg.norm(plane)), 1e-300)
    if len(weak) == 0 and height <= PLANAR_TOLERANCE * diameter(points):
        return [(0, 1, 2, 3)]
    return _proper([(0, 1, 2), (0, 2, 3)], points)


def _weak_corners(points: Float64) -> NDArray[np.intp]:
    """Positions of the corners that are straight or reflex, seen along the polygon's mean normal."""
    normal = area_vector(points)
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    turn = np.cross(before, after) @ normal
    scale = float(np.linalg.norm(normal)) * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    return np.flatnonzero(turn <= STRAIGHT_TOLERANCE * scale)


def _proper(triangles: list[tuple[int, ...]], points: Float64) -> list[tuple[int, ...]]:
    """The triangles that have an area."""
    return [triangle for triangle in triangles if not has_no_area(points[list(triangle)])]


def _cut_ears(points: Float64) -> list[tuple[int, ...]]:
    normal = area_vector(points)
    normal = normal / np.linalg.norm(normal)
    # Coordinates in the polygon's mean plane.
    side = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    side = side / np.linalg.norm(side)
    flat = np.stack([points @ side, points @ np.cross(normal, side)], axis=1)

    def turn(a: int, b: int, c: int) -> float:
        u, v = flat[b] - flat[a], flat[c] - flat[a]
        return float(u[0] * v[1] - u[1] * v[0])

    remaining = list(range(len(points)))
    triangles: list[tuple[int, ...]] = []
    while len(remaining) > 3:
        best, best_quality = 0, -np.inf
        for i in range(len(remaining)):
            a, b, c = remaining[i - 1], remaining[i], remaining[(i + 1) % len(remaining)]
            others = [p for p in remaining if p not in (a, b, c)]
            inside = any(turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in others)
            # The roundest ear that holds no other corner; a straight corner scores 0, a reflex one less.
            longest = max(float(np.sum((flat[p] - flat[q]) ** 2)) for p, q in ((a, b), (b, c), (c, a)))
            quality = turn(a, b, c) / max(longest, 1e-300) - (10.0 if inside else 0.0)
            if quality > best_quality:
                best, best_quality = i, quality
        triangles.append((remaining[best - 1], remaining[best], remaining[(best + 1) % len(remaining)]))
        del remaining[best]
    triangles.append((remaining[0], remaining[1], remaining[2]))
    return _proper(triangles, points)


def triangle_distances(point: Float64, corners: Float64) -> Float64:
    """Distance (T,) of a point (3,) from triangles (T, 3, 3) [Ericson 2005, Real-Time Collision Detection, 5.1.5]."""
    start, along = corners, np.roll(corners, -1, axis=1) - corners
    length2 = np.einsum("tkd,tkd->tk", along, along)
    share = np.einsum("tkd,tkd->tk", point - start, along) / np.where(length2 > 0, length2, 1.0)
    nearest = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
    to_edges = np.linalg.norm(nearest - point, axis=2).min(axis=1)
    normal = np.cross(along[:, 0], along[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    inward = np.einsum("tkd,tkd->tk", np.cross(normal[:, None, :], along), point - start)
    height = np.abs(np.einsum("td,td->t", point - corners[:, 0], normal))
    distances: Float64 = np.where(np.all(inward >= 0, axis=1), height, to_edges)
    return distances

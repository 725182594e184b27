"""Looks for open walls: light that enters through the openings must not find another way out of the building.

Rays leave the room side of every opening and are reflected in random directions a few times. A ray that meets neither
a surface nor an opening has found a hole that nobody declared: daylight that falls in there would be missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Float64, Mesh

TriangleIndex = NDArray[np.intp]

BOUNCE_COUNT = 3
SEED = 20080321
COVER_M = 0.01
"""A surface this near to an opening covers it; in models below 10 m across, 1 / 1000 of that size."""
BLOCK = 128
"""Triangles of a block."""
CHUNK = 16
"""Rays at once: their table of edge sides stays in the processor's cache for a few thousand triangles."""


@dataclass(frozen=True)
class Escape:
    """What rays of one opening met, as shares of the rays.

    share: left the building; origin, direction: of one such ray. outdoor_share: from the outdoor side, met nothing.
    covered_share: started where another surface lies within COVER_M of the opening.
    """

    share: float
    outdoor_share: float
    covered_share: float
    origin: Float64
    direction: Float64


class TriangleRays:
    """Nearest hits of rays with all triangles of a mesh, by Plücker coordinates, in double precision.

    A mesh of more than `block_triangles` triangles is looked through in blocks of neighbours, of which a ray tests
    those whose bounding boxes it meets: the same hits in time that grows with the blocks, not with the triangles.
    """

    def __init__(self, mesh: Mesh, block_triangles: int = 8192) -> None:
        self.mesh = mesh
        self.triangles, self.source = mesh.triangles()
        self.centre = mesh.vertices.mean(axis=0)
        corners = (mesh.vertices - self.centre)[self.triangles]
        self.scale = float(np.abs(corners).max())
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self.offsets = np.einsum("ij,ij->i", self.normals, corners[:, 0])
        edges = []
        for k in range(3):
            start, end = corners[:, k], corners[:, (k + 1) % 3]
            edges.append(np.concatenate([np.cross(start, end), end - start], axis=1).T)
        self.edges = edges
        self.blocks: NDArray[np.intp] | None = None
        if len(corners) > block_triangles:
            self._make_blocks(corners)

    def _make_blocks(self, corners: Float64) -> None:
        """Blocks (B, BLOCK) of triangles, -1 where there are no more, along Morton's curve, and their boxes."""
        middle = corners.mean(axis=1)
        low = middle.min(axis=0)
        cell = (1023.999 * (middle - low) / max(float(np.ptp(middle, axis=0).max()), 1e-30)).astype(np.int64)
        curve = np.zeros(len(cell), dtype=np.int64)
        for bit in range(10):
            for axis in range(3):
                curve |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
        order = np.argsort(curve, kind="stable")
        count = -(-len(order) // BLOCK)
        self.blocks = np.full((count, BLOCK), -1, dtype=np.intp)
        self.blocks.reshape(-1)[: len(order)] = order
        first = np.arange(count) * BLOCK
        margin = 1e-6 * self.scale
        self.low = np.minimum.reduceat(corners.min(axis=1)[order], first) - margin
        self.high = np.maximum.reduceat(corners.max(axis=1)[order], first) + margin

    def _near_triangles(self, origin: Float64, direction: Float64) -> TriangleIndex:
        """Triangles of the blocks whose boxes a ray meets [slabs after Kay & Kajiya 1986]."""
        assert self.blocks is not None
        with np.errstate(divide="ignore", invalid="ignore"):
            to_low, to_high = (self.low - origin) / direction, (self.high - origin) / direction
        enters = np.fmax.reduce(np.fmin(to_low, to_high), axis=1)
        leaves = np.fmin.reduce(np.fmax(to_low, to_high), axis=1)
        chosen = self.blocks[(leaves >= 0) & (enters <= leaves)].ravel()
        near: TriangleIndex = chosen[chosen >= 0]
        return near

    def nearest(
        self, origins: Float64, directions: Float64, ignored: NDArray[np.bool_] | None = None
    ) -> tuple[Float64, TriangleIndex]:
        """Distances (N,) [m], infinite without a hit, and triangle indices (N,) of rays beyond 1e-6 of the scene.

        ignored: (T,) triangles that rays pass through.
        """
        distances, hits = np.empty(len(origins)), np.empty(len(origins), dtype=np.intp)
        if self.blocks is not None:
            for ray, origin in enumerate(origins - self.centre):
                near = self._near_triangles(origin, directions[ray])
                part = slice(ray, ray + 1)
                distances[part], found = self._nearest(origin[None], directions[part], ignored, near)
                hits[part] = near[found] if len(near) else 0
            return distances, hits
        for begin in range(0, len(origins), CHUNK):
            part = slice(begin, begin + CHUNK)
            distances[part], hits[part] = self._nearest(origins[part] - self.centre, directions[part], ignored)
        return distances, hits

    def _nearest(
        self,
        origins: Float64,
        directions: Float64,
        ignored: NDArray[np.bool_] | None,
        chosen: TriangleIndex | slice = slice(None),
    ) -> tuple[Float64, TriangleIndex]:
        """Of the chosen triangles, numbered among themselves."""
        all_normals, offsets = self.normals[chosen], self.offsets[chosen]
        line = np.concatenate([directions, np.cross(origins, directions)], axis=1)
        # A line passes on one side of all three edges; the margin closes the cracks between neighbours.
        margin = 1e-9 * self.scale**2
        first, second, third = (line @ edge[:, chosen] for edge in self.edges)
        lowest = np.minimum(np.minimum(first, second), third)
        highest = np.maximum(np.maximum(first, second), third)
        ray, triangle = np.nonzero((lowest >= -margin) | (highest <= margin))
        normals = all_normals[triangle]
        speed = np.einsum("ij,ij->i", directions[ray], normals)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (offsets[triangle] - np.einsum("ij,ij->i", origins[ray], normals)) / speed
        met = (np.abs(speed) > 1e-12) & (distance > 1e-6 * self.scale)
        if ignored is not None:
            met &= ~ignored[chosen][triangle]
        ray, triangle, distance = ray[met], triangle[met], distance[met]
        # Written from far to near, the nearest hit of each ray is the one that stays.
        order = np.argsort(-distance)
        nearest = np.full(len(origins), np.inf)
        hit = np.zeros(len(origins), dtype=np.intp)
        nearest[ray[order]], hit[ray[order]] = distance[order], triangle[order]
        return nearest, hit


def find_escape(rays: TriangleRays, opening_material: int, opening_materials: frozenset[int], ray_count: int) -> Escape:
    """Walks light from the room side of one opening group and reports what leaves the building elsewhere.

    The random numbers have a fixed seed: the same scene gives the same answer.
    """
    random = np.random.default_rng(SEED)
    triangle_material = rays.mesh.face_material[rays.source]
    is_opening = np.isin(triangle_material, list(opening_materials))
    own = np.flatnonzero(triangle_material == opening_material)
    corners = rays.mesh.vertices[rays.triangles[own]]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = random.choice(len(own), ray_count, p=area / area.sum())
    u, v = np.sqrt(random.random(ray_count)), random.random(ray_count)
    weights = np.stack([1.0 - u, u * (1.0 - v), u * v], axis=1)
    start = np.einsum("nk,nkd->nd", weights, corners[chosen])
    normals = rays.normals[own[chosen]]

    outward = _diffuse(normals, random)
    outdoor_share = float(np.mean(np.isinf(rays.nearest(start, outward)[0])))
    near = min(COVER_M, 0.002 * rays.scale)
    through = rays.nearest(start + near * normals, -normals, is_opening)[0]
    covered_share = float(np.mean(through <= 2.0 * near))
    origins, directions = start, _diffuse(-normals, random)
    escaped_from, escaped_to = [], []
    for _ in range(BOUNCE_COUNT + 1):
        distance, hit = rays.nearest(origins, directions)
        gone = np.isinf(distance)
        escaped_from.append(origins[gone])
        escaped_to.append(directions[gone])
        stays = ~gone & ~is_opening[hit]
        if not stays.any():
            break
        facing = rays.normals[hit[stays]]
        against = np.einsum("ij,ij->i", facing, directions[stays]) > 0.0
        facing = np.where(against[:, None], -facing, facing)
        origins = origins[stays] + distance[stays, None] * directions[stays]
        directions = _diffuse(facing, random)
    origin, direction = np.concatenate(escaped_from), np.concatenate(escaped_to)
    share = len(origin) / ray_count
    if len(origin) == 0:
        origin, direction = start, directions
    return Escape(share, outdoor_share, covered_share, origin[0], direction[0])


def _diffuse(normals: Float64, random: np.random.Generator) -> Float64:
    """Directions (N, 3) about unit normals (N, 3), distributed as the cosine: a normal plus a point of the sphere."""
    sphere = random.normal(size=normals.shape)
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    # The factor keeps the sum away from zero.
    direction = normals + (1.0 - 1e-6) * sphere
    unit: Float64 = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return unit

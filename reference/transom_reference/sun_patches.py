"""Points that the sun lights through the openings: traced from the openings once a batch, then connected to paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from transom_reference.light_along import LightAlong, facing, gather4, offset
from transom_reference.mitsuba_setup import dr, mi
from transom_reference.transport_scene import TransportScene

POINT_COUNT = 1 << 17
"""Points traced for each batch: far more than the samples that one pixel takes, so that pixels are nearly independent."""

PILOT_SEED = 0x5EED


@dataclass(frozen=True)
class SunPatches:
    """Lit points, in an order that follows each opening from place to place (nearby entries are nearby points).

    table: flat (count, 12): place, density [1/m²]; normal towards the sun, 0; radiance rgb, 0. valid_share: lit points
    over traced points of this batch. multiplicity: weight of connections in the balance heuristic, traced over lit
    points of an independent pilot, so that it is a constant of the scene.
    """

    table: Any
    count: Any
    valid_share: Any
    multiplicity: Any

    @classmethod
    def trace(cls, scene: TransportScene, seed: int) -> SunPatches | None:
        """Lit points of a batch, or None when the sun lights nothing through any opening."""
        pilot, pilot_count = _lit_points(scene, PILOT_SEED)
        if pilot_count == 0:
            return None
        table, count = _lit_points(scene, seed + 1)
        if count == 0:
            table, count = dr.zeros(mi.Float, 12), 1
        return cls(
            table,
            dr.opaque(mi.UInt32, count),
            dr.opaque(mi.Float, count / POINT_COUNT),
            dr.opaque(mi.Float, POINT_COUNT / pilot_count),
        )

    def choose(self, choice: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        """Place, normal, reflected radiance and area density of a random lit point."""
        index = dr.minimum(mi.UInt32(choice * mi.Float(self.count)), self.count - 1) * 3
        place = gather4(self.table, index, active)
        normal = gather4(self.table, index + 1, active)
        radiance = gather4(self.table, index + 2, active)
        return mi.Point3f(place.xyz), mi.Normal3f(normal.xyz), mi.Color3f(radiance.xyz), place.w


def _lit_points(scene: TransportScene, seed: int) -> tuple[Any, int]:
    assert scene.sun_direction is not None
    portal, u, v = _starts(scene.sun_portal_probability, seed)
    corner, edge_u, edge_v = (
        np.array([getattr(entry, part) for entry in scene.portals])[portal] for part in ("corner", "edge_u", "edge_v")
    )
    is_triangle = np.array([entry.is_triangle for entry in scene.portals])[portal]
    fold = is_triangle & (u + v > 1)
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    start = corner + u[:, None] * edge_u + v[:, None] * edge_v
    sun = mi.Vector3f(*map(float, scene.sun_direction))
    colour = mi.Color3f(*map(float, scene.sun_illuminance))
    dr.make_opaque(sun, colour)
    rows = _light(scene, LightAlong(scene), mi.Point3f(np.ascontiguousarray(start.T, dtype=np.float32)), sun, colour)
    table = np.stack([np.array(part) for part in rows], axis=1)
    table = table[table[:, 8:11].sum(axis=1) > 0]
    return mi.Float(np.ascontiguousarray(table).ravel()), len(table)


def _starts(probability: Any, seed: int) -> tuple[Any, Any, Any]:
    """Portal and place (u, v) of each point: stratified over portals, in Morton order within each."""
    generator = np.random.default_rng([seed & 0xFFFFFFFF, 0xB1A5])
    level = (np.arange(POINT_COUNT) + generator.random(POINT_COUNT)) / POINT_COUNT
    cumulative = np.cumsum(probability)
    portal = np.searchsorted(cumulative / cumulative[-1], level, side="right").clip(0, len(probability) - 1)
    u, v = generator.random(POINT_COUNT), generator.random(POINT_COUNT)
    order = np.lexsort((_spread(u) | (_spread(v) << np.uint64(1)), portal))
    return portal[order], u[order], v[order]


def _spread(value: Any) -> Any:
    """Bits of a number in [0, 1) at even positions (Morton code), 16 bits deep."""
    bits = (value * 65536).astype(np.uint64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
    return bits


def _light(scene: TransportScene, light: LightAlong, start: Any, sun: Any, colour: Any) -> list[Any]:
    """The first opaque surface down the beam from each start, and what the sun makes of it: twelve columns."""
    found = scene.opaque.ray_intersect_preliminary(mi.Ray3f(start, -sun))
    hit = found.is_valid()
    triangle = found.prim_index
    corner = gather4(scene.triangles, triangle * 3, hit)
    edge_1 = gather4(scene.triangles, triangle * 3 + 1, hit)
    edge_2 = gather4(scene.triangles, triangle * 3 + 2, hit)
    u, v = found.prim_uv.x, found.prim_uv.y
    point = mi.Point3f(corner.xyz + u * edge_1.xyz + v * edge_2.xyz)
    normal = facing(dr.normalize(dr.cross(edge_1.xyz, edge_2.xyz)), -sun)
    shading = normal
    if scene.normals is not None:
        smooth = hit & (edge_1.w > 0.5)
        a, b, c = (dr.gather(mi.Normal3f, scene.normals, triangle * 3 + k, smooth) for k in range(3))
        blended = dr.normalize((1.0 - u - v) * a + u * b + v * c)
        shading = dr.select(smooth, dr.select(dr.dot(blended, normal) < 0.0, -blended, blended), normal)
    reflectance = mi.Color3f(gather4(scene.materials, mi.UInt32(corner.w) * 2, hit).xyz)
    outside = offset(point, normal)
    passed, density = light.sun(outside, sun, hit)
    cosine, true_cosine = dr.maximum(dr.dot(shading, sun), 0.0), dr.dot(normal, sun)
    lit = hit & (density > 0.0) & (true_cosine > 0.0)
    radiance = dr.select(lit, reflectance * colour * (passed * cosine * float(1 / np.pi)), 0.0)
    zero = dr.zeros(mi.Float, dr.width(point))
    return [*outside, density * true_cosine, *normal, zero, *radiance, zero]

"""Points that the sun lights through the openings: traced from the openings once a batch, then connected to paths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from transom_reference.light_along import LightAlong
from transom_reference.mitsuba_setup import dr, floats, mi, points
from transom_reference.surface import gather4, offset, surface_at
from transom_reference.transport_scene import TransportScene

POINT_COUNT = 1 << 17
"""Points traced for each batch: far more than one pixel uses, so that pixels are nearly independent."""

PILOT_SEED = 0x5EED

SHARE = 8.0
"""Weight of connections against rays, in units of one point chosen evenly."""


Reaches = Callable[[Any, Any], tuple[Any, Any]]
"""(points, active) -> how much of the beam arrives there, and its density of starts, per m² across it."""


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
    def trace(cls, scene: TransportScene, light: LightAlong, seed: int, multiplicity: float) -> SunPatches:
        """Lit points of a batch. multiplicity: `pilot_multiplicity` of the scene."""
        table, count = _lit_points(scene, light, seed)
        if count == 0:
            table, count = dr.zeros(mi.Float, 12), 1
        return cls(
            table,
            dr.opaque(mi.UInt32, count),
            dr.opaque(mi.Float, count / POINT_COUNT),
            dr.opaque(mi.Float, SHARE * multiplicity),
        )

    def choose(self, choice: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        """Place, normal, reflected radiance and area density of a random lit point."""
        index = dr.minimum(mi.UInt32(choice * mi.Float(self.count)), self.count - 1) * 3
        place = gather4(self.table, index, active)
        normal = gather4(self.table, index + 1, active)
        radiance = gather4(self.table, index + 2, active)
        return mi.Point3f(place.xyz), mi.Normal3f(normal.xyz), mi.Color3f(radiance.xyz), place.w


def pilot_multiplicity(scene: TransportScene, light: LightAlong) -> float:
    """Traced over lit points, or 0 when the sun lights nothing through any opening."""
    if not scene.sun_starts_probability.any():
        return 0.0
    _, count = _lit_points(scene, light, PILOT_SEED)
    return POINT_COUNT / count if count else 0.0


def _lit_points(scene: TransportScene, light: LightAlong, seed: int) -> tuple[Any, int]:
    assert scene.sun_direction is not None
    start, row = portal_starts(scene, scene.sun_starts_probability, POINT_COUNT, seed)
    straight = int(np.searchsorted(row, len(scene.portals)))
    parts = [_straight_points(scene, light, start[:straight], seed)] if straight else []
    if straight < POINT_COUNT:
        parts.append(_beam_points(scene, light, start[straight:], row[straight:] // len(scene.portals) - 1))
    table = np.concatenate(parts)
    table = table[table[:, 8:11].sum(axis=1) > 0]
    return floats(table), len(table)


def _straight_points(scene: TransportScene, light: LightAlong, start: Any, seed: int) -> Any:
    """Points that the sun lights through clear openings, rows (N, 12); dark ones have no radiance."""
    assert scene.sun_direction is not None
    sun = mi.Vector3f(*map(float, scene.sun_direction))
    colour = mi.Color3f(*map(float, scene.sun_illuminance))
    dr.make_opaque(sun, colour)
    if scene.sun_radius_rad > 0.0:
        generator = np.random.default_rng([seed & 0xFFFFFFFF, 0x5D15C])
        sun = sun_disc_direction(scene, floats(generator.random(POINT_COUNT)), floats(generator.random(POINT_COUNT)))

    def reaches(outside: Any, hit: Any) -> tuple[Any, Any]:
        return light.sun(outside, sun, hit)

    return _light(scene, mi.Point3f(*points(start)), sun, colour, reaches)


def _beam_points(scene: TransportScene, light: LightAlong, start: Any, beam: Any) -> Any:
    """The same for the panels' beams; beam: index of each start."""
    assert scene.panels is not None
    directions = np.array([entry.direction for entry in scene.panels.beams])[beam]
    colours = np.array([entry.normal_rgb for entry in scene.panels.beams])[beam]
    index = mi.UInt32(floats(beam))

    def reaches(outside: Any, hit: Any) -> tuple[Any, Any]:
        return light.beam(outside, index, hit)

    against = -mi.Vector3f(*points(directions))
    return _light(scene, mi.Point3f(*points(start)), against, mi.Color3f(*points(colours)), reaches)


def sun_disc_direction(scene: TransportScene, u: Any, v: Any) -> Any:
    """Direction towards a point of the sun's disc for two numbers in 0..1, uniform in solid angle.

    1 - cos is computed as it is, since it is of the size of float32's rounding.
    """
    assert scene.sun_direction is not None
    cap = 2.0 * float(np.sin(0.5 * scene.sun_radius_rad)) ** 2 * u
    sine = dr.sqrt(cap * (2.0 - cap))
    local = mi.Vector3f(sine * dr.cos(2 * np.pi * v), sine * dr.sin(2 * np.pi * v), 1.0 - cap)
    return dr.normalize(mi.Frame3f(mi.Vector3f(*map(float, scene.sun_direction))).to_world(local))


def portal_starts(scene: TransportScene, probability: Any, count: int, seed: int) -> tuple[Any, Any]:
    """Points (count, 3) on the portals, and the rows of `probability` that they are for (count,).

    probability: by portal, or by beam and portal. Stratified, in Morton order within each row.
    """
    generator = np.random.default_rng([seed & 0xFFFFFFFF, 0xB1A5])
    level = (np.arange(count) + generator.random(count)) / count
    cumulative = np.cumsum(probability)
    row = np.searchsorted(cumulative / cumulative[-1], level, side="right").clip(0, len(probability) - 1)
    u, v = generator.random(count), generator.random(count)
    order = np.lexsort((morton(np.stack([u, v], axis=1)), row))
    row, u, v = row[order], u[order], v[order]
    portal = row % len(scene.portals)
    corner, edge_u, edge_v = (
        np.array([getattr(entry, part) for entry in scene.portals])[portal] for part in ("corner", "edge_u", "edge_v")
    )
    fold = np.array([entry.is_triangle for entry in scene.portals])[portal] & (u + v > 1)
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    return corner + u[:, None] * edge_u + v[:, None] * edge_v, row


def morton(places: Any) -> Any:
    """Morton codes (N,) of places (N, 2 or 3) in [0, 1]: nearby codes are nearby places."""
    dimensions = places.shape[1]
    bits = 60 // dimensions // 2
    whole = np.minimum((places * (1 << bits)).astype(np.uint64), np.uint64((1 << bits) - 1))
    code = np.zeros(len(places), dtype=np.uint64)
    for bit in range(bits):
        for axis in range(dimensions):
            found = (whole[:, axis] >> np.uint64(bit)) & np.uint64(1)
            code |= found << np.uint64(bit * dimensions + axis)
    return code


def _light(scene: TransportScene, start: Any, sun: Any, colour: Any, reaches: Reaches) -> Any:
    """The first opaque surface down the beam from each start, and what the sun makes of it: rows of twelve."""
    found = scene.opaque.ray_intersect_preliminary(mi.Ray3f(start, -sun))
    hit = found.is_valid()
    surface = surface_at(scene, found, -sun, hit)
    normal, shading, reflectance = surface.normal, surface.shading, surface.reflectance
    outside = offset(surface.point, normal)
    passed, density = reaches(outside, hit)
    cosine, true_cosine = dr.maximum(dr.dot(shading, sun), 0.0), dr.dot(normal, sun)
    lit = hit & (density > 0.0) & (true_cosine > 0.0)
    radiance = dr.select(lit, reflectance * colour * (passed * cosine * float(1 / np.pi)), 0.0)
    zero = dr.zeros(mi.Float, dr.width(normal))
    rows = [*outside, density * true_cosine, *normal, zero, *radiance, zero]
    dr.eval(rows)
    return np.stack([np.array(part) for part in rows], axis=1)

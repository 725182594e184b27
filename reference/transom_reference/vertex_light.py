"""What lights a diffuse vertex of a path, besides what its own ray finds: sun, openings, lit points, point sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from transom_reference.light_along import LightAlong
from transom_reference.light_vertices import LightVertices
from transom_reference.low_discrepancy import pair
from transom_reference.mitsuba_setup import dr, mi
from transom_reference.panels import outward_direction, panel_side
from transom_reference.resampling import resample
from transom_reference.sun_patches import SunPatches, sun_disc_direction
from transom_reference.surface import gather4, offset
from transom_reference.transport_scene import TransportScene

INVERSE_PI = float(1.0 / np.pi)
SUN_DIMENSION = 1 << 16
"""Pair number of the place on the sun's disc at step 0: beyond those of all other choices."""

PANEL_DIMENSION = 1 << 17
"""Pair number, at step 0, of the direction from which light reaches a panel."""

DIMENSION_PAIRS = 6
"""Pairs of numbers that one step of a path uses."""

VERTEX_CANDIDATES = 2
PATCH_CANDIDATES = 8
"""Light vertices and sun patches among which one is chosen for a connection, by what it would bring if visible."""

VERTEX_CONNECTIONS = 4
"""Light vertices to which a vertex of a path is connected. Whether they are seen is most of the noise where much of a
room is hidden from its brightest places."""


@dataclass(frozen=True)
class Batch:
    """What all paths of one batch share. seed: UInt32, opaque."""

    seed: Any
    patches: SunPatches | None
    vertices: LightVertices | None


@dataclass
class Vertex:
    """A diffuse point of a path, by lane. factor: throughput x reflectance / pi. indoors: connections apply."""

    active: Any
    point: Any
    outside: Any
    normal: Any
    shading: Any
    factor: Any
    indoors: Any
    step: Any
    sample: Any


class VertexLight:
    """Estimates of the light from one kind of source at a vertex, times the vertex's factor, RGB by lane."""

    def __init__(
        self,
        scene: TransportScene,
        light: LightAlong,
        batch: Batch,
        seed: Any,
        log2_samples: int,
        connection_density: Any,
    ) -> None:
        self.scene, self.light, self.batch = scene, light, batch
        self.seed, self.log2_samples, self.connection_density = seed, log2_samples, connection_density
        self.sun_illuminance = mi.Color3f(*map(float, scene.sun_illuminance))
        if scene.sun_direction is not None:
            self.sun_direction = mi.Vector3f(*map(float, scene.sun_direction))
            dr.make_opaque(self.sun_direction, self.sun_illuminance)

    def _numbers(self, here: Vertex, pair_index: int) -> tuple[Any, Any]:
        return pair(self.seed, here.step * DIMENSION_PAIRS + pair_index, here.sample, self.log2_samples)

    def sun_disc(self, direction: Any) -> Any:
        """Radiance of the sun's disc in a direction, 0 beside it."""
        radius = self.scene.sun_radius_rad
        # The chord is exact in float32 where the cosine is not.
        inside = dr.squared_norm(direction - self.sun_direction) < (2.0 * float(np.sin(0.5 * radius))) ** 2
        return dr.select(inside, self.sun_illuminance * float(1.0 / (np.pi * np.sin(radius) ** 2)), 0.0)

    def sun(self, here: Vertex, arrival: Any, may_be_connected: Any) -> Any:
        """Direct sun; with the ray's share by the balance heuristic where a connection could have brought it."""
        sun = self.sun_direction
        if self.scene.sun_radius_rad > 0.0:
            numbers = pair(self.seed, mi.UInt32(SUN_DIMENSION) + here.step, here.sample, self.log2_samples)
            sun = sun_disc_direction(self.scene, *numbers)
        cosine, true_cosine = dr.dot(here.shading, sun), dr.dot(here.normal, sun)
        lit = here.active & (cosine > 0.0) & (true_cosine > 0.0)
        passed, density = self.light.sun(here.outside, sun, lit)
        share = mi.Float(1.0)
        if self.batch.patches is not None:
            connection = self.batch.patches.multiplicity * density * true_cosine
            share = dr.select(may_be_connected & (density > 0.0), arrival / (arrival + connection), 1.0)
        return dr.select(lit & (passed > 0.0), here.factor * self.sun_illuminance * (passed * cosine * share), 0.0)

    def sky_by_portal(self, here: Vertex) -> tuple[Any, Any]:
        """Sky and ground through a sampled point of an opening, and the sum of the openings' weights."""
        choice, _ = self._numbers(here, 1)
        u, v = self._numbers(here, 2)
        portal, target, weight = self.light.portal_point(choice, u, v, here.point, here.shading, here.active)
        towards, _, cosine, seen = _towards(here, target)
        seen &= weight > 0.0
        passed, through_probability, portal_density = self.light.outward(
            here.outside, towards, here.point, here.shading, weight, seen
        )
        ray_density = cosine * INVERSE_PI * through_probability
        seen = seen & (passed > 0.0) & (portal_density > 0.0)
        arriving = self.light.beyond(towards, seen) * (passed * cosine / (portal_density + ray_density))
        found = dr.select(seen, here.factor * arriving, 0.0)
        if self.scene.panels is not None:
            found = found + self._panel(here, portal, target, weight)
        return found, weight

    def _panel(self, here: Vertex, portal: Any, target: Any, weight: Any) -> Any:
        """What a panel sends here from a sampled point: the sun's residual, and sky and ground through its BTDF."""
        scene, light = self.scene, self.light
        assert scene.panels is not None
        towards, squared, cosine, seen = _towards(here, target)
        side = panel_side(scene.panels, portal, towards, seen & (weight > 0.0))
        last_row = gather4(scene.portal_table, portal * 4 + 3, side.active)
        normal, along = last_row.xyz, dr.dot(last_row.xyz, towards)
        density = light.density_at(portal, target, along, here.point, here.shading, weight, side.active)
        side.active &= density > 0.0
        passed, probability = light.between(here.outside, towards, dr.sqrt(squared), side.active)
        side.active &= passed > 0.0
        ray_density = cosine * INVERSE_PI * probability
        arriving = light.panel_sun(side, target, normal) / (density + ray_density)

        dimension = mi.UInt32(PANEL_DIMENSION) + here.step
        numbers = pair(self.seed, dimension, here.sample, self.log2_samples)
        outward = outward_direction(scene.panels, side, *numbers)
        clear, onward = light.unhindered(offset(target, normal), outward, side.active & (side.share > 0.0))
        room = dr.gather(mi.Float, scene.room_reflectance, mi.UInt32(last_row.w), side.active)
        through_probability = side.share / dr.maximum(side.share + room, 1e-12) * onward
        sky = light.beyond(outward, side.active & (clear > 0.0)) * (clear * side.share)
        arriving = arriving + dr.select(clear > 0.0, sky / (density + ray_density * through_probability), 0.0)
        return dr.select(side.active, here.factor * arriving * (passed * cosine), 0.0)

    def beams(self, here: Vertex, arrival: Any, may_be_connected: Any) -> Any:
        """The panels' beams, each with the ray's share as for the sun itself."""
        panels = self.scene.panels
        assert panels is not None

        def add(index: Any, total: Any) -> tuple[Any, Any]:
            row = gather4(panels.beam_table, index * 2, here.active)
            cosine, true_cosine = -dr.dot(here.shading, row.xyz), -dr.dot(here.normal, row.xyz)
            lit = here.active & (cosine > 0.0) & (true_cosine > 0.0)
            passed, density = self.light.beam(here.outside, index, lit)
            share = mi.Float(1.0)
            if self.batch.patches is not None:
                connection = self.batch.patches.multiplicity * density * true_cosine
                share = dr.select(may_be_connected & (density > 0.0), arrival / (arrival + connection), 1.0)
            normal_rgb = gather4(panels.beam_table, index * 2 + 1, lit).xyz
            found = mi.Color3f(normal_rgb) * (passed * cosine * share)
            return index + 1, total + dr.select(lit & (passed > 0.0), found, 0.0)

        count = len(panels.beams)
        state = (mi.UInt32(0), dr.zeros(mi.Color3f, dr.width(here.active)))
        _, total = dr.while_loop(state, lambda index, _: index < count, add, label="beams")
        return here.factor * total

    def sun_patch(self, here: Vertex) -> Any:
        """A point lit by the sun through an opening, connected to the vertex."""
        patches = self.batch.patches
        assert patches is not None
        choice, number = self._numbers(here, 3)

        def candidate(part: int) -> tuple[Any, tuple[Any, ...]]:
            place, normal, radiance, density = patches.choose((choice + part) * (1.0 / PATCH_CANDIDATES), here.active)
            towards, squared, cosine, seen = _towards(here, place)
            other_cosine = -dr.dot(normal, towards)
            seen &= (other_cosine > 0.0) & (squared > 1e-8)
            flow = cosine * other_cosine / squared
            connection = patches.multiplicity * density
            value = dr.max(radiance) * flow / (connection + flow * INVERSE_PI)
            return dr.select(seen, value, 0.0), (towards, squared, flow, radiance, connection)

        total, chosen, (towards, squared, flow, radiance, connection) = resample(candidate, PATCH_CANDIDATES, number)
        seen = here.active & (chosen > 0.0)
        passed, through_probability = self.light.between(here.outside, towards, dr.sqrt(squared), seen)
        value = passed * flow / (connection + flow * INVERSE_PI * through_probability)
        strength = value * patches.multiplicity * patches.valid_share * total / chosen
        return dr.select(seen & (passed > 0.0), here.factor * radiance * strength, 0.0)

    def light_vertex(self, here: Vertex) -> Any:
        """Light reflected indoors, except the sun's first reflection, by light vertices with the connections' share."""
        choice, number = self._numbers(here, 5)
        found = [self._connected(here, choice, number, connection) for connection in range(VERTEX_CONNECTIONS)]
        return here.factor * sum(found, mi.Color3f(0.0)) * (1.0 / VERTEX_CONNECTIONS)

    def _connected(self, here: Vertex, choice: Any, number: Any, connection: int) -> Any:
        """What one connection brings. The candidates of all are from equal parts of the vertices, which lie in order of
        place, each connection's as far apart as can be. All choose by one random number, turned by
        connection / VERTEX_CONNECTIONS modulo 1."""
        vertices = self.batch.vertices
        assert vertices is not None
        may = here.active & here.indoors
        parts = VERTEX_CONNECTIONS * VERTEX_CANDIDATES

        def candidate(part: int) -> tuple[Any, tuple[Any, ...]]:
            own = part * VERTEX_CONNECTIONS + connection
            place, normal, power = vertices.choose((choice + own) * (1.0 / parts), may)
            towards, squared, cosine, seen = _towards(here, place)
            other_cosine = -dr.dot(normal, towards)
            seen &= may & (other_cosine > 0.0) & (squared > 1e-8)
            flow = cosine * other_cosine / squared
            value = flow * self.connection_density / (self.connection_density + flow * INVERSE_PI)
            return dr.select(seen, dr.max(power) * value, 0.0), (towards, squared, power)

        turned = number + connection / VERTEX_CONNECTIONS
        turned = dr.select(turned < 1.0, turned, turned - 1.0)
        total, chosen, (towards, squared, power) = resample(candidate, VERTEX_CANDIDATES, turned)
        ray = mi.Ray3f(here.outside, towards)
        ray.maxt = dr.sqrt(squared) * (1.0 - 1e-5)
        seen = may & (chosen > 0.0)
        seen &= ~self.scene.all.ray_test(ray, active=seen)
        return dr.select(seen, (power / dr.max(power)) * total, 0.0)

    def point_source(self, here: Vertex) -> Any:
        """One point source, chosen evenly."""
        count = self.scene.point_source_count
        _, choice = self._numbers(here, 1)
        index = dr.minimum(mi.UInt32(choice * count), count - 1) * 6
        x, y, z, *power = (dr.gather(mi.Float, self.scene.point_sources, index + k, here.active) for k in range(6))
        towards, squared, cosine, seen = _towards(here, mi.Point3f(x, y, z))
        passed, _ = self.light.between(here.outside, towards, dr.sqrt(squared), seen)
        return dr.select(seen, here.factor * mi.Color3f(*power) * (passed * cosine * count / squared), 0.0)


def _towards(here: Vertex, place: Any) -> tuple[Any, Any, Any, Any]:
    """Direction to a place, squared distance, cosine by the shading normal, and the lanes that the place may light."""
    gap = mi.Vector3f(place - here.outside)
    squared = dr.squared_norm(gap)
    towards = gap * dr.rsqrt(squared)
    cosine = dr.dot(here.shading, towards)
    return towards, squared, cosine, here.active & (cosine > 0.0) & (dr.dot(here.normal, towards) > 0.0)

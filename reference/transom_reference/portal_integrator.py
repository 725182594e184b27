"""Path tracing that samples the openings and the sun's patches: unbiased, two-sided diffuse surfaces, delta sun.

At every diffuse vertex x these are added, and a cosine-distributed ray finds the next vertex:
- the sun, by a shadow ray; its patches seen by the next ray count with a weight against the connections below;
- sky and ground, by a point on an opening, chosen by an estimate of each opening's light at x;
- one point y lit by the sun through an opening, chosen from a list that is traced from the openings once a batch;
- indoors, four light vertices, places where light paths from the openings have landed (light_vertices.py), each the
  better of two by what it would bring if it is visible;
- one point source.
Sky and sun patches are weighted against the cosine-distributed ray by the balance heuristic [Veach 1997, ch. 9], with
the densities of all openings that a ray crosses, so that rays through two panes are right. All other light from indoor
surfaces is divided between light vertices and rays by a weight that depends on the two places alone, c / (c + p) and
p / (c + p) with p the density of the cosine-distributed ray: any such division is unbiased, and it bounds connections.

Glass multiplies by its angular transmittance, both ways. Its room side (the back of the face) also reflects diffusely:
a path is reflected with probability R / (T + R). In full physics the room side is a mirror: what a path meets after it
is found by that ray alone, as from a camera, the sun's disc included, and light vertices are not used.
Smooth surfaces use the interpolated normal for the cosine of arriving light, and only light from the viewer's side of
the true surface counts. Emitting surfaces are found by rays alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom_reference.light_along import LightAlong
from transom_reference.light_vertices import LightVertices, connection_density
from transom_reference.low_discrepancy import lane_seed, pair
from transom_reference.mitsuba_setup import dr, floats, mi
from transom_reference.panels import outward_direction
from transom_reference.path_starts import GivenRays, SensorPoints, Start, indoors
from transom_reference.sun_patches import SunPatches, pilot_multiplicity
from transom_reference.surface import offset, surface_at
from transom_reference.transport_scene import TransportScene
from transom_reference.vertex_light import DIMENSION_PAIRS, INVERSE_PI, Batch, Vertex, VertexLight


@dataclass(frozen=True)
class PathOptions:
    """log2_samples: samples of a lane in one batch. max_depth: steps of a path, glass crossings included.

    roulette: paths whose throughput is below this are continued at random, from the second vertex on.
    connect: use light vertices where the scene allows (light that comes through openings alone, seen from indoors).
    """

    log2_samples: int
    max_depth: int
    roulette: float = 0.35
    connect: bool = True


class PortalIntegrator:
    """Batches of one picture, or one set of sensors, of one scene."""

    def __init__(self, scene: TransportScene, start: Start, options: PathOptions) -> None:
        self.scene, self.start, self.options = scene, start, options
        self.light = LightAlong(scene)
        self.multiplicity = pilot_multiplicity(scene, self.light)
        self.connection_density = 0.0
        self.indoors: NDArray[np.bool_] | None = None
        lights_inside = scene.has_emitters or scene.point_source_count > 0
        may_connect = options.connect and scene.mirror_table is None
        if may_connect and scene.portals and not lights_inside and not isinstance(start, GivenRays):
            self.indoors = indoors(scene, start)
            if self.indoors.any():
                self.connection_density = connection_density(scene, self.light, self._arriving(None))

    def batch(self, seed: int) -> NDArray[np.float64]:
        """Mean radiance of each pixel (pixels, 3) [cd/m²], or illuminance (sensors, 3) [lx]."""
        patches = self._patches(seed)
        vertices = None
        if self.connection_density > 0.0:
            vertices = LightVertices.trace(self.scene, self.light, self._arriving(patches), seed)
        batch = Batch(dr.opaque(mi.UInt32, seed & 0xFFFFFFFF), patches, vertices)
        paths = _Paths(self.scene, self.light, self.start, self.options, batch)
        total = paths.run(self.indoors if vertices else None, self.connection_density)
        values = np.array(total, dtype=np.float64).T / (1 << self.options.log2_samples)
        return self.start.gathered(values)

    def _patches(self, seed: int) -> SunPatches | None:
        if self.multiplicity == 0.0:
            return None
        return SunPatches.trace(self.scene, self.light, seed, self.multiplicity)

    def _arriving(self, patches: SunPatches | None) -> Any:
        options = PathOptions(0, self.options.max_depth, self.options.roulette, connect=False)

        def arriving(origins: Any, directions: Any, seed: int) -> Any:
            batch = Batch(dr.opaque(mi.UInt32, (seed + 0x2545F491) & 0xFFFFFFFF), patches, None)
            return _Paths(self.scene, self.light, GivenRays(origins, directions), options, batch).run(None, 0.0)

        return arriving


class _Paths:
    """One wavefront: each lane takes its samples one after the other, so that all lanes stay busy."""

    def __init__(
        self, scene: TransportScene, light: LightAlong, start: Start, options: PathOptions, batch: Batch
    ) -> None:
        self.scene, self.light, self.start, self.options, self.batch = scene, light, start, options, batch

    def run(self, begins_indoors: NDArray[np.bool_] | None, connection_density: float) -> Any:
        """Sum of radiance (or illuminance) over samples for each lane, RGB."""
        count = self.start.lane_count
        self.start.prepare()
        self.lane = dr.arange(mi.UInt32, count)
        self.seed = lane_seed(self.lane, self.batch.seed)
        self.connection_density = dr.opaque(mi.Float, connection_density)
        if begins_indoors is None:
            self.begins_indoors = mi.Bool(False)
        else:
            place = self.lane // (count // len(begins_indoors))
            self.begins_indoors = dr.gather(mi.Float, floats(begins_indoors), place) > 0.5
            dr.eval(self.begins_indoors)
        self.vertex_light = VertexLight(
            self.scene, self.light, self.batch, self.seed, self.options.log2_samples, self.connection_density
        )
        zero = dr.zeros(mi.Point3f, count)
        state = (
            dr.full(mi.Bool, True, count),
            dr.zeros(mi.UInt32, count),
            dr.zeros(mi.UInt32, count),
            mi.Point3f(zero),
            mi.Vector3f(zero),
            dr.full(mi.Color3f, 1.0, count),
            dr.full(mi.Float, 1.0, count),
            dr.zeros(mi.Float, count),
            dr.full(mi.Bool, True, count) & self.begins_indoors,
            mi.Point3f(zero),
            mi.Normal3f(zero),
            dr.zeros(mi.Float, count),
            dr.zeros(mi.Color3f, count),
        )
        state = dr.while_loop(state, lambda active, *_: active, self._step, label="paths")
        total = state[-1]
        dr.eval(total)
        return total

    def _numbers(self, step: Any, pair_index: int, sample: Any) -> tuple[Any, Any]:
        return pair(self.seed, step * DIMENSION_PAIRS + pair_index, sample, self.options.log2_samples)

    def _step(
        self,
        active: Any,
        sample: Any,
        step: Any,
        origin: Any,
        direction: Any,
        throughput: Any,
        ray_density: Any,
        portal_density: Any,
        inside: Any,
        last: Any,
        last_normal: Any,
        last_weight: Any,
        total: Any,
    ) -> tuple[Any, ...]:
        """One ray of a path, and everything at the vertex that it meets.

        ray_density, portal_density: solid-angle densities with which the last vertex's cosine sampling and opening
        sampling would have taken this ray. inside: the path has been indoors so far, so that connections apply.
        last_weight: sum of the openings' weights at the last vertex (0: none or camera).
        """
        scene, light = self.scene, self.light
        first = step == 0
        after_vertex = dr.dot(last_normal, last_normal) > 0.5
        sensors = self.start if isinstance(self.start, SensorPoints) else None
        if sensors is None:
            jitter = pair(self.seed, mi.UInt32(0x7FFF), sample, self.options.log2_samples)
            first_origin, first_direction = self.start.ray(self.lane, *jitter)
            origin = dr.select(first, first_origin, origin)
            direction = dr.select(first, first_direction, direction)
        ray_active = active if sensors is None else active & ~first
        found = scene.all.ray_intersect_preliminary(mi.Ray3f(origin, direction), active=ray_active)
        hit = ray_active & found.is_valid()

        escaped = ray_active & ~hit
        share = ray_density / (ray_density + portal_density)
        total = total + dr.select(escaped, throughput * light.beyond(direction, escaped) * share, 0.0)
        if scene.mirror_table is not None and scene.sun_direction is not None:
            # A ray that a mirror has turned, or the camera's own: no vertex has looked for the sun along it.
            disc = self.vertex_light.sun_disc(direction)
            total = total + dr.select(escaped & ~after_vertex & (step > 0), throughput * disc, 0.0)

        surface = surface_at(scene, found, direction, hit)
        point, normal, shading, reflectance = surface.point, surface.normal, surface.shading, surface.reflectance
        is_glass = hit & (surface.opening >= 0.0)

        # Glass: through, or a diffuse reflection at the room side
        choice, roulette = self._numbers(step, 0, sample)
        passed = light.transmittance(mi.UInt32(dr.maximum(surface.opening, 0.0)), dr.abs(surface.along), is_glass)
        room = dr.select(surface.along > 0.0, self._room(surface, is_glass), 0.0)
        if scene.panels is not None:
            panel = light.panel_at(found.prim_index, direction, is_glass & (surface.along > 0.0))
            passed = dr.select(panel.active, panel.share, passed)
        through_probability = dr.select(room > 0.0, passed / (passed + room), 1.0)
        through = is_glass & (choice < through_probability)
        reflected = is_glass & ~through
        sampled = through & after_vertex
        if scene.panels is not None:
            sampled |= panel.active & after_vertex
        crossing = light.portal_density(found.prim_index, point, direction, last, last_normal, last_weight, sampled)
        if scene.panels is not None:
            # What a panel sends is sampled by points on that panel alone, whatever panes are before it.
            portal_density = dr.select(panel.active, 0.0, portal_density)
        portal_density = portal_density + dr.select(sampled, crossing, 0.0)
        if scene.panels is not None:
            residual = light.panel_sun(panel, point, surface.face_normal)
            share = ray_density / (ray_density + portal_density)
            total = total + dr.select(panel.active, throughput * residual * share, 0.0)
        throughput = dr.select(through, throughput * passed / through_probability, throughput)
        throughput = dr.select(reflected, throughput / (1.0 - through_probability), throughput)
        ray_density = dr.select(through, ray_density * through_probability, ray_density)
        inside &= ~through
        mirrored = mi.Bool(False)
        if scene.mirror_table is None:
            reflectance = dr.select(reflected, mi.Color3f(room), reflectance)
        else:
            mirrored = reflected
            throughput = dr.select(reflected, throughput * room, throughput)

        vertex = hit & ~through & ~mirrored
        if scene.has_emitters:
            total = total + dr.select(vertex & ~is_glass, throughput * surface.emitted, 0.0)
        if sensors is not None:
            sensor_point, sensor_normal = sensors.places(self.lane, active & first)
            point, normal = dr.select(first, sensor_point, point), dr.select(first, sensor_normal, normal)
            shading = dr.select(first, normal, shading)
            # A sensor is a diffuse vertex of "reflectance" pi: what leaves it is its illuminance.
            reflectance = dr.select(first, mi.Color3f(np.pi), reflectance)
            vertex |= active & first
        factor = throughput * reflectance * INVERSE_PI
        here = Vertex(vertex, point, offset(point, normal), normal, shading, factor, inside, step, sample)
        # Area density with which the last vertex's ray finds this one
        arrival = ray_density * dr.abs(dr.dot(normal, direction)) / dr.maximum(dr.squared_norm(point - last), 1e-12)
        if scene.sun_direction is not None:
            total = total + self.vertex_light.sun(here, arrival, after_vertex & ~is_glass)
        if scene.panels is not None and scene.panels.beams:
            total = total + self.vertex_light.beams(here, arrival, after_vertex & ~is_glass)
        if self.batch.vertices is not None:
            kept = dr.select(vertex & inside & after_vertex, arrival / (arrival + self.connection_density), 1.0)
            throughput = throughput * kept
            here.factor = factor * kept
            total = total + self.vertex_light.light_vertex(here)
        weight = mi.Float(0.0)
        if scene.portals:
            found_light, weight = self.vertex_light.sky_by_portal(here)
            total = total + found_light
        if self.batch.patches is not None:
            total = total + self.vertex_light.sun_patch(here)
        if scene.point_source_count:
            total = total + self.vertex_light.point_source(here)

        # The next ray
        next_1, next_2 = self._numbers(step, 4, sample)
        local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(next_1, next_2))
        onward = mi.Frame3f(shading).to_world(local)
        next_throughput = throughput * reflectance
        strength = dr.max(next_throughput) * (1.0 / self.start.first_throughput)
        survival = dr.select(first, 1.0, dr.minimum(1.0, strength * (1.0 / self.options.roulette)))
        survives = (dr.dot(normal, onward) > 0.0) & (local.z > 0.0) & (roulette < survival)
        next_throughput = next_throughput / dr.maximum(survival, 1e-12)

        origin = dr.select(through, offset(point, surface.face_normal * dr.sign(surface.along)), here.outside)
        direction = dr.select(vertex, onward, direction)
        throughput = dr.select(vertex, next_throughput, throughput)
        ray_density = dr.select(vertex, local.z * INVERSE_PI, ray_density)
        portal_density = dr.select(vertex, 0.0, portal_density)
        last = dr.select(vertex, point, last)
        last_normal = dr.select(vertex, shading, last_normal)
        last_weight = dr.select(vertex, weight, last_weight)

        if scene.panels is not None:
            # Beyond a panel light goes another way: nothing has been sampled along it.
            bent = through & panel.active
            direction = dr.select(bent, outward_direction(scene.panels, panel, next_1, next_2), direction)
            last_normal = dr.select(bent, mi.Normal3f(0.0), last_normal)
            last_weight = dr.select(bent, 0.0, last_weight)

        if scene.mirror_table is not None:
            # As from a camera: nothing has been sampled along a mirrored ray.
            direction = dr.select(mirrored, direction - 2.0 * dr.dot(direction, normal) * normal, direction)
            ray_density, portal_density = (
                dr.select(mirrored, 1.0, ray_density),
                dr.select(mirrored, 0.0, portal_density),
            )
            last_normal, last_weight = (
                dr.select(mirrored, mi.Normal3f(0.0), last_normal),
                dr.select(mirrored, 0.0, last_weight),
            )

        step = step + 1
        going = (
            ((vertex & survives) | through | mirrored) & (step < self.options.max_depth) & (dr.max(throughput) > 0.0)
        )
        sample = dr.select(going, sample, sample + 1)
        active = active & (sample < (1 << self.options.log2_samples))
        return (
            active,
            sample,
            dr.select(going, step, 0),
            mi.Point3f(origin),
            mi.Vector3f(direction),
            dr.select(going, throughput, 1.0),
            dr.select(going, ray_density, 1.0),
            dr.select(going, portal_density, 0.0),
            dr.select(going, inside, self.begins_indoors),
            mi.Point3f(last),
            mi.Normal3f(dr.select(going, last_normal, mi.Normal3f(0.0))),
            dr.select(going, last_weight, 0.0),
            total,
        )

    def _room(self, surface: Any, active: Any) -> Any:
        """Reflectance of the room side of a pane: hemispherical, or that of the angle where it is a mirror."""
        if self.scene.mirror_table is None:
            return surface.room
        return self.light.mirror(mi.UInt32(dr.maximum(surface.opening, 0.0)), dr.abs(surface.along), active)

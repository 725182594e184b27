"""Path tracing that samples the openings and the sun's patches: unbiased, two-sided diffuse surfaces, delta sun.

At every diffuse vertex x four things are added, and a cosine-distributed ray finds the next vertex:
- the sun, by a shadow ray; its patches seen by the next ray count with a weight against the connections below;
- sky and ground, by a point on an opening, chosen by an estimate of each opening's light at x;
- one point y lit by the sun through an opening, from a list that is traced from the openings once a batch;
- one point source.
Sky and sun patches are weighted against the cosine-distributed ray by the balance heuristic [Veach 1997, ch. 9], with the
densities of all openings that a ray crosses, so that rays through two panes are right.

Glass multiplies by its angular transmittance, both ways. Its room side (the back of the face) also reflects diffusely: a
path is reflected with probability R / (T + R). Smooth surfaces use the interpolated normal for the cosine of arriving
light and only light from the viewer's side of the true surface counts. Emitting surfaces are found by rays alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom_reference.light_along import LightAlong, facing, gather4, offset
from transom_reference.low_discrepancy import lane_seed, pair
from transom_reference.mitsuba_setup import dr, mi
from transom_reference.sun_patches import SunPatches
from transom_reference.transport_scene import TransportScene

INVERSE_PI = float(1.0 / np.pi)
DIMENSION_PAIRS = 5
"""Pairs of numbers that one step of a path uses."""


@dataclass(frozen=True)
class CameraRays:
    """A pinhole camera: directions are forward + x·right + y·up with x, y in the image plane at distance 1.

    Lanes are pixels in row order from the top left; samples fill the pixel's box evenly.
    """

    position: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    forward: NDArray[np.float64]
    width: int
    height: int


@dataclass(frozen=True)
class SensorPoints:
    """Illuminance sensors: points and normals (N, 3); `replicas` lanes each, sensor by sensor."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    replicas: int


@dataclass(frozen=True)
class PathOptions:
    """log2_samples: samples of a lane in one batch. max_depth: steps of a path, glass crossings included.

    roulette: paths whose throughput is below this are continued at random, from the second vertex on.
    """

    log2_samples: int
    max_depth: int
    roulette: float = 0.5


def trace_batch(scene: TransportScene, start: CameraRays | SensorPoints, options: PathOptions, seed: int) -> Any:
    """One batch: mean radiance of each pixel (pixels, 3) [cd/m²] or illuminance (sensors, 3) [lx], float64."""
    integrator = _Integrator(scene, start, options)
    patches = SunPatches.trace(scene, seed) if scene.sun_portal_probability.any() else None
    total = integrator.run(patches, seed)
    values = np.array(total, dtype=np.float64).T / (1 << options.log2_samples)
    if isinstance(start, SensorPoints):
        values = values.reshape(len(start.points), start.replicas, 3).mean(axis=1)
    return values


class _Integrator:
    def __init__(self, scene: TransportScene, start: CameraRays | SensorPoints, options: PathOptions) -> None:
        self.scene, self.start, self.options = scene, start, options
        self.light = LightAlong(scene)
        self.is_sensor = isinstance(start, SensorPoints)
        self.sun = mi.Vector3f(*map(float, scene.sun_direction)) if scene.sun_direction is not None else None
        self.sun_illuminance = mi.Color3f(*map(float, scene.sun_illuminance))
        if self.sun is not None:
            dr.make_opaque(self.sun, self.sun_illuminance)
        self.patches: SunPatches | None = None
        # Sensors are diffuse vertices of "reflectance" pi: what leaves them is their illuminance.
        self.first_throughput = float(np.pi) if self.is_sensor else 1.0
        if isinstance(start, CameraRays):
            self.camera = [mi.Vector3f(*map(float, v)) for v in (start.position, start.right, start.up, start.forward)]
            dr.make_opaque(*self.camera)
        else:
            self.sensors = [
                mi.Float(np.ascontiguousarray(a.T[k])) for a in (start.points, start.normals) for k in range(3)
            ]

    def run(self, patches: SunPatches | None, seed: int) -> Any:
        """Sum over samples for each lane."""
        self.patches = patches
        if isinstance(self.start, CameraRays):
            lane_count = self.start.width * self.start.height
        else:
            lane_count = len(self.start.points) * self.start.replicas
        lane = dr.arange(mi.UInt32, lane_count)
        batch_seed = dr.opaque(mi.UInt32, seed & 0xFFFFFFFF)
        self.lane, self.seed = lane, lane_seed(lane, batch_seed)
        zero = dr.zeros(mi.Point3f, lane_count)
        state = (
            dr.full(mi.Bool, True, lane_count),
            dr.zeros(mi.UInt32, lane_count),
            dr.zeros(mi.UInt32, lane_count),
            mi.Point3f(zero),
            mi.Vector3f(zero),
            dr.full(mi.Color3f, 1.0, lane_count),
            dr.full(mi.Float, 1.0, lane_count),
            dr.zeros(mi.Float, lane_count),
            mi.Point3f(zero),
            mi.Normal3f(zero),
            dr.zeros(mi.Float, lane_count),
            dr.zeros(mi.Color3f, lane_count),
        )
        state = dr.while_loop(state, lambda active, *_: active, self._step, label="paths")
        total = state[-1]
        dr.eval(total)
        return total

    def _numbers(self, step: Any, pair_index: int, sample: Any) -> tuple[Any, Any]:
        return pair(self.seed, step * DIMENSION_PAIRS + pair_index, sample, self.options.log2_samples)

    def _camera_ray(self, sample: Any) -> tuple[Any, Any]:
        assert isinstance(self.start, CameraRays)
        position, right, up, forward = self.camera
        jitter_x, jitter_y = pair(self.seed, mi.UInt32(0x7FFF), sample, self.options.log2_samples)
        column, row = self.lane % self.start.width, self.lane // self.start.width
        x = (mi.Float(column) + jitter_x) * (2.0 / self.start.width) - 1.0
        y = 1.0 - (mi.Float(row) + jitter_y) * (2.0 / self.start.height)
        return mi.Point3f(position), dr.normalize(forward + x * right + y * up)

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
        last: Any,
        last_normal: Any,
        last_weight: Any,
        total: Any,
    ) -> tuple[Any, ...]:
        """One ray of a path, and everything at the vertex that it meets.

        ray_density, portal_density: solid-angle densities with which the last vertex's cosine sampling and opening
        sampling would have taken this ray. last_weight: sum of the openings' weights there (0: none or camera).
        """
        scene, light = self.scene, self.light
        first = step == 0
        after_vertex = dr.dot(last_normal, last_normal) > 0.5
        if not self.is_sensor:
            camera_origin, camera_direction = self._camera_ray(sample)
            origin = dr.select(first, camera_origin, origin)
            direction = dr.select(first, camera_direction, direction)
            at_sensor = mi.Bool(False)
        else:
            at_sensor = first
        ray_active = active & ~at_sensor
        found = scene.all.ray_intersect_preliminary(mi.Ray3f(origin, direction), active=ray_active)
        hit = ray_active & found.is_valid()

        # Sky or ground
        escaped = ray_active & ~hit
        share = ray_density / (ray_density + portal_density)
        total = total + dr.select(escaped, throughput * light.beyond(direction, escaped) * share, 0.0)

        # The surface
        triangle = found.prim_index
        corner = gather4(scene.triangles, triangle * 3, hit)
        edge_1 = gather4(scene.triangles, triangle * 3 + 1, hit)
        edge_2 = gather4(scene.triangles, triangle * 3 + 2, hit)
        e1, e2 = edge_1.xyz, edge_2.xyz
        u, v = found.prim_uv.x, found.prim_uv.y
        point = mi.Point3f(corner.xyz + u * e1 + v * e2)
        face_normal = dr.normalize(dr.cross(e1, e2))
        material = mi.UInt32(corner.w)
        body = gather4(scene.materials, material * 2, hit)
        extra = gather4(scene.materials, material * 2 + 1, hit)
        reflectance, emitted = mi.Color3f(body.xyz), mi.Color3f(extra.xyz)
        is_glass = hit & (body.w >= 0.0)
        along = dr.dot(face_normal, direction)
        normal = facing(face_normal, direction)
        shading = self._shading_normal(triangle, u, v, edge_1.w > 0.5, normal, hit)

        # Glass: through, or a diffuse reflection at the room side
        choice, roulette = self._numbers(step, 0, sample)
        passed = light.transmittance(mi.UInt32(dr.maximum(body.w, 0.0)), dr.abs(along), is_glass)
        room = dr.select(along > 0.0, extra.w, 0.0)
        through_probability = dr.select(room > 0.0, passed / (passed + room), 1.0)
        through = is_glass & (choice < through_probability)
        reflected = is_glass & ~through
        crossing = light.portal_density(
            found.prim_index, point, direction, last, last_normal, last_weight, through & after_vertex
        )
        portal_density = portal_density + dr.select(through & after_vertex, crossing, 0.0)
        throughput = dr.select(through, throughput * passed / through_probability, throughput)
        throughput = dr.select(reflected, throughput / (1.0 - through_probability), throughput)
        ray_density = dr.select(through, ray_density * through_probability, ray_density)
        reflectance = dr.select(reflected, mi.Color3f(room), reflectance)

        vertex = hit & ~through
        total = total + dr.select(vertex & ~is_glass, throughput * emitted, 0.0)
        if self.is_sensor:
            index = self.lane // self.start.replicas  # type: ignore[union-attr]
            sensor = [dr.gather(mi.Float, values, index, at_sensor) for values in self.sensors]
            point = dr.select(at_sensor, mi.Point3f(*sensor[:3]), point)
            normal = dr.select(at_sensor, mi.Normal3f(*sensor[3:]), normal)
            shading = dr.select(at_sensor, normal, shading)
            reflectance = dr.select(at_sensor, mi.Color3f(np.pi), reflectance)
            vertex = vertex | at_sensor
        outside = offset(point, normal)
        factor = throughput * reflectance * INVERSE_PI
        if self.sun is not None:
            total = total + self._sun_here(
                vertex, factor, point, outside, normal, shading, direction, ray_density, last, after_vertex & ~is_glass
            )
        weight = mi.Float(0.0)
        if scene.portals:
            found_light, weight = self._sky_by_portal(vertex, factor, point, outside, normal, shading, step, sample)
            total = total + found_light
        if self.patches is not None:
            total = total + self._sun_patch(vertex, factor, point, outside, normal, shading, step, sample)
        if scene.point_source_count:
            total = total + self._point_source(vertex, factor, outside, normal, shading, step, sample)

        # The next ray
        next_1, next_2 = self._numbers(step, 4, sample)
        local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(next_1, next_2))
        onward = mi.Frame3f(shading).to_world(local)
        next_throughput = throughput * reflectance
        strength = dr.max(next_throughput) * (1.0 / self.first_throughput)
        survival = dr.select(first, 1.0, dr.minimum(1.0, strength * (1.0 / self.options.roulette)))
        survives = (dr.dot(normal, onward) > 0.0) & (local.z > 0.0) & (roulette < survival)
        next_throughput = next_throughput / dr.maximum(survival, 1e-12)

        origin = dr.select(through, offset(point, face_normal * dr.sign(along)), outside)
        direction = dr.select(vertex, onward, direction)
        throughput = dr.select(vertex, next_throughput, throughput)
        ray_density = dr.select(vertex, local.z * INVERSE_PI, ray_density)
        portal_density = dr.select(vertex, 0.0, portal_density)
        last = dr.select(vertex, point, last)
        last_normal = dr.select(vertex, shading, last_normal)
        last_weight = dr.select(vertex, weight, last_weight)

        step = step + 1
        going = ((vertex & survives) | through) & (step < self.options.max_depth) & (dr.max(throughput) > 0.0)
        sample = dr.select(going, sample, sample + 1)
        step = dr.select(going, step, 0)
        throughput = dr.select(going, throughput, 1.0)
        ray_density = dr.select(going, ray_density, 1.0)
        portal_density = dr.select(going, portal_density, 0.0)
        last_normal = dr.select(going, last_normal, mi.Normal3f(0.0))
        last_weight = dr.select(going, last_weight, 0.0)
        active = active & (sample < (1 << self.options.log2_samples))
        return (
            active,
            sample,
            step,
            mi.Point3f(origin),
            mi.Vector3f(direction),
            throughput,
            ray_density,
            portal_density,
            mi.Point3f(last),
            mi.Normal3f(last_normal),
            last_weight,
            total,
        )

    def _shading_normal(self, triangle: Any, u: Any, v: Any, smooth: Any, normal: Any, active: Any) -> Any:
        if self.scene.normals is None:
            return normal
        smooth = smooth & active
        a, b, c = (dr.gather(mi.Normal3f, self.scene.normals, triangle * 3 + k, smooth) for k in range(3))
        blended = dr.normalize((1.0 - u - v) * a + u * b + v * c)
        turned = dr.select(dr.dot(blended, normal) < 0.0, -blended, blended)
        return dr.select(smooth, turned, normal)

    def _sun_here(
        self,
        vertex: Any,
        factor: Any,
        point: Any,
        outside: Any,
        normal: Any,
        shading: Any,
        direction: Any,
        ray_density: Any,
        last: Any,
        may_be_connected: Any,
    ) -> Any:
        cosine, true_cosine = dr.dot(shading, self.sun), dr.dot(normal, self.sun)
        lit = vertex & (cosine > 0.0) & (true_cosine > 0.0)
        passed, density = self.light.sun(outside, self.sun, lit)
        share = mi.Float(1.0)
        if self.patches is not None:
            connection = self.patches.multiplicity * density * true_cosine
            squared = dr.squared_norm(point - last)
            arrival = ray_density * dr.abs(dr.dot(normal, direction)) / dr.maximum(squared, 1e-12)
            share = dr.select(may_be_connected & (density > 0.0), arrival / (arrival + connection), 1.0)
        return dr.select(lit & (passed > 0.0), factor * self.sun_illuminance * (passed * cosine * share), 0.0)

    def _sky_by_portal(
        self, vertex: Any, factor: Any, point: Any, outside: Any, normal: Any, shading: Any, step: Any, sample: Any
    ) -> tuple[Any, Any]:
        choice, _ = self._numbers(step, 1, sample)
        u, v = self._numbers(step, 2, sample)
        target, weight = self.light.portal_point(choice, u, v, point, shading, vertex)
        towards = dr.normalize(target - outside)
        cosine = dr.dot(shading, towards)
        seen = vertex & (weight > 0.0) & (cosine > 0.0) & (dr.dot(normal, towards) > 0.0)
        passed, through_probability, portal_density = self.light.outward(outside, towards, point, shading, weight, seen)
        ray_density = cosine * INVERSE_PI * through_probability
        seen = seen & (passed > 0.0) & (portal_density > 0.0)
        arriving = self.light.beyond(towards, seen) * (passed * cosine / (portal_density + ray_density))
        return dr.select(seen, factor * arriving, 0.0), weight

    def _sun_patch(
        self, vertex: Any, factor: Any, point: Any, outside: Any, normal: Any, shading: Any, step: Any, sample: Any
    ) -> Any:
        assert self.patches is not None
        choice, _ = self._numbers(step, 3, sample)
        place, patch_normal, radiance, density = self.patches.choose(choice, vertex)
        gap = mi.Vector3f(place - outside)
        squared = dr.squared_norm(gap)
        distance = dr.sqrt(squared)
        towards = gap / distance
        cosine, patch_cosine = dr.dot(shading, towards), -dr.dot(patch_normal, towards)
        seen = vertex & (cosine > 0.0) & (dr.dot(normal, towards) > 0.0) & (patch_cosine > 0.0) & (squared > 1e-8)
        passed, through_probability = self.light.between(outside, towards, distance, seen)
        ray_density = cosine * INVERSE_PI * through_probability * patch_cosine / squared
        connection = self.patches.multiplicity * density
        flow = passed * cosine * patch_cosine / squared
        share = self.patches.multiplicity * self.patches.valid_share / (connection + ray_density)
        return dr.select(seen & (passed > 0.0), factor * radiance * (flow * share), 0.0)

    def _point_source(
        self, vertex: Any, factor: Any, outside: Any, normal: Any, shading: Any, step: Any, sample: Any
    ) -> Any:
        count = self.scene.point_source_count
        _, choice = self._numbers(step, 1, sample)
        index = dr.minimum(mi.UInt32(choice * count), count - 1) * 6
        place = mi.Point3f(*(dr.gather(mi.Float, self.scene.point_sources, index + k, vertex) for k in range(3)))
        power = mi.Color3f(*(dr.gather(mi.Float, self.scene.point_sources, index + k, vertex) for k in range(3, 6)))
        gap = mi.Vector3f(place - outside)
        squared = dr.squared_norm(gap)
        distance = dr.sqrt(squared)
        towards = gap / distance
        cosine = dr.dot(shading, towards)
        seen = vertex & (cosine > 0.0) & (dr.dot(normal, towards) > 0.0)
        passed, _ = self.light.between(outside, towards, distance, seen)
        return dr.select(seen, factor * power * (passed * cosine * count / squared), 0.0)

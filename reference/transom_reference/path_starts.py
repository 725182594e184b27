"""Where camera paths begin: pixels, illuminance sensors, or rays that are given; and whether that is indoors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom_reference.mitsuba_setup import dr, mi, points
from transom_reference.transport_scene import TransportScene

Float64 = NDArray[np.float64]

INDOOR_RAYS = 4096
"""Rays that must all meet a surface or a pane for a point to count as indoors."""


@dataclass(frozen=True)
class CameraRays:
    """A pinhole camera: directions are forward + x·right + y·up with x, y from -1 to 1.

    Lanes are pixels in row order from the top left; samples fill the pixel's box evenly.
    """

    position: Float64
    right: Float64
    up: Float64
    forward: Float64
    width: int
    height: int

    first_throughput = 1.0

    @property
    def lane_count(self) -> int:
        return self.width * self.height

    @cached_property
    def _frame(self) -> tuple[Any, ...]:
        frame = tuple(mi.Vector3f(*map(float, v)) for v in (self.position, self.right, self.up, self.forward))
        dr.make_opaque(frame)
        return frame

    def prepare(self) -> None:
        """Moves the numbers to Dr.Jit: to be called before, not within, a symbolic loop."""
        _ = self._frame

    def ray(self, lane: Any, jitter_x: Any, jitter_y: Any) -> tuple[Any, Any]:
        position, right, up, forward = self._frame
        column, row = lane % self.width, lane // self.width
        x = (mi.Float(column) + jitter_x) * (2.0 / self.width) - 1.0
        y = 1.0 - (mi.Float(row) + jitter_y) * (2.0 / self.height)
        return mi.Point3f(position), dr.normalize(forward + x * right + y * up)

    def gathered(self, values: Float64) -> Float64:
        return values


@dataclass(frozen=True)
class SensorPoints:
    """Illuminance sensors: points and normals (N, 3); `replicas` lanes each, sensor by sensor."""

    points: Float64
    normals: Float64
    replicas: int

    first_throughput = float(np.pi)

    @property
    def lane_count(self) -> int:
        return len(self.points) * self.replicas

    @cached_property
    def _columns(self) -> list[Any]:
        return [*points(self.points), *points(self.normals)]

    def prepare(self) -> None:
        """Moves the numbers to Dr.Jit: to be called before, not within, a symbolic loop."""
        _ = self._columns

    def places(self, lane: Any, active: Any) -> tuple[Any, Any]:
        index = lane // self.replicas
        values = [dr.gather(mi.Float, column, index, active) for column in self._columns]
        return mi.Point3f(*values[:3]), mi.Normal3f(*values[3:])

    def ray(self, lane: Any, jitter_x: Any, jitter_y: Any) -> tuple[Any, Any]:
        raise NotImplementedError("a sensor's path begins at a point, not with a ray")

    def gathered(self, values: Float64) -> Float64:
        mean: Float64 = values.reshape(len(self.points), self.replicas, 3).mean(axis=1)
        return mean


@dataclass(frozen=True)
class GivenRays:
    """One ray a lane: origins and directions as Dr.Jit arrays."""

    origins: Any
    directions: Any

    first_throughput = 1.0

    @property
    def lane_count(self) -> int:
        return int(dr.width(self.directions))

    def prepare(self) -> None:
        """Evaluates the rays before a symbolic loop reads them."""
        dr.eval(self.origins, self.directions)

    def ray(self, lane: Any, jitter_x: Any, jitter_y: Any) -> tuple[Any, Any]:  # noqa: ARG002
        return dr.gather(mi.Point3f, self.origins, lane), dr.gather(mi.Vector3f, self.directions, lane)

    def gathered(self, values: Float64) -> Float64:
        return values


Start = CameraRays | SensorPoints | GivenRays


def indoors(scene: TransportScene, start: CameraRays | SensorPoints) -> NDArray[np.bool_]:
    """Whether all rays from the camera (1,), or into each sensor's hemisphere (N,), meet a surface or a pane's back."""
    generator = np.random.default_rng(7)
    z, turn = generator.uniform(-1, 1, INDOOR_RAYS), generator.uniform(0, 2 * np.pi, INDOOR_RAYS)
    ring = np.sqrt(1 - z * z)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    if isinstance(start, CameraRays):
        answer = _all_met(scene, start.position, directions)
        return np.array([answer])
    answers = []
    for point, normal in zip(start.points, start.normals, strict=True):
        turned = directions * np.where(directions @ normal < 0, -1.0, 1.0)[:, None]
        answers.append(_all_met(scene, point + 1e-5 * normal, turned))
    return np.array(answers)


def _all_met(scene: TransportScene, place: Float64, directions: Float64) -> bool:
    towards = mi.Vector3f(*points(directions))
    origin = mi.Point3f(*map(float, place))
    found = scene.all.ray_intersect_preliminary(mi.Ray3f(origin, towards))
    triangle = np.array(found.prim_index)
    met = np.array(found.is_valid())
    glass = met & (triangle >= scene.opaque_count)
    if glass.any():
        normals = np.array([portal.normal for portal in scene.portals])
        portal = np.array(scene.portal_of_glass_triangle)[triangle[glass] - scene.opaque_count]
        met[glass] = (normals[portal] * directions[glass]).sum(axis=1) > 0
    return bool(met.all())

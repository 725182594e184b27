"""The surface that a ray has met: place, normals and material, read from a TransportScene's tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from transom_reference.mitsuba_setup import dr, mi
from transom_reference.transport_scene import TransportScene

OFFSET = 5e-6
"""Rays start this far from a surface, times 1 + the largest coordinate [m]: above float32 rounding of hit points."""


def gather4(table: Any, row: Any, active: Any) -> Any:
    """Row of four floats of a flat table; `.xyz` and `.w` name its parts."""
    return dr.gather(mi.Vector4f, table, row, active)


def offset(point: Any, normal: Any) -> Any:
    """The point moved off its surface along the normal."""
    largest = dr.maximum(dr.abs(point.x), dr.maximum(dr.abs(point.y), dr.abs(point.z)))
    return mi.Point3f(point + normal * (OFFSET * (1.0 + largest)))


@dataclass
class Surface:
    """Where a ray hits, by lane; undefined where it hits nothing.

    face_normal: front of the face. normal, shading: true and interpolated normal, turned against the ray.
    along: cosine of the ray to face_normal (above 0: it meets the back). opening: index, below 0 for opaque surfaces.
    reflectance, emitted: RGB; of an opening 0. room: diffuse reflectance of an opening's back.
    """

    point: Any
    face_normal: Any
    normal: Any
    shading: Any
    along: Any
    opening: Any
    reflectance: Any
    emitted: Any
    room: Any


def surface_at(scene: TransportScene, found: Any, direction: Any, hit: Any, first_triangle: Any = 0) -> Surface:
    """The surface of a preliminary intersection. first_triangle: row of the table where the hit scene's rows begin."""
    triangle = found.prim_index + first_triangle
    corner = gather4(scene.triangles, triangle * 3, hit)
    edge_1 = gather4(scene.triangles, triangle * 3 + 1, hit)
    edge_2 = gather4(scene.triangles, triangle * 3 + 2, hit)
    u, v = found.prim_uv.x, found.prim_uv.y
    face_normal = dr.normalize(dr.cross(edge_1.xyz, edge_2.xyz))
    along = dr.dot(face_normal, direction)
    normal = mi.Normal3f(dr.select(along > 0.0, -face_normal, face_normal))
    shading = normal
    if scene.normals is not None:
        smooth = hit & (edge_1.w > 0.5)
        a, b, c = (dr.gather(mi.Normal3f, scene.normals, triangle * 3 + k, smooth) for k in range(3))
        blended = dr.normalize((1.0 - u - v) * a + u * b + v * c)
        turned = dr.select(dr.dot(blended, normal) < 0.0, -blended, blended)
        shading = dr.select(smooth, mi.Normal3f(turned), normal)
    material = mi.UInt32(corner.w)
    body = gather4(scene.materials, material * 2, hit)
    extra = gather4(scene.materials, material * 2 + 1, hit)
    return Surface(
        point=mi.Point3f(corner.xyz + u * edge_1.xyz + v * edge_2.xyz),
        face_normal=face_normal,
        normal=normal,
        shading=shading,
        along=along,
        opening=body.w,
        reflectance=mi.Color3f(body.xyz),
        emitted=mi.Color3f(extra.xyz),
        room=extra.w,
    )

"""Changes of a scene that must not change its light: names, order, place, size, orientation, handedness."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition
from transom.daylight.sun import SunPosition
from transom.scene.model import Scene

Float64 = NDArray[np.float64]

ORDER_SEED = 11


@dataclass(frozen=True)
class Change:
    """A scene and its condition, both changed alike."""

    name: str
    scene: Callable[[Scene], Scene]
    condition: Callable[[Condition], Condition]


def sunlit(condition: Condition, towards: tuple[float, float, float], normal_lx: float | None = None) -> Condition:
    """The condition with its sun in exactly that direction (any length), of the same or the given illuminance."""
    direction = np.array(towards, np.float64)
    direction = direction / np.linalg.norm(direction)
    x, y, z = (float(v) for v in direction)
    rgb = condition.sun_illuminance_rgb if normal_lx is None else np.full(3, normal_lx)
    if not rgb.any():
        rgb = np.full(3, 50000.0)
    return replace(
        condition,
        sun=SunPosition(math.asin(max(-1.0, min(1.0, z))), math.atan2(x, y) % (2 * math.pi)),
        sun_direction=direction,
        sun_illuminance_rgb=rgb,
        sky=replace(condition.sky, sun_direction=(x, y, z)),
        direct_normal_lx=float(rgb[1]),
    )


def renamed() -> Change:
    def scene(old: Scene) -> Scene:
        mesh = replace(old.mesh, objects=tuple(f"x{name}" for name in old.mesh.objects))
        return replace(
            old,
            name=f"other_{old.name}",
            title="Other",
            mesh=mesh,
            materials=tuple(replace(material, name=f"m{material.name}") for material in old.materials),
            openings=tuple(replace(o, name=f"o{o.name}", material=f"m{o.material}") for o in old.openings),
        )

    return Change("renamed", scene, _same)


def reordered() -> Change:
    """Faces, vertices and opaque materials in another order."""

    def scene(old: Scene) -> Scene:
        random = np.random.default_rng(ORDER_SEED)
        mesh, count = old.mesh, len(old.mesh.faces)
        faces, vertices = random.permutation(count), random.permutation(len(mesh.vertices))
        materials = random.permutation(len(old.materials))
        place_of_vertex = np.append(np.argsort(vertices), -1).astype(np.int32)
        place_of_material = np.argsort(materials).astype(np.int32)
        normals = mesh.corner_normals
        return replace(
            old,
            mesh=replace(
                mesh,
                vertices=mesh.vertices[vertices],
                faces=place_of_vertex[mesh.faces[faces]],
                face_material=place_of_material[mesh.face_material[faces]],
                face_object=mesh.face_object[faces],
                corner_normals=None if normals is None else normals[faces],
            ),
            materials=tuple(old.materials[k] for k in materials),
        )

    return Change("reordered", scene, _same)


def translated(by: tuple[float, float, float]) -> Change:
    return Change("translated", lambda old: _moved(old, np.eye(3), np.array(by)), _same)


def scaled(factor: float) -> Change:
    """All lengths, point sources brighter by the square of it: the same illuminances."""

    def scene(old: Scene) -> Scene:
        moved = _moved(old, factor * np.eye(3), np.zeros(3))
        sources = []
        for source in moved.point_sources:
            r, g, b = (factor**2 * value for value in source.intensity)
            sources.append(replace(source, intensity=(r, g, b)))
        return replace(moved, point_sources=tuple(sources))

    return Change("scaled", scene, _same)


def turned() -> Change:
    """A quarter turn about the vertical, sun and sky with it."""
    return _rigid("turned", np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))


def mirrored() -> Change:
    """East and west exchanged, sun and sky with them."""
    return _rigid("mirrored", np.diag([-1.0, 1.0, 1.0]))


def _same(condition: Condition) -> Condition:
    return condition


def _rigid(name: str, matrix: Float64) -> Change:
    def condition(old: Condition) -> Condition:
        x, y, z = (float(v) for v in matrix @ np.array(old.sky.sun_direction))
        direction = None if old.sun_direction is None else matrix @ old.sun_direction
        return replace(old, sun_direction=direction, sky=replace(old.sky, sun_direction=(x, y, z)))

    return Change(name, lambda old: _moved(old, matrix, np.zeros(3)), condition)


def _moved(old: Scene, matrix: Float64, by: Float64) -> Scene:
    """Geometry, cameras, sensors and sources under x -> matrix x + by; a mirror turns the faces' corners round."""
    mesh, mirror = old.mesh, np.linalg.det(matrix) < 0
    linear = matrix / abs(np.linalg.det(matrix)) ** (1 / 3)

    def point(p: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (float(v) for v in matrix @ np.array(p) + by)
        return x, y, z

    def direction(p: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (float(v) for v in linear @ np.array(p))
        return x, y, z

    faces, normals = mesh.faces, mesh.corner_normals
    if normals is not None:
        normals = normals @ linear.T
    if mirror:
        quads = faces[:, 3:] >= 0
        order = np.where(quads, [[3, 2, 1, 0]], [[2, 1, 0, 3]])
        faces = np.take_along_axis(faces, order, axis=1)
        normals = None if normals is None else np.take_along_axis(normals, order[:, :, None], axis=1)
    return replace(
        old,
        mesh=replace(mesh, vertices=mesh.vertices @ matrix.T + by, faces=faces, corner_normals=normals),
        point_sources=tuple(replace(source, position=point(source.position)) for source in old.point_sources),
        views=tuple(
            replace(v, position=point(v.position), target=point(v.target), up=direction(v.up)) for v in old.views
        ),
        sensors=tuple(replace(s, points=s.points @ matrix.T + by, normals=s.normals @ linear.T) for s in old.sensors),
    )

"""Edits of a scene, each a new scene: for `Engine.edited`, which solves it with what the edit leaves valid."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError
from transom.scene.model import Float64, Int32, Mesh, Scene

Colour = tuple[float, float, float]


def with_reflectance(scene: Scene, material: str, reflectance: float | Colour) -> Scene:
    """The scene with another reflectance (linear Rec. 709, 0..1) of an opaque material.

    Raises InputError for an unknown material, one of an opening, or a reflectance outside 0..1.
    """
    index = _index(scene, "material", material, [entry.name for entry in scene.materials])
    if scene.materials[index].opening >= 0:
        raise InputError(
            "is the material of an opening, whose reflectance follows from its glazing",
            file=scene.file,
            field="material",
            value=material,
            remedy="Use with_glazing",
        )
    colour = reflectance if isinstance(reflectance, tuple) else (reflectance, reflectance, reflectance)
    if not all(0.0 <= value < 1.0 for value in colour):
        raise InputError(
            "is outside 0..1 (1 excluded)", file=scene.file, field=f"materials.{material}.reflectance", value=colour
        )
    materials = list(scene.materials)
    materials[index] = replace(materials[index], reflectance=colour)
    return replace(scene, materials=tuple(materials))


def with_glazing(scene: Scene, opening: str, visible_transmittance: float) -> Scene:
    """The scene with other glass in an opening. visible_transmittance: at normal incidence, 0..0.918.

    Raises InputError for an unknown opening, one without glazing, or a transmittance that no pane has.
    """
    from transom.glass import MAX_TRANSMITTANCE

    index = _index(scene, "opening", opening, [entry.name for entry in scene.openings])
    field = f"openings.{opening}.visible_transmittance"
    if scene.openings[index].glazing == "none":
        raise InputError("has no glazing that could be changed", file=scene.file, field="opening", value=opening)
    if not 0.0 <= visible_transmittance <= MAX_TRANSMITTANCE:
        raise InputError(
            f"is outside 0..{MAX_TRANSMITTANCE:.3f}, what a single pane can pass",
            file=scene.file,
            field=field,
            value=visible_transmittance,
        )
    openings = list(scene.openings)
    openings[index] = replace(openings[index], visible_transmittance=visible_transmittance)
    return replace(scene, openings=tuple(openings))


def with_opening_closed(scene: Scene, opening: str, material: str) -> Scene:
    """The scene with all panes of an opening replaced by an opaque material of the scene, such as that of a blind.

    Raises InputError for an unknown opening or material, or a material that is itself an opening's.
    """
    index = _index(scene, "opening", opening, [entry.name for entry in scene.openings])
    cover = _index(scene, "material", material, [entry.name for entry in scene.materials])
    if scene.materials[cover].opening >= 0:
        opaque = [entry.name for entry in scene.materials if entry.opening < 0]
        raise InputError(
            "is the material of an opening, not an opaque one",
            file=scene.file,
            field="material",
            value=material,
            remedy=f"Use one of {', '.join(opaque)}",
        )
    is_pane = np.array([entry.opening == index for entry in scene.materials])[scene.mesh.face_material]
    face_material = np.where(is_pane, cover, scene.mesh.face_material).astype(np.int32)
    return replace(scene, mesh=replace(scene.mesh, face_material=face_material))


def with_object_moved(scene: Scene, name: str, offset_m: Sequence[float]) -> Scene:
    """The scene with an object of its mesh moved by (x, y, z) [m]. Faces keep their numbers.

    Raises InputError for an unknown object or an offset that is not three finite numbers.
    """
    offset = np.asarray(offset_m, dtype=np.float64)
    if offset.shape != (3,) or not np.isfinite(offset).all():
        raise InputError("is not three finite numbers [m]", file=scene.file, field="offset_m", value=offset_m)
    mesh = scene.mesh
    chosen = _faces_of(scene, name)
    corners = mesh.faces[chosen]
    used, place = np.unique(corners[corners >= 0], return_inverse=True)
    moved = corners.copy()
    moved[corners >= 0] = place + len(mesh.vertices)
    faces = mesh.faces.copy()
    faces[chosen] = moved
    vertices = np.concatenate([mesh.vertices, mesh.vertices[used] + offset])
    return replace(scene, mesh=replace(mesh, vertices=vertices, faces=faces))


def with_object_removed(scene: Scene, name: str) -> Scene:
    """The scene without an object of its mesh. Raises InputError for an unknown object, or the only one."""
    kept = ~_faces_of(scene, name)
    if not kept.any():
        raise InputError("is all that the scene has", file=scene.file, field="object", value=name)
    return replace(scene, mesh=_chosen(scene.mesh, kept))


def with_object_added(scene: Scene, name: str, vertices: Float64, faces: Int32, material: str) -> Scene:
    """The scene with one more object. vertices: (V, 3) [m]. faces: (F, 4) vertex indices, the fourth -1 for a triangle.

    Raises InputError for a name that the scene has already, an unknown material, or faces that name no vertex.
    """
    if name in scene.mesh.objects:
        raise InputError(
            "is there already", file=scene.file, field="object", value=name, remedy="Give the new object another name"
        )
    index = _index(scene, "material", material, [entry.name for entry in scene.materials])
    faces = np.asarray(faces, dtype=np.int32).reshape(-1, 4)
    if not len(faces) or faces[:, :3].min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"name a vertex outside 0..{len(vertices) - 1}, or are none", file=scene.file, field=f"faces of {name}"
        )
    mesh = scene.mesh
    added = np.where(faces >= 0, faces + len(mesh.vertices), -1).astype(np.int32)
    points = np.concatenate([mesh.vertices, np.asarray(vertices, dtype=np.float64).reshape(-1, 3)])
    normals = mesh.corner_normals
    if normals is not None:
        corner = points[added]
        flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        normals = np.concatenate([normals, np.repeat(flat[:, None], 4, axis=1)])
    count = len(faces)
    return replace(
        scene,
        mesh=Mesh(
            points,
            np.concatenate([mesh.faces, added]),
            np.concatenate([mesh.face_material, np.full(count, index, dtype=np.int32)]),
            np.concatenate([mesh.face_object, np.full(count, len(mesh.objects), dtype=np.int32)]),
            (*mesh.objects, name),
            normals,
        ),
    )


def _faces_of(scene: Scene, name: str) -> NDArray[np.bool_]:
    return np.asarray(scene.mesh.face_object == _index(scene, "object", name, scene.mesh.objects))


def _chosen(mesh: Mesh, kept: NDArray[np.bool_]) -> Mesh:
    return replace(
        mesh,
        faces=mesh.faces[kept],
        face_material=mesh.face_material[kept],
        face_object=mesh.face_object[kept],
        corner_normals=None if mesh.corner_normals is None else mesh.corner_normals[kept],
    )


def _index(scene: Scene, field: str, name: str, names: Sequence[str]) -> int:
    if name in names:
        return list(names).index(name)
    near = difflib.get_close_matches(name, names, 1)
    remedy = f"Did you mean {near[0]!r}?" if near else f"Use one of {', '.join(names)}"
    raise InputError(f"is no {field} of the scene", file=scene.file, field=field, value=name, remedy=remedy)

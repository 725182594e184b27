"""From a mesh file's polygons to the scene's Mesh: metres, z up, north applied, welded, with shading normals."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from transom.errors import InputError
from transom.scene.mesh import Polygon, RawMesh
from transom.scene.model import Float64, Int32, Mesh
from transom.scene.polygons import area_vector, has_no_area, is_plain, split_polygon, without_repeats
from transom.scene.schema import METRES_PER_UNIT
from transom.scene.wording import shown_path

WELD_M = 1e-7
"""Vertices nearer than this in every coordinate become one, so that faces share edges."""

SMOOTH_LIMIT_COS = math.cos(math.radians(60.0))
"""Without normals in the file, faces bent by more than 60 degrees keep a crease between them."""


def frame_rotation(up: str, north_deg: float) -> Float64:
    """Rotation (3, 3) from the mesh's axes to x east, y north, z up.

    up "y": x right, y up, z towards the viewer, taken as south. north_deg turns the model clockwise seen from above,
    so that its northern side faces the azimuth north_deg.
    """
    upright = np.eye(3) if up == "z" else np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    angle = math.radians(north_deg)
    cosine, sine = math.cos(angle), math.sin(angle)
    turned: Float64 = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]) @ upright
    return turned


def build_mesh(
    raw: RawMesh, unit: str, up: str, north_deg: float, materials: Mapping[str, int], smooth: frozenset[str]
) -> Mesh:
    """The Mesh of the file's polygons. materials: index by name, complete; smooth: materials with shading normals.

    Raises InputError for a face without area and for a shading normal that points behind its face.
    """
    rotation = frame_rotation(up, north_deg)
    vertices = METRES_PER_UNIT[unit] * raw.vertices @ rotation.T
    normals = raw.normals @ rotation.T
    vertices, welded = _weld(vertices)
    objects: dict[str, int] = {}
    faces, face_material, face_object = [], [], []
    given: list[Float64 | None] = []
    is_smooth = []
    plain = _plain_polygons(raw, vertices, welded)
    for polygon, stays in zip(raw.polygons, plain, strict=True):
        corners = tuple(int(i) for i in welded[list(polygon.corners)])
        points = vertices[list(corners)]
        for positions in [tuple(range(len(corners)))] if stays else _split(raw, polygon, corners, points):
            faces.append([corners[i] for i in positions] + [-1] * (4 - len(positions)))
            face_material.append(materials[polygon.material])
            face_object.append(objects.setdefault(polygon.object, len(objects)))
            is_smooth.append(polygon.material in smooth)
            own = None
            if polygon.material in smooth and polygon.normals:
                own = _given_normals(raw, normals[[polygon.normals[i] for i in positions]], points, polygon.place)
            given.append(own)
    vertices, face_array = _without_unused(vertices, np.array(faces, dtype=np.int32))
    material_array = np.array(face_material, dtype=np.int32)
    corner_normals = None
    if any(is_smooth):
        corner_normals = _corner_normals(vertices, face_array, material_array, np.array(is_smooth), given)
    return Mesh(
        vertices=vertices,
        faces=face_array,
        face_material=material_array,
        face_object=np.array(face_object, dtype=np.int32),
        objects=tuple(objects),
        corner_normals=corner_normals,
    )


def _weld(vertices: Float64) -> tuple[Float64, Int32]:
    """Unique vertices in the order of the file, and for each old index the new one."""
    _, first, inverse = np.unique(np.round(vertices / WELD_M), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    # Adding zero turns the -0.0 of a rotation into 0.0.
    return vertices[first[order]] + 0.0, rank[inverse.reshape(-1)]


def _without_unused(vertices: Float64, faces: Int32) -> tuple[Float64, Int32]:
    """Only the vertices that a face uses, and the faces renumbered to them."""
    used = np.unique(faces[faces >= 0])
    rank = np.full(len(vertices) + 1, -1, dtype=np.int32)
    rank[used] = np.arange(len(used), dtype=np.int32)
    return vertices[used], rank[faces]


def _plain_polygons(raw: RawMesh, vertices: Float64, welded: Int32) -> NDArray[np.bool_]:
    """Which polygons become one face as they are; found for all triangles, then all quads, at once."""
    plain = np.zeros(len(raw.polygons), dtype=bool)
    for count in (3, 4):
        chosen = [index for index, polygon in enumerate(raw.polygons) if len(polygon.corners) == count]
        if chosen:
            corners = welded[np.array([raw.polygons[index].corners for index in chosen])]
            plain[chosen] = is_plain(vertices[corners])
    return plain


def _split(raw: RawMesh, polygon: Polygon, corners: tuple[int, ...], points: Float64) -> list[tuple[int, ...]]:
    """The faces of one polygon as positions in `corners`. Raises InputError when it has no area."""
    kept = without_repeats(corners)
    if has_no_area(points[kept]):
        _refuse_flat(raw, polygon, points)
    return [tuple(kept[i] for i in part) for part in split_polygon(points[kept])]


def _refuse_flat(raw: RawMesh, polygon: Polygon, points: Float64) -> None:
    where = ", ".join(f"{value:.4g}" for value in points.mean(axis=0))
    raise InputError(
        f"(object {polygon.object!r}, material {polygon.material!r}) has no area, near ({where}) m",
        file=f"{shown_path(raw.file)}, {polygon.place}",
        field="face",
        remedy="Delete it, or merge its vertices in the modelling program",
    )


def _given_normals(raw: RawMesh, normals: Float64, points: Float64, place: str) -> Float64:
    """Unit normals (n, 3) of one face from the file, checked against the side that the face looks to."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    if np.any(length < 1e-9) or np.any(normals @ area_vector(points) <= 0.0):
        raise InputError(
            "has a vertex normal that is zero or points behind the face",
            file=f"{shown_path(raw.file)}, {place}",
            field="face",
            remedy="Recalculate the normals, or remove them from the file: they are then computed",
        )
    unit: Float64 = normals / length
    return unit


def _corner_normals(
    vertices: Float64,
    faces: Int32,
    face_material: Int32,
    is_smooth: NDArray[np.bool_],
    given: list[Float64 | None],
) -> Float64:
    """Shading normals (F, 4, 3): the file's, or the mean of the faces around, weighted by area times angle."""
    result = np.zeros((len(faces), 4, 3))
    weighted = np.zeros((len(faces), 4, 3))
    around: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for face, corners in enumerate(faces):
        count = 4 if corners[3] >= 0 else 3
        points = vertices[corners[:count]]
        vector = area_vector(points)
        result[face] = vector / np.linalg.norm(vector)
        if not is_smooth[face]:
            continue
        for corner in range(count):
            to_next, to_last = points[(corner + 1) % count] - points[corner], points[corner - 1] - points[corner]
            cosine = to_next @ to_last / (np.linalg.norm(to_next) * np.linalg.norm(to_last))
            weighted[face, corner] = vector * math.acos(min(1.0, max(-1.0, float(cosine))))
            around[int(face_material[face]), int(corners[corner])].append((face, corner))
    own = result[:, 0].copy()
    for face, normals in enumerate(given):
        if normals is not None:
            result[face, : len(normals)] = normals
    for neighbours in around.values():
        for face, corner in neighbours:
            if given[face] is None:
                near = [weighted[f, c] for f, c in neighbours if own[f] @ own[face] >= SMOOTH_LIMIT_COS]
                total = np.sum(near, axis=0)
                result[face, corner] = total / np.linalg.norm(total)
    return result

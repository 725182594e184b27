"""Mesh files as polygons with a material and an object each: OBJ by a small reader here, glTF through trimesh."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from transom.errors import InputError
from transom.scene.model import Float64
from transom.scene.wording import shown_path

EXTENSIONS = (".obj", ".glb", ".gltf")


@dataclass
class Polygon:
    """A face as the file has it: vertex indices, counter-clockwise from the front; normal indices or () without."""

    corners: tuple[int, ...]
    normals: tuple[int, ...]
    material: str
    object: str
    place: str
    """Where it is written, for messages: "line 12" or "triangle 3 of mesh desk"."""


@dataclass
class RawMesh:
    """A mesh file as read: coordinates in the file's own unit and axes."""

    file: Path
    vertices: Float64
    normals: Float64
    polygons: list[Polygon] = field(default_factory=list)


def read_mesh(path: Path) -> RawMesh:
    """The polygons of an .obj, .glb or .gltf file. Raises InputError naming the file and, for OBJ, the line."""
    extension = path.suffix.lower()
    if extension not in EXTENSIONS:
        raise InputError(
            f"has the extension {extension!r}, which is not a mesh that can be read",
            file=shown_path(path),
            remedy=f"Export it as one of {', '.join(EXTENSIONS)}",
        )
    raw = read_obj(path) if extension == ".obj" else read_gltf(path)
    if not raw.polygons:
        raise InputError("has no faces", file=shown_path(path), remedy="Export the geometry as polygons")
    return raw


def read_obj(path: Path) -> RawMesh:
    """Wavefront OBJ: v, vn, f (negative indices, n-gons), o and g (object names), usemtl. Other lines are skipped."""
    vertices: list[tuple[float, float, float]] = []
    normals: list[tuple[float, float, float]] = []
    polygons: list[Polygon] = []
    material, name = "", "default"
    file = shown_path(path)
    pending = ""
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        text = pending + line.split("#", 1)[0].rstrip()
        if text.endswith("\\"):
            pending = text[:-1] + " "
            continue
        pending = ""
        word, _, rest = text.strip().partition(" ")
        place = f"line {number}"
        if word == "v":
            vertices.append(_numbers(rest, f"vertex {len(vertices) + 1}", file, place))
        elif word == "vn":
            normals.append(_numbers(rest, f"normal {len(normals) + 1}", file, place))
        elif word == "f":
            corners, shading = _corners(rest.split(), len(vertices), len(normals), file, place)
            polygons.append(Polygon(corners, shading, material, name, place))
        elif word in ("o", "g") and rest.strip():
            name = rest.strip()
        elif word == "usemtl":
            material = rest.strip()
    return RawMesh(path, _array(vertices), _array(normals), polygons)


def _array(rows: list[tuple[float, float, float]]) -> Float64:
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _numbers(text: str, what: str, file: str, place: str) -> tuple[float, float, float]:
    """Three finite numbers; more (weights, colours) are ignored."""
    try:
        values = [float(part) for part in text.split()[:3]]
    except ValueError:
        values = []
    if len(values) != 3:
        raise InputError(f"is not three numbers: {text!r}", file=f"{file}, {place}", field=what)
    if not all(math.isfinite(value) for value in values):
        raise InputError(
            "is not finite",
            file=f"{file}, {place}",
            field=what,
            value=tuple(values),
            remedy="Repair the vertex in the modelling program and export again",
        )
    return (values[0], values[1], values[2])


def _corners(
    words: list[str], vertex_count: int, normal_count: int, file: str, place: str
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Vertex and normal indices, from 0, of `v`, `v/vt`, `v//vn` or `v/vt/vn` words."""
    corners, shading = [], []
    for word in words:
        parts = word.split("/")
        corners.append(_index(parts[0], vertex_count, "vertex", file, place))
        if len(parts) > 2 and parts[2]:
            shading.append(_index(parts[2], normal_count, "normal", file, place))
    if len(corners) < 3:
        raise InputError(f"has {len(corners)} corners", file=f"{file}, {place}", field="face", remedy="It needs 3")
    return tuple(corners), tuple(shading) if len(shading) == len(corners) else ()


def _index(word: str, count: int, what: str, file: str, place: str) -> int:
    try:
        index = int(word)
    except ValueError:
        raise InputError(f"has {word!r} where a {what} number belongs", file=f"{file}, {place}", field="face") from None
    resolved = index - 1 if index > 0 else count + index
    if index == 0 or not 0 <= resolved < count:
        raise InputError(
            f"names {what} {index}, but {count} are defined up to there (numbers begin at 1)",
            file=f"{file}, {place}",
            field="face",
            remedy="Export the mesh again",
        )
    return resolved


def read_gltf(path: Path) -> RawMesh:
    """glTF 2.0, text or binary, through trimesh: node transforms applied, triangles, material and node names."""
    import trimesh

    file = shown_path(path)
    try:
        scene: Any = trimesh.load(path, force="scene", process=False)
    except Exception as error:  # whatever trimesh raises for a broken file, the user can only replace the file
        raise InputError(f"cannot be read as glTF ({error})", file=file, remedy="Export it again") from error
    vertices: list[Float64] = []
    normals: list[Float64] = []
    polygons: list[Polygon] = []
    start = 0
    for node in sorted(scene.graph.nodes_geometry):
        transform, geometry_name = scene.graph[node]
        geometry = scene.geometry[geometry_name]
        if not hasattr(geometry, "faces"):
            continue
        material = getattr(getattr(geometry.visual, "material", None), "name", None) or ""
        own = np.asarray(geometry.vertices, dtype=np.float64)
        if not np.isfinite(own).all():
            bad = int(np.flatnonzero(~np.isfinite(own).all(axis=1))[0])
            raise InputError(
                "is not finite", file=file, field=f"vertex {bad} of {node}", value=tuple(own[bad].tolist())
            )
        linear = np.asarray(transform[:3, :3], dtype=np.float64)
        vertices.append(own @ linear.T + transform[:3, 3])
        # Normals transform by the inverse transpose; their length is made 1 later.
        normals.append(np.asarray(geometry.vertex_normals, dtype=np.float64) @ np.linalg.inv(linear))
        mirrored = np.linalg.det(linear) < 0.0
        for number, triangle in enumerate(geometry.faces):
            order = tuple(int(i) + start for i in (triangle[::-1] if mirrored else triangle))
            polygons.append(Polygon(order, order, material, str(node), f"triangle {number} of {node}"))
        start += len(own)
    if not vertices:
        return RawMesh(path, np.zeros((0, 3)), np.zeros((0, 3)))
    return RawMesh(path, np.concatenate(vertices), np.concatenate(normals), polygons)

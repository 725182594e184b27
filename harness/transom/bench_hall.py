"""A hall with as many triangles and openings as wanted: what speed and memory are measured on as a scene grows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.files import write_atomic
from transom.scene.model import (
    ConditionSpec,
    Material,
    Mesh,
    Opening,
    Scene,
    SensorSet,
    Site,
    View,
)

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

LENGTH_M, WIDTH_M, HEIGHT_M = 30.0, 20.0, 6.0
OBJECT_ROWS, OBJECT_COLUMNS = 4, 6
PANE_SHARE = 0.5
"""Edge of a pane against that of the bay of the roof that it is in."""

WALL, FLOOR, LEAF, BODY, PANE = range(5)
MATERIALS = (
    Material("wall", (0.7, 0.7, 0.7)),
    Material("floor", (0.3, 0.3, 0.3)),
    Material("leaf", (0.1, 0.3, 0.08)),
    Material("body", (0.5, 0.4, 0.3)),
    Material("pane", opening=0),
)


@dataclass
class _Parts:
    vertices: list[Float64] = field(default_factory=list)
    faces: list[Int32] = field(default_factory=list)
    materials: list[int] = field(default_factory=list)
    objects: list[str] = field(default_factory=list)
    count: int = 0

    def add(self, name: str, material: int, vertices: Float64, faces: Int32) -> None:
        self.vertices.append(vertices)
        self.faces.append(np.where(faces >= 0, faces + self.count, -1).astype(np.int32))
        self.materials.append(material)
        self.objects.append(name)
        self.count += len(vertices)


def hall_scene(triangle_count: int, opening_count: int, seed: int = 1) -> Scene:
    """A hall of 30 x 20 x 6 m under a roof with `opening_count` panes, with 24 trees and bodies.

    triangle_count: of trees and bodies together, about; at least a few hundred. Every second object is a tree: loose
    leaves, lit and seen from both sides. The others are closed bodies. Places of leaves are drawn from `seed`.
    """
    generator = np.random.default_rng(seed)
    parts = _Parts()
    _shell(parts, opening_count)
    each = max(triangle_count // (OBJECT_ROWS * OBJECT_COLUMNS), 12)
    for index in range(OBJECT_ROWS * OBJECT_COLUMNS):
        row, column = divmod(index, OBJECT_COLUMNS)
        middle = np.array(
            [(column + 0.5) * LENGTH_M / OBJECT_COLUMNS, (row + 0.5) * WIDTH_M / OBJECT_ROWS, 1.6], dtype=np.float64
        )
        if (row + column) % 2:
            parts.add(f"tree_{index}", LEAF, *_leaves(middle, each, generator))
        else:
            parts.add(f"body_{index}", BODY, *_body(middle, each))
    mesh = Mesh(
        np.concatenate(parts.vertices),
        np.concatenate(parts.faces),
        np.repeat(np.array(parts.materials, dtype=np.int32), [len(faces) for faces in parts.faces]),
        np.repeat(np.arange(len(parts.faces), dtype=np.int32), [len(faces) for faces in parts.faces]),
        tuple(parts.objects),
    )
    return Scene(
        name=f"hall_{triangle_count}_{opening_count}",
        file=Path(f"hall_{triangle_count}_{opening_count}"),
        title="Hall",
        description=f"A hall with {triangle_count} triangles of trees and bodies under {opening_count} panes.",
        mesh=mesh,
        materials=MATERIALS,
        openings=(Opening("roof", "pane", "clear", 0.8),),
        point_sources=(),
        site=Site("Zurich", math.radians(47.4), math.radians(8.5), 1.0),
        views=(View("hall", (0.5, 10.0, 3.0), (20.0, 10.0, 1.5), (0.0, 0.0, 1.0), math.radians(60), 640, 480, 2000.0),),
        conditions=(ConditionSpec("jun21_1200", "2026-06-21T12:00"), ConditionSpec("jun21_1500", "2026-06-21T15:00")),
        regions=(),
        sensors=(_sensors(),),
    )


def write_hall(folder: Path, scene: Scene) -> Path:
    """Writes a scene of `hall_scene` as a folder of scene.toml and mesh.obj, from which `load_scene` reads it."""
    mesh = scene.mesh
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*vertex) for vertex in mesh.vertices.tolist()]
    before = -1
    for face, material, owner in zip(
        (mesh.faces + 1).tolist(), mesh.face_material.tolist(), mesh.face_object.tolist(), strict=True
    ):
        if owner != before:
            lines += [f"o {mesh.objects[owner]}", f"usemtl {scene.materials[material].name}"]
            before = owner
        lines.append("f " + " ".join(str(corner) for corner in face if corner > 0))
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / "mesh.obj", ("\n".join(lines) + "\n").encode())
    materials = "".join(
        f"[materials.{entry.name}]\nreflectance = [{', '.join(f'{value:g}' for value in entry.reflectance)}]\n"
        for entry in scene.materials
        if entry.opening < 0
    )
    write_atomic(folder / "scene.toml", (_TOML + materials).encode())
    return folder


_TOML = """format = 1
title = "Hall"
description = "A hall with trees and bodies under a roof of panes."

[mesh]
file = "mesh.obj"
unit = "m"
up = "z"

[site]
name = "Zurich"
latitude_deg = 47.4
longitude_deg = 8.5
time_zone_h = 1

[[openings]]
name = "roof"
material = "pane"
glazing = "clear"
visible_transmittance = 0.8

[[views]]
name = "hall"
position_m = [0.5, 10.0, 3.0]
target_m = [20.0, 10.0, 1.5]
vertical_fov_deg = 60
width = 640
height = 480
display_white_cd_m2 = 2000

[[conditions]]
name = "jun21_1200"
time = "2026-06-21T12:00"

[[conditions]]
name = "jun21_1500"
time = "2026-06-21T15:00"

[[sensors]]
name = "floor"
corner_m = [1.0, 1.0, 0.1]
edge_u_m = [28.0, 0.0, 0.0]
edge_v_m = [0.0, 18.0, 0.0]
count = [7, 4]
normal = [0.0, 0.0, 1.0]

"""


def _shell(parts: _Parts, opening_count: int) -> None:
    """Floor, walls and a roof of bays, of which the first `opening_count` have a pane each."""
    x, y, z = LENGTH_M, WIDTH_M, HEIGHT_M
    columns = max(math.ceil(math.sqrt(opening_count * LENGTH_M / WIDTH_M)), 1)
    rows = math.ceil(max(opening_count, 1) / columns)
    at_x, at_y = np.linspace(0, x, columns + 1), np.linspace(0, y, rows + 1)
    quad = np.array([[0, 1, 2, 3]], dtype=np.int32)
    parts.add("floor", FLOOR, np.array([(0.0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)]), quad)
    corners = [(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)]
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        wall = np.array([(ax, ay, 0.0), (ax, ay, z), (bx, by, z), (bx, by, 0.0)])
        parts.add("wall", WALL, wall, quad)
    margin = 0.5 * (1 - PANE_SHARE)
    for bay in range(rows * columns):
        row, column = divmod(bay, columns)
        (x0, x1), (y0, y1) = at_x[column : column + 2], at_y[row : row + 2]
        outer = np.array([(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)])
        if bay >= opening_count:
            parts.add("roof", WALL, outer, quad[:, ::-1])
            continue
        inner = outer + margin * np.array(
            [(x1 - x0, y1 - y0, 0), (x0 - x1, y1 - y0, 0), (x0 - x1, y0 - y1, 0), (x1 - x0, y0 - y1, 0)]
        )
        frame = np.array([(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)], dtype=np.int32)
        parts.add("roof", WALL, np.concatenate([outer, inner]), frame[:, ::-1])
        parts.add("roof_panes", PANE, inner, quad)


def _leaves(middle: Float64, count: int, generator: np.random.Generator) -> tuple[Float64, Int32]:
    """Loose triangles in a ball; their area in all is the same whatever their number."""
    radius, area = 1.4, 12.0
    edge = math.sqrt(area / count * 4 / math.sqrt(3))
    direction = generator.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    place = middle + radius * np.cbrt(generator.random((count, 1))) * direction
    first = generator.normal(size=(count, 3))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(first, generator.normal(size=(count, 3)))
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    angles = 2 * math.pi * np.arange(3) / 3
    offset = (
        (np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]) * edge / math.sqrt(3)
    )
    faces = np.full((count, 4), -1, dtype=np.int32)
    faces[:, :3] = np.arange(3 * count, dtype=np.int32).reshape(count, 3)
    return (place[:, None] + offset).reshape(-1, 3), faces


def _body(middle: Float64, count: int) -> tuple[Float64, Int32]:
    """A closed, waved ball of about `count` triangles."""
    rings = max(round(math.sqrt(count / 4)), 2)
    sectors = max(count // (2 * rings), 3)
    theta = math.pi * np.arange(1, rings) / rings
    phi = 2 * math.pi * np.arange(sectors) / sectors
    theta, phi = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    radius = 1.2 + 0.1 * np.sin(theta) ** 3 * np.cos(6 * phi)
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    vertices = np.concatenate([radius[:, None] * around, [[0, 0, 1.2], [0, 0, -1.2]]]) + middle
    north, south = len(vertices) - 2, len(vertices) - 1
    ring, sector = (grid.ravel() for grid in np.meshgrid(np.arange(rings - 2), np.arange(sectors), indexing="ij"))
    after = (sector + 1) % sectors
    a, b = ring * sectors + sector, ring * sectors + after
    c, d = b + sectors, a + sectors
    cap = np.arange(sectors)
    last = (rings - 2) * sectors
    triangles = np.concatenate(
        [
            np.stack([a, d, c], axis=1),
            np.stack([a, c, b], axis=1),
            np.stack([np.full(sectors, north), cap, (cap + 1) % sectors], axis=1),
            np.stack([np.full(sectors, south), last + (cap + 1) % sectors, last + cap], axis=1),
        ]
    )
    faces = np.full((len(triangles), 4), -1, dtype=np.int32)
    faces[:, :3] = triangles
    return vertices, faces


def _sensors() -> SensorSet:
    x, y = np.meshgrid(1 + 28 * (np.arange(7) + 0.5) / 7, 1 + 18 * (np.arange(4) + 0.5) / 4, indexing="xy")
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.1)], axis=1)
    return SensorSet("floor", points, np.tile([0.0, 0.0, 1.0], (len(points), 1)))

"""The mesh builder of the authoring scripts: boxes, plates with holes, prisms, sheets and room shells, written as OBJ.

Coordinates are metres, x east, y north, z up. Every solid is closed, its faces counter-clockwise seen from outside,
its vertices shared between neighbouring faces (no T-junctions inside one solid). `Mesh.check` holds that.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float, float]
Place = Callable[[float, float, float], Point]  # plate coordinates (u, v, w) -> room coordinates

PLANAR_TOLERANCE_M = 1e-6


@dataclass
class Face:
    """A planar quad or triangle: vertex indices, material, object, the solid it belongs to (None: a single sheet)."""

    vertices: tuple[int, ...]
    material: str
    object: str
    solid: int | None
    normals: tuple[int, ...] = ()


@dataclass
class Mesh:
    """Vertices, optional vertex normals and faces. Vertices are shared within a solid and never between solids."""

    vertices: list[Point] = field(default_factory=list)
    normals: list[Point] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)
    solid_count: int = 0
    _shared: dict[tuple[int | None, Point], int] = field(default_factory=dict)

    def new_solid(self) -> int:
        """Number of a new solid, to be passed to `quad`."""
        self.solid_count += 1
        return self.solid_count

    def quad(
        self,
        corners: Sequence[Point],
        facing: Sequence[float] | NDArray[np.float64],
        material: str,
        object_name: str,
        solid: int | None,
        normals: Sequence[Point] = (),
    ) -> None:
        """Add a planar quad (or triangle) wound so that its front looks along `facing` (any vector on that side).

        normals: vertex normals, one per corner, for materials that the scene declares smooth.
        """
        points = np.asarray(corners, dtype=float)
        normal = sum(np.cross(points[i] - points[0], points[i + 1] - points[0]) for i in range(1, len(points) - 1))
        step = 1 if float(np.dot(normal, facing)) > 0 else -1
        vertices = tuple(self._vertex(p, solid) for p in list(corners)[::step])
        normal_ids: tuple[int, ...] = ()
        if normals:
            first = len(self.normals)
            self.normals.extend(_rounded(n) for n in list(normals)[::step])
            normal_ids = tuple(range(first, first + len(normals)))
        self.faces.append(Face(vertices, material, object_name, solid, normal_ids))

    def _vertex(self, point: Sequence[float], solid: int | None) -> int:
        key = (solid, _rounded(point))
        if key not in self._shared:
            self._shared[key] = len(self.vertices)
            self.vertices.append(key[1])
        return self._shared[key]

    def box(self, low: Sequence[float], high: Sequence[float], material: str, object_name: str) -> None:
        """Closed axis-aligned box between two corners."""
        self.plate([low[0], high[0]], [low[1], high[1]], low[2], high[2], horizontal, material, object_name)

    def plate(
        self,
        us: Sequence[float],
        vs: Sequence[float],
        w0: float,
        w1: float,
        place: Place,
        material: str,
        object_name: str,
        holes: frozenset[tuple[int, int]] = frozenset(),
    ) -> None:
        """Closed plate between w0 and w1 made of the grid cells us x vs, except `holes` (cell indices).

        One primitive for table tops of any rectilinear outline, window frames and partitions: every cell is one quad
        on either side, and an edge between a filled and an empty cell gets a side face.
        """
        solid = self.new_solid()
        filled = {(i, j) for i in range(len(us) - 1) for j in range(len(vs) - 1)} - holes
        origin = np.asarray(place(0, 0, 0))
        u_axis, v_axis, w_axis = (np.asarray(place(*axis)) - origin for axis in np.eye(3))
        for i, j in sorted(filled):
            u0, u1, v0, v1 = us[i], us[i + 1], vs[j], vs[j + 1]
            for w, side in ((w0, -w_axis), (w1, w_axis)):
                corners = [place(u, v, w) for u, v in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))]
                self.quad(corners, side, material, object_name, solid)
            for neighbour, (a, b), side in (
                ((i - 1, j), ((u0, v0), (u0, v1)), -u_axis),
                ((i + 1, j), ((u1, v0), (u1, v1)), u_axis),
                ((i, j - 1), ((u0, v0), (u1, v0)), -v_axis),
                ((i, j + 1), ((u0, v1), (u1, v1)), v_axis),
            ):
                if neighbour not in filled:
                    corners = [place(*a, w0), place(*b, w0), place(*b, w1), place(*a, w1)]
                    self.quad(corners, side, material, object_name, solid)

    def prism(
        self, outline: Sequence[tuple[float, float]], z0: float, z1: float, material: str, object_name: str
    ) -> None:
        """Closed upright prism over a convex outline with an even number of corners; its ends are strips of quads."""
        solid, count = self.new_solid(), len(outline)
        centre = np.mean(np.asarray(outline), axis=0)
        for k in range(count):
            a, b = outline[k], outline[(k + 1) % count]
            outwards = [(a[0] + b[0]) / 2 - centre[0], (a[1] + b[1]) / 2 - centre[1], 0]
            self.quad([(*a, z0), (*b, z0), (*b, z1), (*a, z1)], outwards, material, object_name, solid)
        for k in range(count // 2 - 1):
            strip = [outline[n] for n in (k, k + 1, count - k - 2, count - k - 1)]
            self.quad([(*p, z0) for p in strip], (0, 0, -1), material, object_name, solid)
            self.quad([(*p, z1) for p in strip], (0, 0, 1), material, object_name, solid)

    def add(self, piece: Mesh, at: Sequence[float] = (0, 0, 0), turn_deg: float = 0.0, object_name: str = "") -> None:
        """Add a copy of `piece`, turned about z (counter-clockwise from above) and moved; a name renames it."""
        angle = np.radians(turn_deg)
        cos, sin = float(np.cos(angle)), float(np.sin(angle))

        def turned(p: Point) -> Point:
            return (cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], p[2])

        solids = {s: self.new_solid() for s in sorted({f.solid for f in piece.faces if f.solid is not None})}
        for face in piece.faces:
            solid = solids[face.solid] if face.solid is not None else None
            corners = [tuple(np.add(turned(piece.vertices[v]), at)) for v in face.vertices]
            ids = tuple(self._vertex(c, solid) for c in corners)
            first = len(self.normals)
            self.normals.extend(_rounded(turned(piece.normals[n])) for n in face.normals)
            normal_ids = tuple(range(first, first + len(face.normals)))
            self.faces.append(Face(ids, face.material, object_name or face.object, solid, normal_ids))

    @property
    def triangle_count(self) -> int:
        """Triangles after splitting every quad in two."""
        return sum(len(f.vertices) - 2 for f in self.faces)

    def check(self) -> None:
        """Raise ValueError for a face without area, a quad that is not planar, a solid that is open or inside out."""
        points = np.asarray(self.vertices)
        edges: dict[int, Counter[tuple[int, int]]] = {}
        volume: dict[int, float] = {}
        for face in self.faces:
            p = points[list(face.vertices)]
            normal = sum(np.cross(p[i] - p[0], p[i + 1] - p[0]) for i in range(1, len(p) - 1))
            if np.linalg.norm(normal) < 1e-8:
                raise ValueError(f"{face.object}: a face has no area: {p.tolist()}")
            if np.max(np.abs((p - p[0]) @ (normal / np.linalg.norm(normal)))) > PLANAR_TOLERANCE_M:
                raise ValueError(f"{face.object}: a quad is not planar: {p.tolist()}")
            if face.solid is None:
                continue
            for a, b in zip(face.vertices, face.vertices[1:] + face.vertices[:1], strict=True):
                edges.setdefault(face.solid, Counter())[(min(a, b), max(a, b))] += 1 if a < b else -1
            for i in range(1, len(p) - 1):
                share = float(np.dot(p[0], np.cross(p[i], p[i + 1]))) / 6
                volume[face.solid] = volume.get(face.solid, 0.0) + share
        for face in self.faces:
            if face.solid is not None and (any(edges[face.solid].values()) or volume[face.solid] <= 0):
                raise ValueError(f"{face.object}: a solid is open or inside out (volume {volume[face.solid]:.6g} m³)")

    def write(self, path: Path, comment: str) -> None:
        """Check, then write a Wavefront OBJ: objects in order of first use, six decimals (micrometres)."""
        self.check()
        lines = [f"# {comment}", "# metres, x east, y north, z up; written by scenes/authoring/build.py"]
        lines += ["v " + " ".join(_number(c) for c in v) for v in self.vertices]
        lines += ["vn " + " ".join(_number(c) for c in n) for n in self.normals]
        for name in dict.fromkeys(f.object for f in self.faces):
            lines.append(f"o {name}")
            material = ""
            for face in (f for f in self.faces if f.object == name):
                if face.material != material:
                    material = face.material
                    lines.append(f"usemtl {material}")
                if face.normals:
                    pairs = zip(face.vertices, face.normals, strict=True)
                    lines.append("f " + " ".join(f"{v + 1}//{n + 1}" for v, n in pairs))
                else:
                    lines.append("f " + " ".join(str(v + 1) for v in face.vertices))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="ascii")


def horizontal(u: float, v: float, w: float) -> Point:
    """Plate coordinates of things that lie flat: u east, v north, w up."""
    return (u, v, w)


def _rounded(point: Sequence[float]) -> Point:
    x, y, z = (round(float(c), 6) + 0.0 for c in point)
    return (x, y, z)


def _number(value: float) -> str:
    return f"{value:.6f}".rstrip("0").rstrip(".") or "0"

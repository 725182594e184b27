"""Products that repeat along two axes: a cell of triangles, and light traced through it by Embree."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom import _engine
from transom.errors import InputError
from transom.products.section import KINDS, Exits, Float64, Sweep, Traced, swept
from transom.scene.mesh import read_mesh

MARGIN = 0.05
"""Of the larger of thickness and periods: air between a product and the planes where light enters and leaves."""


@dataclass(frozen=True)
class CellSurface:
    """What a facet is. front, back: media of its sides, by number; numbers as in optical_surface.h."""

    kind: str = "interface"
    front: int = 0
    back: int = 0
    reflectance: float = 0.0
    reflectance_back: float = 0.0
    transmittance: float = 0.0
    openness: float = 0.0


@dataclass(frozen=True, eq=False)
class UnitCell:
    """One cell of a product. media: (index of refraction, absorption [1/m]), the first is air.

    corners (N, 3) [m]; facets (M, 4): three corners, counter-clockwise from the front, and the number of a surface.
    """

    period_x_m: float
    period_y_m: float
    media: tuple[tuple[float, float], ...]
    surfaces: tuple[CellSurface, ...]
    corners: Float64
    facets: NDArray[np.int32]

    @property
    def depth(self) -> tuple[float, float]:
        """Least and greatest z of its facets [m]."""
        z = self.corners[self.facets[:, :3].ravel(), 2]
        return float(z.min()), float(z.max())

    @property
    def is_diffuse(self) -> bool:
        """Whether any of its surfaces scatters."""
        return any(surface.kind == "diffuse" for surface in self.surfaces)

    @cached_property
    def _core(self) -> _engine.UnitCell:
        low, high = self.depth
        margin = MARGIN * max(high - low, self.period_x_m, self.period_y_m)
        surfaces = [
            _engine.Surface(
                KINDS[s.kind], s.front, s.back, s.reflectance, s.reflectance_back, s.transmittance, s.openness
            )
            for s in self.surfaces
        ]
        return _engine.UnitCell(
            self.period_x_m,
            self.period_y_m,
            low - margin,
            high + margin,
            list(self.media),
            surfaces,
            np.ascontiguousarray(self.corners, np.float64),
            np.ascontiguousarray(self.facets, np.int32),
        )

    def trace(self, direction: Sequence[float] | Float64, rays: int = 1024, seed: int = 1) -> Traced:
        """Sends parallel unpolarised light along `direction` (z > 0: from outdoors) through the product."""
        x, y, z = (float(v) for v in direction)
        sent, back, absorbed, unfinished = self._core.trace((x, y, z), rays, seed)
        return Traced(Exits(sent[:, :3], sent[:, 3]), Exits(back[:, :3], back[:, 3]), absorbed, unfinished)

    def sweep(self, directions: Float64, rays: int = 16, seed: int = 1) -> Sweep:
        """Sends light along each of `directions` (N, 3) through the product: many directions, few rays each."""
        return swept(self._core.sweep(np.ascontiguousarray(directions, np.float64), rays, seed))


def cell_from_mesh(
    file: Path,
    period_x: float,
    period_y: float,
    media: tuple[tuple[float, float], ...],
    surfaces: Mapping[str, CellSurface],
) -> UnitCell:
    """A cell from a mesh in metres whose materials (OBJ: usemtl) name its surfaces. Polygons become fans of triangles.

    Raises InputError for a material that is no surface, and for a surface that no facet has.
    """
    mesh = read_mesh(file)
    names = list(surfaces)
    facets: list[tuple[int, int, int, int]] = []
    for polygon in mesh.polygons:
        if polygon.material not in surfaces:
            remedy = f"Name one of the surfaces of product.toml: {', '.join(names)}"
            raise InputError(
                "is not a surface", file=file, field=f"{polygon.place}: material", value=polygon.material, remedy=remedy
            )
        first, *others = polygon.corners
        number = names.index(polygon.material)
        facets += [(first, a, b, number) for a, b in itertools.pairwise(others)]
    for number, name in enumerate(names):
        if all(facet[3] != number for facet in facets):
            raise InputError("is on no facet of the mesh", file=file, field="surface", value=name)
    return UnitCell(period_x, period_y, media, tuple(surfaces.values()), mesh.vertices, np.array(facets, np.int32))


def perforated_sheet(
    pitch: float, diameter: float, thickness: float, reflectance: float, hole_sides: float = 64
) -> UnitCell:
    """A diffuse sheet with round holes on a square grid. hole_sides: sides of the polygon that stands for a circle of
    the same area, a multiple of 8."""
    sides = int(hole_sides)
    if not 0 < diameter < pitch or not thickness > 0:
        raise ValueError("0 < diameter < pitch and thickness > 0")
    if sides != hole_sides or sides < 8 or sides % 8:
        raise ValueError("hole_sides is a multiple of 8")
    turn = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    radius = diameter / 2 * math.sqrt((2 * np.pi / sides) / math.sin(2 * np.pi / sides))
    square = circle / np.abs(circle).max(axis=1, keepdims=True) * pitch / 2
    rings = [
        np.column_stack([ring + pitch / 2, np.full(sides, z)])
        for z in (0.0, thickness)
        for ring in (circle * radius, square)
    ]
    facets: list[tuple[int, int, int, int]] = []
    low_hole, low_edge, high_hole, high_edge = (k * sides for k in range(4))
    for k in range(sides):
        n = (k + 1) % sides
        for a, b in ((high_hole, high_edge), (low_edge, low_hole), (low_hole, high_hole)):
            # Seen from their fronts: the room side, the outdoor side, and the axis of the hole.
            facets += [(a + k, b + k, b + n, 0), (a + k, b + n, a + n, 0)]
    surface = CellSurface("diffuse", reflectance=reflectance, reflectance_back=reflectance)
    return UnitCell(pitch, pitch, ((1.0, 0.0),), (surface,), np.concatenate(rings), np.array(facets, np.int32))

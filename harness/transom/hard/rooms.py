"""Rooms in code: polygons, materials and openings, written as a scene folder and read back by the usual loader."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.scene import load_scene
from transom.scene.model import Scene

Float64 = NDArray[np.float64]
Point = tuple[float, float, float]
Points = Sequence[Point]

ROOM_M = (4.0, 5.0, 3.0)
"""Size of the usual room; one corner is the origin, its window looks south (towards -y)."""

WINDOW_M = (1.0, 1.0, 3.0, 2.5)
"""The usual window in its wall: low x, low z, high x, high z."""

SENSORS_M = ((2.0, 1.0, 0.8), (2.0, 2.5, 0.8), (1.0, 4.0, 0.8), (3.5, 4.5, 0.8))
"""Where illuminance is measured in the usual room, looking up."""


@dataclass(frozen=True)
class Polygon:
    """A face of three corners or more [m], counter-clockwise from its front. normals: of its corners, or none."""

    corners: tuple[Point, ...]
    material: str = "wall"
    object: str = "room"
    normals: tuple[Point, ...] = ()


@dataclass(frozen=True)
class Room:
    """A scene that is not yet in files. materials: lines of [materials.NAME]; openings: transmittance by material,
    None for an unglazed hole. extra: more of scene.toml."""

    polygons: tuple[Polygon, ...]
    materials: Mapping[str, str] = field(default_factory=lambda: {"wall": "reflectance = 0.5"})
    openings: Mapping[str, float | None] = field(default_factory=dict)
    sensors: Points = SENSORS_M
    camera: Point = (2.0, 4.5, 1.5)
    target: Point = (2.0, 0.0, 1.2)
    condition: str = (
        'time = "2026-03-21T12:00"\nsky = "uniform"\n'
        "diffuse_horizontal_illuminance_lx = 10000\ndirect_normal_illuminance_lx = 60000"
    )
    site: str = "latitude_deg = 42.4\nlongitude_deg = -71.0\ntime_zone_h = -5"
    extra: str = ""

    def with_polygons(self, *polygons: Polygon) -> Room:
        return replace(self, polygons=self.polygons + polygons)

    def with_material(self, name: str, lines: str) -> Room:
        return replace(self, materials={**self.materials, name: lines})

    def load(self) -> Scene:
        """The scene as the loader sees it. Raises its InputError."""
        with tempfile.TemporaryDirectory(prefix="hard_") as folder:
            (Path(folder) / "mesh.obj").write_text(self.obj(), encoding="utf-8")
            (Path(folder) / "scene.toml").write_text(self.toml(), encoding="utf-8")
            return load_scene(Path(folder))

    def obj(self) -> str:
        """The mesh, its numbers as exact as they are here."""
        lines: list[str] = []
        corner_count = normal_count = 0
        for polygon in self.polygons:
            lines += [f"o {polygon.object}", f"usemtl {polygon.material}"]
            lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in polygon.corners]
            lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in polygon.normals]
            words = []
            for k in range(len(polygon.corners)):
                corner = str(corner_count + k + 1)
                words.append(f"{corner}//{normal_count + k + 1}" if polygon.normals else corner)
            lines.append("f " + " ".join(words))
            corner_count += len(polygon.corners)
            normal_count += len(polygon.normals)
        return "\n".join(lines) + "\n"

    def toml(self) -> str:
        parts = ['format = 1\ntitle = "A hard case"\n\n[mesh]\nfile = "mesh.obj"\nunit = "m"\nup = "z"\n']
        parts.append(f'[site]\nname = "A place"\n{self.site}\n')
        parts += [f"[materials.{name}]\n{lines}\n" for name, lines in self.materials.items()]
        for material, transmittance in self.openings.items():
            glazing = "none" if transmittance is None else "clear"
            value = "" if transmittance is None else f"visible_transmittance = {transmittance!r}\n"
            parts.append(f'[[openings]]\nname = "{material}"\nmaterial = "{material}"\nglazing = "{glazing}"\n{value}')
        parts.append(
            f'[[views]]\nname = "inside"\nposition_m = {_list(self.camera)}\ntarget_m = {_list(self.target)}\n'
            "vertical_fov_deg = 60\nwidth = 64\nheight = 48\ndisplay_white_cd_m2 = 1000\n"
        )
        parts.append(f'[[conditions]]\nname = "day"\n{self.condition}\n')
        if self.sensors:
            points = ", ".join(_list(point) for point in self.sensors)
            parts.append(f'[[sensors]]\nname = "desk"\npoints_m = [{points}]\nnormal = [0, 0, 1]\n')
        return "\n".join([*parts, self.extra])


def _list(point: Point) -> str:
    return "[" + ", ".join(repr(float(value)) for value in point) + "]"


def as_point(values: Iterable[float]) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z


def quad(a: Point, b: Point, c: Point, d: Point, material: str = "wall", object: str = "room") -> Polygon:  # noqa: A002
    return Polygon((a, b, c, d), material, object)


def box(
    low: Point,
    high: Point,
    material: str = "wall",
    object: str = "box",  # noqa: A002
    *,
    inward: bool = False,
    without: Sequence[str] = (),
) -> list[Polygon]:
    """Sides of an axis-aligned box by name ("x0", "x1", ..), their fronts outwards (or inwards)."""
    corner = [tuple(high[axis] if k >> axis & 1 else low[axis] for axis in range(3)) for k in range(8)]
    sides = {
        "z0": (0, 2, 3, 1),
        "z1": (4, 5, 7, 6),
        "y0": (0, 1, 5, 4),
        "y1": (2, 6, 7, 3),
        "x0": (0, 4, 6, 2),
        "x1": (1, 3, 7, 5),
    }
    return [
        Polygon(tuple(as_point(corner[k]) for k in (indices[::-1] if inward else indices)), material, object)
        for name, indices in sides.items()
        if name not in without
    ]


def frame(outer: Points, inner: Points, material: str = "wall", object: str = "room") -> list[Polygon]:  # noqa: A002
    """The ring between two quads with corners in the same order: four faces without T-junctions."""
    return [quad(outer[k], outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k], material, object) for k in range(4)]


def shell(size: Point = ROOM_M, without: Sequence[str] = ("y0",), material: str = "wall") -> list[Polygon]:
    """The usual room's sides, fronts inwards, but those of some names."""
    return box((0.0, 0.0, 0.0), size, material, "room", inward=True, without=without)


def windowed_room(
    window: tuple[float, float, float, float] = WINDOW_M, transmittance: float | None = 0.8, reflectance: float = 0.5
) -> Room:
    """The usual room, with a window in its south wall."""
    x, _, z = ROOM_M
    x0, z0, x1, z1 = window
    outer = [(0.0, 0.0, 0.0), (0.0, 0.0, z), (x, 0.0, z), (x, 0.0, 0.0)]
    inner = [(x0, 0.0, z0), (x0, 0.0, z1), (x1, 0.0, z1), (x1, 0.0, z0)]
    wall = frame(outer, inner)
    pane = Polygon(tuple(inner[::-1]), "glass", "window")
    return Room(
        (*shell(), *wall, pane),
        materials={"wall": f"reflectance = {reflectance!r}"},
        openings={"glass": transmittance},
    )

"""Small scenes and skies made in code, whose light is known or simple."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Material, Mesh, Opening, PointSource, Scene, Site, View

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class UniformSky:
    """A sky of one luminance [cd/m²]."""

    level: float

    def luminance(self, directions: Float64) -> Float64:
        return np.where(directions[:, 2] >= 0, self.level, 0.0)


@dataclass(frozen=True)
class GradedSky:
    """A sky that is bright towards one side: level (1 + contrast · direction · towards), never negative."""

    level: float
    towards: tuple[float, float, float]
    contrast: float = 0.8

    def luminance(self, directions: Float64) -> Float64:
        graded = self.level * (1 + self.contrast * directions @ np.array(self.towards))
        return np.where(directions[:, 2] >= 0, graded, 0.0)


@dataclass(frozen=True)
class PlainCondition:
    """What a renderer reads of transom.daylight.condition.Condition."""

    sky: Any
    sun_direction: Float64 | None = None
    sun_illuminance_rgb: Float64 = field(default_factory=lambda: np.zeros(3))
    sky_rgb: Float64 = field(default_factory=lambda: np.ones(3))
    ground_luminance_rgb: Float64 = field(default_factory=lambda: np.zeros(3))

    def environment_image(self, height: int) -> NDArray[np.float32]:
        """Latitude-longitude radiance as in Condition; ground in the rows below the horizon, half-half on it."""
        theta = np.pi * np.arange(height) / (height - 1)
        azimuth = 2 * np.pi * (np.arange(2 * height) + 0.5) / (2 * height)
        t, a = np.meshgrid(theta, azimuth, indexing="ij")
        directions = np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)], axis=-1)
        values = self.sky.luminance(directions.reshape(-1, 3)).reshape(t.shape)[..., None] * self.sky_rgb
        image = np.where((t > np.pi / 2)[..., None], self.ground_luminance_rgb, values)
        return image.astype(np.float32)


def box_quads(size: tuple[float, float, float]) -> dict[str, Float64]:
    """The six faces of the box from (0, 0, 0) to `size`, corners counter-clockwise seen from inside."""
    x, y, z = size
    return {
        "floor": np.array([[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]], dtype=float),
        "ceiling": np.array([[0, 0, z], [0, y, z], [x, y, z], [x, 0, z]], dtype=float),
        "south": np.array([[0, 0, 0], [0, 0, z], [x, 0, z], [x, 0, 0]], dtype=float),
        "north": np.array([[0, y, 0], [x, y, 0], [x, y, z], [0, y, z]], dtype=float),
        "west": np.array([[0, 0, 0], [0, y, 0], [0, y, z], [0, 0, z]], dtype=float),
        "east": np.array([[x, 0, 0], [x, 0, z], [x, y, z], [x, y, 0]], dtype=float),
    }


def south_wall_with_window(
    size: tuple[float, float, float], window: tuple[float, float, float, float]
) -> list[Float64]:
    """The south wall around a window (x0, z0, x1, z1), four quads, and the window's own quad last (front outdoors)."""
    x, _, z = size
    x0, z0, x1, z1 = window

    def quad(a: float, b: float, c: float, d: float) -> Float64:
        return np.array([[a, 0, b], [a, 0, d], [c, 0, d], [c, 0, b]], dtype=float)

    wall = [quad(0, 0, x, z0), quad(0, z1, x, z), quad(0, z0, x0, z1), quad(x1, z0, x, z1)]
    return [*wall, quad(x0, z0, x1, z1)[::-1]]


def make_scene(
    quads: list[tuple[Float64, str]],
    materials: tuple[Material, ...],
    openings: tuple[Opening, ...] = (),
    point_sources: tuple[PointSource, ...] = (),
) -> Scene:
    """A scene of separate quads with materials by name; openings' materials are recognised by name."""
    names = [material.name for material in materials]
    vertices = np.concatenate([quad for quad, _ in quads])
    faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 4)
    mesh = Mesh(
        vertices,
        faces,
        np.array([names.index(name) for _, name in quads], dtype=np.int32),
        np.zeros(len(faces), dtype=np.int32),
        ("all",),
    )
    return Scene(
        "test", Path("test"), "test", "", mesh, materials, openings, point_sources,
        Site("here", 0.0, 0.0, 0.0), (), (), (), (),
    )  # fmt: skip


def window_room(glazing: str = "clear", transmittance: float = 0.78) -> Scene:
    """A 4 x 5 x 3 m room: grey walls, dark floor, red east wall, a 2 x 1.4 m south window."""
    size = (4.0, 5.0, 3.0)
    faces = box_quads(size)
    quads = [(faces[name], name) for name in ("floor", "ceiling", "north", "west", "east")]
    *wall, window = south_wall_with_window(size, (1.0, 0.9, 3.0, 2.3))
    quads += [(quad, "south") for quad in wall] + [(window, "glass")]
    grey = {"floor": 0.2, "ceiling": 0.8, "north": 0.5, "west": 0.5, "south": 0.5}
    materials = tuple(Material(name, (value,) * 3) for name, value in grey.items())
    materials += (Material("east", (0.6, 0.3, 0.2)), Material("glass", opening=0))
    opening = Opening("window", "glass", glazing, transmittance)  # type: ignore[arg-type]
    return make_scene(quads, materials, (opening,))


def room_view(width: int = 32, height: int = 24) -> View:
    """From the south-west upper corner to the north-east lower one."""
    return View("in", (0.4, 0.5, 2.4), (3.2, 4.4, 0.6), (0.0, 0.0, 1.0), np.radians(70), width, height, 1000.0)

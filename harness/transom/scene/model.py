"""The scene: what every renderer receives. Plain frozen data in metres, z up, radians; no file is read here."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]


@dataclass(frozen=True)
class Mesh:
    """Planar quads and triangles with one material each.

    vertices: (V, 3) metres, x east, y north, z up, double precision.
    faces: (F, 4) vertex indices, counter-clockwise seen from the front; the fourth is -1 for a triangle.
    Every renderer splits a quad a, b, c, d into (a, b, c) and (a, c, d): see `triangles`.
    face_material: (F,) index into Scene.materials. face_object: (F,) index into `objects`.
    corner_normals: (F, 4, 3) unit shading normals, or None where no material of the scene is smooth;
    rows of faces that are not smooth hold the face's own normal.
    """

    vertices: Float64
    faces: Int32
    face_material: Int32
    face_object: Int32
    objects: tuple[str, ...]
    corner_normals: Float64 | None = None

    def triangles(self) -> tuple[Int32, Int32]:
        """Triangles (T, 3) as vertex indices, and for each the face it comes from (T,)."""
        quad = np.flatnonzero(self.faces[:, 3] >= 0)
        first, second = self.faces[:, [0, 1, 2]], self.faces[quad][:, [0, 2, 3]]
        source = np.concatenate([np.arange(len(self.faces)), quad])
        order = np.argsort(source, kind="stable")
        return (
            np.concatenate([first, second])[order].astype(np.int32),
            source[order].astype(np.int32),
        )


@dataclass(frozen=True)
class Material:
    """A diffuse surface (both sides alike), or the face of an opening.

    reflectance: (3,) linear Rec. 709, 0..1 (below 1). luminance: (3,) own luminance [cd/m²] of an emitter, both sides.
    smooth: shade with the mesh's vertex normals. opening: index into Scene.openings, or -1 for an opaque surface.
    """

    name: str
    reflectance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    luminance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    smooth: bool = False
    opening: int = -1


@dataclass(frozen=True)
class ProductChoice:
    """A glazing product in an opening (transom.fenestration).

    name: a product's, or the path of a BSDF file. parameters: numbers that differ from the product's own.
    digest: SHA-256 (hex) of all that its light depends on.
    """

    name: str
    parameters: tuple[tuple[str, float], ...]
    digest: str


@dataclass(frozen=True)
class Opening:
    """An opening group: all faces of one mesh material that daylight passes. Its faces' fronts look outdoors.

    glazing: "clear" (one pane, angular transmittance by transom.glass), "none" (an unglazed hole), or "product" (a
    complex fenestration system). visible_transmittance: normal-hemispherical transmittance at normal incidence, 0..1;
    0 for a product, which passes no light straight but by its own BTDF. product: what is in it, for "product" alone.
    """

    name: str
    material: str
    glazing: Literal["clear", "none", "product"]
    visible_transmittance: float
    product: ProductChoice | None = None


@dataclass(frozen=True)
class PointSource:
    """An isotropic point source: position [m], intensity (3,) [cd] as linear RGB whose Y is candela."""

    name: str
    position: tuple[float, float, float]
    intensity: tuple[float, float, float]


@dataclass(frozen=True)
class Site:
    """Place and clock. Angles in radians; longitude east positive; time_zone_h: hours ahead of UTC, standard time."""

    name: str
    latitude_rad: float
    longitude_rad: float
    time_zone_h: float
    elevation_m: float = 0.0


@dataclass(frozen=True)
class View:
    """A perspective camera. vertical_fov_rad spans the image height. display_white_cd_m2: luminance shown as white."""

    name: str
    position: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    vertical_fov_rad: float
    width: int
    height: int
    display_white_cd_m2: float


@dataclass(frozen=True)
class Region:
    """A named part of the image: pixels whose first surface belongs to one of `objects` (shell patterns), and/or
    whose point lies in the axis-aligned `box` ((x0, y0, z0), (x1, y1, z1)) [m]. Empty objects: any surface."""

    name: str
    objects: tuple[str, ...] = ()
    box: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None


@dataclass(frozen=True)
class SensorSet:
    """Illuminance sensors: points (N, 3) [m], unit normals (N, 3), and what the set is for (shown in reports)."""

    name: str
    points: Float64
    normals: Float64
    target: bool = False


@dataclass(frozen=True)
class ConditionSpec:
    """Place-independent description of a condition, as written in scene.toml or on the command line.

    time: civil standard time "2026-03-21T10:00". sky: "cie:1".."cie:16", "clear" (cie:12), "overcast" (cie:1),
    "uniform" (cie:5), "perez:DNI,DHI" [W/m²], or "none" (a scene lit by emitters alone).
    At most one of zenith_luminance_cd_m2 and diffuse_horizontal_illuminance_lx; with neither, the IES availability
    model gives the level. direct_normal_illuminance_lx None: the same model (0 for overcast skies).
    """

    name: str
    time: str
    sky: str = "cie:12"
    zenith_luminance_cd_m2: float | None = None
    diffuse_horizontal_illuminance_lx: float | None = None
    direct_normal_illuminance_lx: float | None = None
    ground_albedo: float = 0.2
    sun_colour_temperature_k: float | None = None
    sky_colour_temperature_k: float | None = None


@dataclass(frozen=True)
class Scene:
    """Everything that a scene folder says. The first view and the first condition are the defaults.

    A variant (transom.fenestration.reglazing) has other glazing than its folder says: variant_of is then the folder's
    name, and glazings say what was replaced, as on the command line.
    """

    name: str
    file: Path
    title: str
    description: str
    mesh: Mesh
    materials: tuple[Material, ...]
    openings: tuple[Opening, ...]
    point_sources: tuple[PointSource, ...]
    site: Site
    views: tuple[View, ...]
    conditions: tuple[ConditionSpec, ...]
    regions: tuple[Region, ...]
    sensors: tuple[SensorSet, ...]
    tags: tuple[str, ...] = field(default=())
    variant_of: str = ""
    glazings: tuple[str, ...] = ()

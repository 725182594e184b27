"""Scenes drawn in code: quads with material and object names, made into a Scene by the steps that files go through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.daylight.cie_sky import CieSky
from transom.daylight.condition import Condition
from transom.daylight.sky_model import SkyModel, relative_zenith_luminance
from transom.daylight.sun import SunPosition
from transom.glass import MAX_TRANSMITTANCE
from transom.scene import checks
from transom.scene.geometry import build_mesh
from transom.scene.mesh import Polygon, RawMesh
from transom.scene.model import ConditionSpec, Material, Opening, PointSource, Scene, Site

Float64 = NDArray[np.float64]
Range = tuple[float, float]

NOWHERE = Site("nowhere", 0.0, 0.0, 0.0)
BLACK = "black"


@dataclass
class Drawing:
    """A scene being drawn [m]. Materials are grey; `black` is there from the start."""

    name: str
    title: str
    vertices: list[tuple[float, float, float]] = field(default_factory=list)
    polygons: list[Polygon] = field(default_factory=list)
    materials: dict[str, Material] = field(default_factory=dict)
    openings: list[Opening] = field(default_factory=list)
    point_sources: list[PointSource] = field(default_factory=list)

    def material(self, name: str, reflectance: float = 0.0, luminance: float = 0.0) -> str:
        """Declares a diffuse grey surface: reflectance 0..1, own luminance [cd/m²]."""
        self.materials[name] = Material(name, (reflectance,) * 3, (luminance,) * 3)
        return name

    def opening(self, name: str, glazed: bool) -> str:
        """Declares an opening group: a hole, or a pane that absorbs nothing. Its faces' fronts must look outdoors."""
        if glazed:
            self.openings.append(Opening(name, name, "clear", MAX_TRANSMITTANCE))
        else:
            self.openings.append(Opening(name, name, "none", 1.0))
        return name

    def lamp(self, position: tuple[float, float, float], intensity_cd: float) -> None:
        self.point_sources.append(PointSource(f"lamp {len(self.point_sources) + 1}", position, (intensity_cd,) * 3))

    def polygon(self, material: str, corners: Sequence[Sequence[float]]) -> None:
        """A face, counter-clockwise from its front."""
        first = len(self.vertices)
        self.vertices += [(float(x), float(y), float(z)) for x, y, z in corners]
        numbers = tuple(range(first, first + len(corners)))
        self.polygons.append(Polygon(numbers, (), material, material, f"face {len(self.polygons) + 1}"))

    def rectangle(self, material: str, axis: int, place: float, u: Range, v: Range, *, front_up: bool) -> None:
        """A rectangle across an axis, u and v along the two others in ascending order; front_up: its front looks
        towards the axis's positive end."""
        first, second = (other for other in range(3) if other != axis)
        corners = np.full((4, 3), float(place))
        corners[:, first] = [u[0], u[1], u[1], u[0]]
        corners[:, second] = [v[0], v[0], v[1], v[1]]
        # u x v points along +x and +z, but along -y.
        is_up = axis != 1
        self.polygon(material, (corners if is_up == front_up else corners[::-1]).tolist())

    def room(
        self,
        low: Sequence[float],
        high: Sequence[float],
        fields: dict[str, dict[str, tuple[Range, Range]]] | None = None,
        materials: dict[str, str] | None = None,
    ) -> None:
        """The six sides of a box, fronts inwards.

        fields: by side (x0, x1, ... z1), rectangles (u, v) of other materials: openings, emitters, reflecting fields.
        materials: by side; black where not named. All sides are cut by one grid, so that neighbours share vertices.
        """
        fields, materials = fields or {}, materials or {}
        cuts: list[set[float]] = [{float(low[axis]), float(high[axis])} for axis in range(3)]
        for side, rectangles in fields.items():
            first, second = (other for other in range(3) if other != "xyz".index(side[0]))
            for u, v in rectangles.values():
                cuts[first].update(u)
                cuts[second].update(v)
        outward = {opening.material for opening in self.openings}
        for axis in range(3):
            first, second = (other for other in range(3) if other != axis)
            for end, place in ((0, low[axis]), (1, high[axis])):
                side = f"{'xyz'[axis]}{end}"
                for u, v in product(pairwise(sorted(cuts[first])), pairwise(sorted(cuts[second]))):
                    name = _field_at(fields.get(side, {}), u, v) or materials.get(side, BLACK)
                    self.rectangle(name, axis, float(place), u, v, front_up=(end == 0) != (name in outward))

    def scene(self, *, closed: bool = True) -> Scene:
        """The scene, checked as files are. closed: whether to look for holes that no opening declares.

        Raises InputError.
        """
        used = {polygon.material for polygon in self.polygons}
        plain = {BLACK: Material(BLACK), **self.materials}
        materials = (
            *(material for name, material in plain.items() if name in used),
            *(Material(opening.material, opening=index) for index, opening in enumerate(self.openings)),
        )
        raw = RawMesh(Path(self.name), np.array(self.vertices), np.zeros((0, 3)), self.polygons)
        index_of = {material.name: index for index, material in enumerate(materials)}
        mesh = build_mesh(raw, "m", "z", 0.0, index_of, frozenset())
        scene = Scene(
            name=self.name,
            file=Path(self.name),
            title=self.title,
            description="",
            mesh=mesh,
            materials=materials,
            openings=tuple(self.openings),
            point_sources=tuple(self.point_sources),
            site=NOWHERE,
            views=(),
            conditions=(),
            regions=(),
            sensors=(),
            tags=("analytic",),
        )
        checks.check_light(scene, self.name)
        checks.check_doubled_faces(scene, self.name)
        if closed:
            checks.check_enclosure(scene, self.name)
        return scene


def _field_at(fields: dict[str, tuple[Range, Range]], u: Range, v: Range) -> str | None:
    """The field that holds a cell, if any."""
    middle_u, middle_v = 0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1])
    for name, (field_u, field_v) in fields.items():
        if field_u[0] < middle_u < field_u[1] and field_v[0] < middle_v < field_v[1]:
            return name
    return None


def dark() -> Condition:
    """No sky, no sun, black ground: for scenes with light of their own."""
    return replace(sky_condition("dark", 5, zenith_cd_m2=0.0), spec=ConditionSpec("dark", "", sky="none"))


def sky_condition(
    name: str,
    cie_type: int,
    *,
    zenith_cd_m2: float,
    sun_altitude_rad: float = 0.8,
    sun_azimuth_rad: float = 0.0,
    direct_normal_lx: float = 0.0,
    ground_albedo: float = 0.0,
) -> Condition:
    """A CIE sky of given zenith luminance around a sun of given place, which shines with `direct_normal_lx`."""
    sun = SunPosition(sun_altitude_rad, sun_azimuth_rad)
    towards = sun.direction()
    pattern = CieSky(cie_type)
    scale = zenith_cd_m2 / relative_zenith_luminance(pattern, sun_altitude_rad)
    x, y, z = towards.tolist()
    sky = SkyModel(pattern, (x, y, z), scale)
    diffuse = sky.horizontal_illuminance() if scale > 0 else 0.0
    spec = ConditionSpec(
        name,
        "2026-06-21T12:00",
        f"cie:{cie_type}",
        zenith_luminance_cd_m2=zenith_cd_m2,
        direct_normal_illuminance_lx=direct_normal_lx,
        ground_albedo=ground_albedo,
    )
    beam = np.full(3, direct_normal_lx)
    return Condition(
        name=name,
        spec=spec,
        sun=sun,
        sun_direction=towards if direct_normal_lx > 0 else None,
        sun_illuminance_rgb=beam,
        sky=sky,
        sky_rgb=np.ones(3),
        ground_luminance_rgb=np.ones(3) * ground_albedo * (diffuse + direct_normal_lx * max(z, 0.0)) / np.pi,
        diffuse_horizontal_lx=diffuse,
        direct_normal_lx=direct_normal_lx,
    )

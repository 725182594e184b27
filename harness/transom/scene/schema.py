"""scene.toml, format 1: its tables and fields, their ranges and defaults. Unknown keys are errors."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, model_validator

from transom.glass import MAX_TRANSMITTANCE
from transom.scene.fields import (
    Direction,
    Name,
    Point,
    Switch,
    Text,
    Time,
    Vector,
    check_number,
    check_text,
    check_vector,
    fail,
    listed,
    number,
    one_of,
    positive,
    rgb,
    whole,
)

INFINITY = math.inf
MAX_REFLECTANCE = 0.999
"""The engine's limit: light in a closed room of reflectance 1 would grow without end."""
METRES_PER_UNIT = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}


class Table(BaseModel):
    """One table of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class MeshTable(Table):
    """[mesh]: where the geometry is and how its coordinates are to be understood."""

    file: Text
    unit: Annotated[str, one_of(*METRES_PER_UNIT, meaning="a unit of length that meshes may have")]
    up: Annotated[Literal["y", "z"], one_of("z", "y", meaning="an axis that can point up")]
    north_deg: Annotated[float, number(-360.0, 360.0, "degrees clockwise from above")] = 0.0


class SiteTable(Table):
    """[site]: place and clock."""

    name: Text
    latitude_deg: Annotated[float, number(-90.0, 90.0, "degrees north")]
    longitude_deg: Annotated[float, number(-180.0, 180.0, "degrees, east positive")]
    time_zone_h: Annotated[float, number(-12.0, 14.0, "hours ahead of UTC, standard time")]
    elevation_m: Annotated[float, number(-500.0, 9000.0, "metres above sea level")] = 0.0


class MaterialTable(Table):
    """[materials.NAME]: a surface, diffuse on both sides."""

    reflectance: Annotated[Vector, rgb(0.0, MAX_REFLECTANCE, "diffuse reflectance, linear Rec. 709")] = (0.0, 0.0, 0.0)
    luminance_cd_m2: Annotated[Vector, rgb(0.0, INFINITY, "own luminance, cd/m²")] = (0.0, 0.0, 0.0)
    smooth: Switch = False

    @model_validator(mode="before")
    @classmethod
    def _says_something(cls, table: Any) -> Any:
        if isinstance(table, dict) and set(table) <= {"smooth"}:
            raise fail("is missing", "Add for example reflectance = 0.5", "reflectance")
        return table


def _check_transmittance(value: object) -> float:
    return check_number(value, 0.0, 1.0, "visible, normal incidence")


class OpeningTable(Table):
    """[[openings]]: all faces of one mesh material, through which daylight passes."""

    name: Name
    material: Text
    glazing: Annotated[
        Literal["clear", "none", "product"], one_of("clear", "none", "product", meaning="a kind of glazing")
    ] = "clear"
    visible_transmittance: Annotated[float | None, PlainValidator(_check_transmittance)] = None
    product: Annotated[str, PlainValidator(check_text)] = ""
    parameters: dict[str, Annotated[float, number(-INFINITY, INFINITY, "parameter of a product")]] = Field(
        default_factory=dict
    )

    @model_validator(mode="after")
    def _product_is_said_where_it_belongs(self) -> OpeningTable:
        if self.glazing == "product":
            if not self.product:
                remedy = 'Add for example product = "prismatic_panel" (transom list products), or a BSDF file'
                raise fail("is missing", remedy, "product")
            if self.visible_transmittance is not None:
                remedy = "Remove it: a product's transmission is its own"
                raise fail(
                    "has no meaning beside a product", remedy, "visible_transmittance", self.visible_transmittance
                )
        elif self.product or self.parameters:
            field, value = ("product", self.product) if self.product else ("parameters", self.parameters)
            raise fail('has no meaning without glazing = "product"', 'Write glazing = "product"', field, value)
        return self

    @model_validator(mode="after")
    def _glass_is_possible(self) -> OpeningTable:
        found = self.visible_transmittance
        if self.glazing == "product":
            return self
        if self.glazing == "none":
            if found is not None and found != 1.0:
                raise fail(
                    'has no meaning beside glazing = "none", which passes everything',
                    'Remove it, or write glazing = "clear"',
                    "visible_transmittance",
                    found,
                )
        elif found is None:
            remedy = "Add for example visible_transmittance = 0.78 (0..0.918, normal incidence)"
            raise fail("is missing", remedy, "visible_transmittance")
        elif found > MAX_TRANSMITTANCE:
            raise fail(
                f"is more than the {MAX_TRANSMITTANCE:.4f} that a pane without absorption passes at normal incidence",
                'Use at most 0.918, or glazing = "none" for an unglazed hole',
                "visible_transmittance",
                found,
            )
        return self

    @property
    def transmittance(self) -> float:
        """visible_transmittance, which is 1 for an unglazed hole, and 0 for a product: nothing passes straight."""
        if self.visible_transmittance is not None:
            return self.visible_transmittance
        return 1.0 if self.glazing == "none" else 0.0


class PointSourceTable(Table):
    """[[point_sources]]: an isotropic source of light."""

    name: Name
    position_m: Point
    intensity_cd: Annotated[Vector, rgb(0.0, INFINITY, "luminous intensity, cd")]


class ViewTable(Table):
    """[[views]]: a perspective camera, in the final frame (metres, z up, north applied)."""

    name: Name
    position_m: Point
    target_m: Point
    up: Direction = (0.0, 0.0, 1.0)
    vertical_fov_deg: Annotated[float, number(1.0, 170.0, "degrees over the image height")]
    width: Annotated[int, whole(1, 16384, "pixels")] = 640
    height: Annotated[int, whole(1, 16384, "pixels")] = 480
    display_white_cd_m2: Annotated[float, positive("luminance shown as white, cd/m²")]

    @model_validator(mode="after")
    def _looks_somewhere(self) -> ViewTable:
        along = [b - a for a, b in zip(self.position_m, self.target_m, strict=True)]
        distance = math.hypot(*along)
        if distance < 1e-9:
            raise fail("equals position_m", "Move it to where the camera should look", "target_m", list(self.target_m))
        if abs(sum(a * b for a, b in zip(along, self.up, strict=True))) > (1.0 - 1e-9) * distance:
            remedy = "Give a direction across the line of sight, like up = [0, 1, 0]"
            raise fail("is the direction of the view itself", remedy, "up", list(self.up))
        return self


class ConditionTable(Table):
    """[[conditions]]: a time and a sky."""

    name: Name
    time: Time = "2026-03-21T12:00"
    sky: Text = "cie:12"
    zenith_luminance_cd_m2: Annotated[float | None, positive("cd/m²")] = None
    diffuse_horizontal_illuminance_lx: Annotated[float | None, number(0.0, 2e5, "lx")] = None
    direct_normal_illuminance_lx: Annotated[float | None, number(0.0, 2e5, "lx")] = None
    ground_albedo: Annotated[float, number(0.0, 1.0, "diffuse reflectance of the ground")] = 0.2
    sun_colour_temperature_k: Annotated[float | None, number(1000.0, 25000.0, "kelvin")] = None
    sky_colour_temperature_k: Annotated[float | None, number(1000.0, 25000.0, "kelvin")] = None

    @model_validator(mode="after")
    def _level_is_said_once(self) -> ConditionTable:
        if self.zenith_luminance_cd_m2 is not None and self.diffuse_horizontal_illuminance_lx is not None:
            raise fail(
                "cannot stand beside zenith_luminance_cd_m2",
                "Keep one of them: each alone sets the level of the sky",
                "diffuse_horizontal_illuminance_lx",
                self.diffuse_horizontal_illuminance_lx,
            )
        if self.sky != "none" and "time" not in self.model_fields_set:
            raise fail("is missing", 'Add civil standard time, like time = "2026-03-21T10:00"', "time")
        return self


class RegionTable(Table):
    """[[regions]]: a named part of the picture, by object names (shell patterns) and/or a box."""

    name: Name
    objects: Annotated[tuple[str, ...], listed(check_text, "object names or patterns")] = ()
    box_m: Annotated[tuple[Vector, Vector] | None, listed(check_vector, "two corners")] = None

    @model_validator(mode="after")
    def _covers_something(self) -> RegionTable:
        if not self.objects and self.box_m is None:
            raise fail("covers nothing", 'Add objects = ["desk_*"] or box_m = [[x0, y0, z0], [x1, y1, z1]]')
        if self.box_m is not None:
            if len(self.box_m) != 2:
                raise fail(f"has a box_m of {len(self.box_m)} corners", "Write [[x0, y0, z0], [x1, y1, z1]]")
            if any(a > b for a, b in zip(*self.box_m, strict=True)):
                raise fail("has a box_m whose first corner is not the lower one", "Put the smaller x, y, z first")
        return self


def _check_count(value: object) -> tuple[int, int]:
    whole_numbers = isinstance(value, list) and all(isinstance(n, int) and not isinstance(n, bool) for n in value)
    if not isinstance(value, list) or not whole_numbers or len(value) != 2:
        raise fail("is not [columns, rows]")
    if not all(1 <= n <= 10000 for n in value):
        raise fail("is outside 1..10000 (columns, rows)")
    return (value[0], value[1])


class SensorTable(Table):
    """[[sensors]]: illuminance sensors, listed or as the cell centres of a grid."""

    name: Name
    points_m: Annotated[tuple[Vector, ...] | None, listed(check_vector, "points [x, y, z]")] = None
    corner_m: Point | None = None
    edge_u_m: Point | None = None
    edge_v_m: Point | None = None
    count: Annotated[tuple[int, int] | None, PlainValidator(_check_count)] = None
    normal: Direction
    target: Switch = False

    @model_validator(mode="after")
    def _points_are_said_once(self) -> SensorTable:
        grid = (self.corner_m, self.edge_u_m, self.edge_v_m, self.count)
        has_grid = any(part is not None for part in grid)
        if self.points_m is not None and has_grid:
            raise fail("has both points_m and a grid", "Keep points_m, or corner_m, edge_u_m, edge_v_m and count")
        if self.points_m is None and any(part is None for part in grid):
            raise fail("has no points", "Add points_m, or all of corner_m, edge_u_m, edge_v_m and count")
        return self


class SceneTable(Table):
    """The whole file."""

    format: Annotated[int, whole(1, 1, "the format of scene.toml that this version reads")]
    title: Text
    description: Text = ""
    tags: Annotated[tuple[str, ...], PlainValidator(lambda value: _check_tags(value))] = ()
    mesh: MeshTable
    site: SiteTable | None = None
    materials: dict[str, MaterialTable] = Field(default_factory=dict)
    openings: list[OpeningTable] = Field(default_factory=list)
    point_sources: list[PointSourceTable] = Field(default_factory=list)
    views: list[ViewTable] = Field(min_length=1)
    conditions: list[ConditionTable] = Field(min_length=1)
    regions: list[RegionTable] = Field(default_factory=list)
    sensors: list[SensorTable] = Field(default_factory=list)


def _check_tags(value: object) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise fail("is not a list of words")
    return tuple(check_text(part) for part in value)

"""Loads a scene folder: scene.toml and its mesh, checked, in metres, z up, radians."""

from __future__ import annotations

import math
import os
import tomllib
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from transom.errors import InputError
from transom.fenestration import choice as product_choice
from transom.scene import checks
from transom.scene.geometry import build_mesh
from transom.scene.mesh import read_mesh
from transom.scene.model import (
    ConditionSpec,
    Float64,
    Material,
    Opening,
    PointSource,
    Region,
    Scene,
    SensorSet,
    Site,
    View,
)
from transom.scene.schema import OpeningTable, SceneTable, SensorTable, SiteTable
from transom.scene.wording import input_error, near, shown_path

FILE_NAME = "scene.toml"
ROOT_VARIABLE = "TRANSOM_SCENES"


def scene_root() -> Path:
    """The folder of named scenes: $TRANSOM_SCENES, or scenes/ of the project this code or the work folder is in.

    Raises InputError when there is none.
    """
    chosen = os.environ.get(ROOT_VARIABLE)
    if chosen:
        if not Path(chosen).is_dir():
            raise InputError("is not a folder", field=ROOT_VARIABLE, value=chosen, remedy="Name the folder of scenes")
        return Path(chosen)
    for start in (Path(__file__).resolve(), Path.cwd().resolve() / "here"):
        for folder in start.parents:
            if any((folder / "scenes").glob(f"*/{FILE_NAME}")):
                return folder / "scenes"
    raise InputError(
        "No folder of scenes found", remedy=f"Work inside the project, set {ROOT_VARIABLE}, or give a scene's path"
    )


def list_scenes() -> list[str]:
    """Names of the scenes in `scene_root()`, sorted."""
    return sorted(file.parent.name for file in scene_root().glob(f"*/{FILE_NAME}"))


def load_scene(name_or_path: str | Path) -> Scene:
    """The scene of that name in `scene_root()`, or in the folder (or scene.toml file) of that path.

    Raises InputError, one line with file, field, value, what is allowed and the remedy, for anything wrong.
    """
    file = _scene_file(name_or_path)
    table = _read_table(file)
    shown = shown_path(file)
    checks.check_names(table, shown)
    checks.check_skies(table, shown)

    mesh_path = file.parent / table.mesh.file
    if not mesh_path.is_file():
        siblings = [path.name for path in file.parent.iterdir() if path.suffix.lower() in (".obj", ".glb", ".gltf")]
        remedy = near(table.mesh.file, siblings) or "Put the mesh there, or correct the name"
        problem = f"does not exist in {shown_path(file.parent)}"
        raise InputError(problem, file=shown, field="mesh.file", value=table.mesh.file, remedy=remedy)
    raw = read_mesh(mesh_path)
    checks.check_materials(table, raw, shown)

    materials = _materials(table)
    index_of = {material.name: index for index, material in enumerate(materials)}
    smooth = frozenset(material.name for material in materials if material.smooth)
    mesh = build_mesh(raw, table.mesh.unit, table.mesh.up, table.mesh.north_deg, index_of, smooth)
    mesh_shown = shown_path(mesh_path)
    checks.check_finite(mesh, mesh_shown)

    scene = Scene(
        name=file.parent.resolve().name,
        file=file,
        title=table.title,
        description=table.description,
        mesh=mesh,
        materials=materials,
        openings=tuple(_opening(entry, index, file.parent, shown) for index, entry in enumerate(table.openings)),
        point_sources=tuple(PointSource(p.name, p.position_m, p.intensity_cd) for p in table.point_sources),
        site=_site(table.site, table, shown),
        views=_views(table),
        conditions=tuple(ConditionSpec(**entry.model_dump()) for entry in table.conditions),
        regions=tuple(Region(entry.name, entry.objects, entry.box_m) for entry in table.regions),
        sensors=tuple(_sensor_set(entry, index, shown) for index, entry in enumerate(table.sensors)),
        tags=table.tags,
    )
    checks.check_light(scene, shown)
    checks.check_point_sources(scene, shown)
    checks.check_regions(scene.regions, mesh, shown)
    checks.check_doubled_faces(scene, mesh_shown)
    checks.check_enclosure(scene, mesh_shown)
    return scene


def _scene_file(name_or_path: str | Path) -> Path:
    """The scene.toml that is meant: a plain name is a scene of the project, if there is one; else a path."""
    text, path = str(name_or_path), Path(name_or_path)
    is_name = isinstance(name_or_path, str) and path.name == text and text not in (".", "..", FILE_NAME)
    if is_name and text:
        try:
            named = scene_root() / text / FILE_NAME
        except InputError:
            named = path / FILE_NAME
        if named.is_file():
            return named
    if path.name == FILE_NAME and path.is_file():
        return path
    if path.is_dir():
        if (path / FILE_NAME).is_file():
            return path / FILE_NAME
        raise InputError(
            f"has no {FILE_NAME}", file=shown_path(path), field="folder", remedy="scenes/README.md describes the format"
        )
    known = list_scenes() if is_name else []
    remedy = near(text, known) or (f"Known scenes: {', '.join(known)}" if known else "Give a scene's name or folder")
    raise InputError("is neither a known scene nor a scene folder", field="scene", value=text, remedy=remedy)


def _read_table(file: Path) -> SceneTable:
    shown = shown_path(file)
    try:
        content = tomllib.loads(file.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise InputError(
            "is not UTF-8 text", file=shown, field=f"byte {error.start}", remedy="Save it as UTF-8"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"is not valid TOML: {error}", file=shown, field="the file", remedy="Repair that line"
        ) from None
    try:
        return SceneTable.model_validate(content)
    except ValidationError as error:
        raise input_error(error, SceneTable, file) from None


def _materials(table: SceneTable) -> tuple[Material, ...]:
    """Opaque materials in the order of the file, then those of the openings."""
    opaque = [
        Material(name, entry.reflectance, entry.luminance_cd_m2, entry.smooth)
        for name, entry in table.materials.items()
    ]
    return (*opaque, *(Material(entry.material, opening=index) for index, entry in enumerate(table.openings)))


def _opening(entry: OpeningTable, index: int, folder: Path, shown: str) -> Opening:
    product = None
    if entry.glazing == "product":
        try:
            product = product_choice.choose_product(entry.product, entry.parameters, folder)
        except InputError as error:
            raise InputError(
                f"cannot be used: {error}", file=shown, field=f"openings[{index}].product", value=entry.product
            ) from None
    return Opening(entry.name, entry.material, entry.glazing, entry.transmittance, product)


def _site(site: SiteTable | None, table: SceneTable, shown: str) -> Site:
    if site is None:
        daylight = [entry.name for entry in table.conditions if entry.sky != "none"]
        if daylight and table.openings:
            raise InputError(
                f"is missing, but condition {daylight[0]!r} has a sky",
                file=shown,
                field="site",
                remedy="Add [site] with name, latitude_deg, longitude_deg and time_zone_h",
            )
        return Site("nowhere", 0.0, 0.0, 0.0)
    latitude, longitude = math.radians(site.latitude_deg), math.radians(site.longitude_deg)
    return Site(site.name, latitude, longitude, site.time_zone_h, site.elevation_m)


def _views(table: SceneTable) -> tuple[View, ...]:
    return tuple(
        View(
            name=entry.name,
            position=entry.position_m,
            target=entry.target_m,
            up=entry.up,
            vertical_fov_rad=math.radians(entry.vertical_fov_deg),
            width=entry.width,
            height=entry.height,
            display_white_cd_m2=entry.display_white_cd_m2,
        )
        for entry in table.views
    )


def _sensor_set(entry: SensorTable, index: int, shown: str) -> SensorSet:
    """The listed points, or the centres of the cells of a grid: along u first, then v."""
    if entry.points_m is not None:
        points = np.array(entry.points_m, dtype=np.float64)
    else:
        assert entry.corner_m and entry.edge_u_m and entry.edge_v_m and entry.count
        corner, edge_u, edge_v = (np.array(part) for part in (entry.corner_m, entry.edge_u_m, entry.edge_v_m))
        if np.linalg.norm(np.cross(edge_u, edge_v)) < 1e-12:
            problem = "spans no area with edge_v_m"
            raise InputError(problem, file=shown, field=f"sensors[{index}].edge_u_m", value=list(entry.edge_u_m))
        u, v = ((np.arange(n) + 0.5) / n for n in entry.count)
        grid: Float64 = corner + u[None, :, None] * edge_u + v[:, None, None] * edge_v
        points = grid.reshape(-1, 3)
    normals = np.tile(np.array(entry.normal), (len(points), 1))
    return SensorSet(entry.name, points, normals, entry.target)

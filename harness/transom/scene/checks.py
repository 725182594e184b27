"""Checks of a scene as a whole: names, materials against the mesh, doubled faces, open walls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from transom.daylight.sky_choice import parse_sky
from transom.errors import InputError
from transom.scene.enclosure import COVER_M, TriangleRays, find_escape
from transom.scene.mesh import RawMesh
from transom.scene.model import Mesh, Region, Scene
from transom.scene.polygons import triangle_distances
from transom.scene.regions import region_objects
from transom.scene.schema import SceneTable
from transom.scene.wording import near, shown_path

RAY_COUNT = 512
"""Rays that look for open walls, shared among the opening groups, with at least 128 each."""

ESCAPE_TOLERANCE = 0.005
"""Share of rays that may leave: seams of a few millimetres are below it, a missing wall is far above."""


SOURCE_DISTANCE = 2e-5
"""Least distance of a point source from the surfaces, against the scene's size: twice the lift of the engine's rays."""


def check_names(table: SceneTable, file: str) -> None:
    """Names within one list differ. Raises InputError naming both places."""
    lists = {
        "openings": [entry.name for entry in table.openings],
        "point_sources": [entry.name for entry in table.point_sources],
        "views": [entry.name for entry in table.views],
        "conditions": [entry.name for entry in table.conditions],
        "regions": [entry.name for entry in table.regions],
        "sensors": [entry.name for entry in table.sensors],
    }
    for field, names in lists.items():
        for index, name in enumerate(names):
            first = names.index(name)
            if first != index:
                raise InputError(
                    f"is the name of {field}[{first}] too",
                    file=file,
                    field=f"{field}[{index}].name",
                    value=name,
                    remedy="Give each its own name",
                )


def check_skies(table: SceneTable, file: str) -> None:
    """Each condition's sky is one that `transom.daylight` knows. Raises InputError."""
    for index, condition in enumerate(table.conditions):
        try:
            parse_sky(condition.sky, f"conditions[{index}].sky")
        except InputError as error:
            raise InputError(str(error), file=file) from None


def check_materials(table: SceneTable, raw: RawMesh, file: str) -> None:
    """Each material of the mesh is described once, and each described one is used. Raises InputError."""
    mesh_file = shown_path(raw.file)
    used: dict[str, str] = {}
    for polygon in raw.polygons:
        used.setdefault(polygon.material, polygon.place)
    if "" in used:
        raise InputError(
            "has no material",
            file=f"{mesh_file}, {used['']}",
            field="face",
            remedy="Give every face a material (OBJ: a usemtl line before it)",
        )
    by_opening: dict[str, int] = {}
    for index, opening in enumerate(table.openings):
        field = f"openings[{index}].material"
        if opening.material in by_opening:
            problem = f"is the material of openings[{by_opening[opening.material]}] too"
            raise InputError(
                problem, file=file, field=field, value=opening.material, remedy="Use one material for each"
            )
        if opening.material in table.materials:
            problem = f"is described in [materials.{opening.material}] too"
            raise InputError(problem, file=file, field=field, value=opening.material, remedy="Remove that table")
        if opening.material not in used:
            problem = f"has no face in {mesh_file}"
            remedy = near(opening.material, list(used)) or f"Its materials: {', '.join(used)}"
            raise InputError(problem, file=file, field=field, value=opening.material, remedy=remedy)
        by_opening[opening.material] = index
    for name in table.materials:
        if name not in used:
            remedy = near(name, [known for known in used if known not in table.materials])
            raise InputError(
                f"is used by no face of {mesh_file}",
                file=file,
                field=f"materials.{name}",
                remedy=remedy or "Remove the table, or give faces that material",
            )
    for name, place in used.items():
        if name not in table.materials and name not in by_opening:
            raise InputError(
                f"is not described in {file}",
                file=f"{mesh_file}, {place}",
                field="material",
                value=name,
                remedy=near(name, list(table.materials)) or f"Add [materials.{name}] or an opening with that material",
            )


def check_regions(regions: Sequence[Region], mesh: Mesh, file: str) -> None:
    """Each region's patterns match an object of the mesh. Raises InputError."""
    for index, region in enumerate(regions):
        for pattern in region.objects:
            if not region_objects(Region(region.name, (pattern,)), mesh.objects):
                more = f" and {len(mesh.objects) - 12} more" if len(mesh.objects) > 12 else ""
                names = ", ".join(mesh.objects[:12]) + more
                raise InputError(
                    "matches no object of the mesh",
                    file=file,
                    field=f"regions[{index}].objects",
                    value=pattern,
                    remedy=near(pattern, list(mesh.objects)) or f"Its objects: {names}",
                )


def check_doubled_faces(scene: Scene, mesh_file: str) -> None:
    """No two faces lie exactly on each other: which of them light meets would be chance. Raises InputError."""
    mesh = scene.mesh
    seen: dict[tuple[int, ...], int] = {}
    for face, corners in enumerate(mesh.faces):
        key = tuple(sorted(int(corner) for corner in corners if corner >= 0))
        if key in seen:
            first = seen[key]
            names = [mesh.objects[int(mesh.face_object[f])] for f in (first, face)]
            materials = [scene.materials[int(mesh.face_material[f])].name for f in (first, face)]
            where = ", ".join(f"{value:.4g}" for value in mesh.vertices[list(key)].mean(axis=0))
            raise InputError(
                f"of object {names[1]!r} (material {materials[1]!r}) lies exactly on one of object {names[0]!r} "
                f"(material {materials[0]!r}), near ({where}) m",
                file=mesh_file,
                field="face",
                remedy="Delete one of the two; a single face is diffuse on both sides",
            )
        seen[key] = face


def check_light(scene: Scene, file: str) -> None:
    """Something can light the scene: an opening, an emitter or a point source. Raises InputError."""
    emits = any(max(material.luminance) > 0.0 for material in scene.materials)
    if not scene.openings and not scene.point_sources and not emits:
        raise InputError(
            "has neither openings nor emitters, so nothing lights it",
            file=file,
            field="scene",
            remedy="Add [[openings]], [[point_sources]] or a luminance_cd_m2",
        )


def check_point_sources(scene: Scene, file: str) -> None:
    """Each point source stands off the surfaces, so that it is clear which side it lights. Raises InputError."""
    mesh = scene.mesh
    triangles, source_face = mesh.triangles()
    corners = mesh.vertices[triangles]
    least = SOURCE_DISTANCE * float(np.ptp(mesh.vertices, axis=0).max())
    for index, source in enumerate(scene.point_sources):
        distance = triangle_distances(np.array(source.position), corners)
        nearest = int(np.argmin(distance))
        if distance[nearest] >= least:
            continue
        face = int(source_face[nearest])
        owner = mesh.objects[int(mesh.face_object[face])]
        raise InputError(
            f"of {source.name!r} lies on a face of object {owner!r}",
            file=file,
            field=f"point_sources[{index}].position_m",
            value=list(source.position),
            remedy=f"Move it off by {2 * least:.2g} m or more, to the side that it is to light",
        )


def check_enclosure(scene: Scene, mesh_file: str) -> None:
    """The room behind every opening is closed but for openings, which nothing covers and whose fronts look outdoors.

    Raises InputError.
    """
    opening_materials = {
        material.opening: index for index, material in enumerate(scene.materials) if material.opening >= 0
    }
    rays, count = TriangleRays(scene.mesh), max(128, RAY_COUNT // max(1, len(scene.openings)))
    for index, opening in enumerate(scene.openings):
        escape = find_escape(rays, opening_materials[index], frozenset(opening_materials.values()), count)
        field = f"opening {opening.name!r} (material {opening.material!r})"
        if escape.covered_share > 0.5:
            raise InputError(
                f"is covered by another surface at most {100 * COVER_M:g} cm away",
                file=mesh_file,
                field=field,
                remedy="Cut the hole into the wall that the opening fills",
            )
        if escape.share * count <= max(2.0, ESCAPE_TOLERANCE * count):
            continue
        if escape.share > 0.3 and escape.outdoor_share < 0.5 * escape.share:
            raise InputError(
                "has its front towards the room: faces of openings are counter-clockwise seen from outdoors",
                file=mesh_file,
                field=field,
                remedy="Reverse these faces",
            )
        origin = ", ".join(f"{value:.3g}" for value in escape.origin)
        end = ", ".join(f"{value:.2f}" for value in escape.direction)
        raise InputError(
            f"lights a room with an open wall: {100 * escape.share:.1f} % of its light leaves through no opening, "
            f"some from ({origin}) m in direction ({end})",
            file=mesh_file,
            field=field,
            remedy='Close the wall, or make the hole an opening with glazing = "none"',
        )


def check_finite(mesh: Mesh, mesh_file: str) -> None:
    """All coordinates are finite after conversion to metres, and within 100 km. Raises InputError."""
    largest = float(np.abs(mesh.vertices).max())
    if not np.isfinite(largest) or largest > 1e5:
        raise InputError(
            "is further than 100 km from the origin",
            file=mesh_file,
            field="vertex",
            value=largest,
            remedy="Check the unit in [mesh], or move the model near the origin",
        )

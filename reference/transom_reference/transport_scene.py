"""The scene as the portal integrator reads it: ray-tracing scenes, and tables of triangles, materials and openings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.daylight.condition import Condition
from transom.daylight.sun_disc import SUN_RADIUS_RAD
from transom.errors import InputError
from transom.fenestration.light import room_reflectance
from transom.glass import pane, transmittance_table
from transom.scene.model import Mesh, Scene
from transom_reference.mitsuba_setup import dr, floats, mi
from transom_reference.panels import Panels, build_panels

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

SKY_ROWS = 512
"""Rows of the sky table from zenith to horizon; four times as many columns. Interpolation error below 1e-4."""

TABLE_INTERVALS = 1024
"""Intervals of the glass table: entry i is the transmittance at cos(theta) = i / 1024."""

WEIGHT_POINTS = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]])
TRIANGLE_WEIGHT_POINTS = np.array([[1 / 3, 1 / 3], [0.15, 0.15], [0.7, 0.15], [0.15, 0.7]])


@dataclass(frozen=True)
class Portal:
    """A parallelogram or a triangle of an opening: corner + u·edge_u + v·edge_v (a triangle: u + v <= 1).

    normal: unit, towards outdoors. opening: index into Scene.openings. source_triangles: rows of Mesh.triangles.
    """

    corner: Float64
    edge_u: Float64
    edge_v: Float64
    normal: Float64
    is_triangle: bool
    opening: int
    source_triangles: tuple[int, ...]

    @property
    def area(self) -> float:
        """[m²]"""
        area = float(np.linalg.norm(np.cross(self.edge_u, self.edge_v)))
        return 0.5 * area if self.is_triangle else area

    @property
    def weight_points(self) -> Float64:
        """Four points (4, 3) that stand for the portal when its share of light is estimated."""
        uv = TRIANGLE_WEIGHT_POINTS if self.is_triangle else WEIGHT_POINTS
        points: Float64 = self.corner + uv[:, :1] * self.edge_u + uv[:, 1:] * self.edge_v
        return points


@dataclass(frozen=True)
class TransportScene:
    """Everything that the integrator gathers from. `opaque` and `glass` are None when the scene has no such faces.

    all, opaque, glass: mi.Scene. triangles: flat (T, 12): v0, material; e1, smooth (0 or 1); e2, 0.
    normals: flat (T, 9), corner normals, or None. materials: flat (M, 8): reflectance rgb, opening
    (or -1); luminance rgb, room reflectance.
    glass_table: flat (openings, 1025). room_reflectance: (openings,), diffuse. mirror_table: like glass_table, the
    directional reflectance of the room side, or None where that reflects diffusely (matched physics). sun_radius_rad:
    of the sun's disc, 0 for a point (matched physics). portal_of_glass_triangle: UInt32; the glass
    triangles are the last rows of `triangles`, after `opaque_count` others.
    portal_table: flat (P, 16): corner, area; edge_u, is_triangle; edge_v, weight; normal, opening.
    panels: products in openings, or None. sun_starts_flux, sun_starts_probability: ((1 + beams) P,): by portal what the
    sun sends straight through it, then what it sends in by each beam of the panels; flux for a sun of 1 lx [lm].
    """

    all: Any
    opaque: Any
    glass: Any
    triangles: Any
    normals: Any
    materials: Any
    glass_table: Any
    room_reflectance: Any
    opaque_count: int
    portal_of_glass_triangle: Any
    portal_table: Any
    portals: tuple[Portal, ...]
    portal_weights: Float64
    sky_table: Any
    ground: Any
    sky_rgb: Any
    sun_direction: Float64 | None
    sun_illuminance: Float64
    sun_starts_flux: Float64
    sun_starts_probability: Float64
    point_sources: Any
    point_source_count: int
    has_emitters: bool
    mirror_table: Any = None
    sun_radius_rad: float = 0.0
    panels: Panels | None = None


def find_portals(scene: Scene) -> tuple[Portal, ...]:
    """Parallelograms (quads that are) and triangles of all openings, in the order of the mesh's faces."""
    mesh = scene.mesh
    opening_of_face = np.array([material.opening for material in scene.materials], dtype=np.int64)[mesh.face_material]
    triangles, source = mesh.triangles()
    portals: list[Portal] = []
    for face in np.flatnonzero(opening_of_face >= 0):
        opening = int(opening_of_face[face])
        rows = tuple(int(row) for row in np.flatnonzero(source == face))
        corners = mesh.vertices[mesh.faces[face][mesh.faces[face] >= 0]]
        if len(corners) == 4:
            gap = np.linalg.norm(corners[0] - corners[1] + corners[2] - corners[3])
            if gap < 1e-9 * np.linalg.norm(corners[2] - corners[0]):
                portals.append(_portal(corners[0], corners[1], corners[3], False, opening, rows))
                continue
        for row in rows:
            a, b, c = mesh.vertices[triangles[row]]
            portals.append(_portal(a, b, c, True, opening, (row,)))
    return tuple(portals)


def _portal(
    corner: Float64, u_end: Float64, v_end: Float64, is_triangle: bool, opening: int, rows: tuple[int, ...]
) -> Portal:
    edge_u, edge_v = u_end - corner, v_end - corner
    normal = np.cross(edge_u, edge_v)
    return Portal(corner, edge_u, edge_v, normal / np.linalg.norm(normal), is_triangle, opening, rows)


def _ray_scene(vertices: Float64, triangles: Int32) -> Any:
    """A Mitsuba scene of one mesh, or None when there are no triangles."""
    if len(triangles) == 0:
        return None
    mesh = mi.Mesh("triangles", vertex_count=len(vertices), face_count=len(triangles))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(vertices.astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(triangles.astype(np.uint32).ravel())
    parameters.update()
    return mi.load_dict({"type": "scene", "mesh": mesh})


def sky_table(condition: Condition) -> NDArray[np.float32]:
    """Sky luminance (SKY_ROWS + 1, 4 SKY_ROWS) [cd/m²]: row j at theta = (pi/2) j / SKY_ROWS from the zenith,
    column i at azimuth 2 pi i / columns from +x towards +y. The last row is the sky's limit at the horizon."""
    theta = np.linspace(0.0, 0.5 * np.pi, SKY_ROWS + 1)
    theta[-1] -= 1e-9
    azimuth = 2 * np.pi * np.arange(4 * SKY_ROWS) / (4 * SKY_ROWS)
    sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
    directions = np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth), np.broadcast_to(cosine, (len(theta), len(azimuth)))], axis=-1
    )
    values = condition.sky.luminance(directions.reshape(-1, 3)).reshape(len(theta), len(azimuth))
    return np.asarray(values, dtype=np.float32)


def _portal_weights(
    scene: Scene, condition: Condition, portals: tuple[Portal, ...], table: Any, panels: Panels | None
) -> Float64:
    """Mean luminance that each portal sends indoors under the condition (cosine-weighted over directions) [cd/m²]."""
    generator = np.random.default_rng(1)
    u, v = generator.random(4096), generator.random(4096)
    local = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v), np.sqrt(1 - u)], axis=-1)
    ground = float(luminance(np.asarray(condition.ground_luminance_rgb, dtype=np.float64)))
    glass = {index: transmittance_table(opening) for index, opening in enumerate(scene.openings)}
    weights = []
    for index, portal in enumerate(portals):
        tangent = portal.edge_u / np.linalg.norm(portal.edge_u)
        frame = np.stack([tangent, np.cross(portal.normal, tangent), portal.normal])
        z = np.clip((local @ frame)[:, 2], -1.0, 1.0)
        directions = local @ frame
        column = (np.arctan2(directions[:, 1], directions[:, 0]) / (2 * np.pi) * table.shape[1]).astype(int)
        row = np.clip(np.arccos(np.abs(z)) / (0.5 * np.pi) * SKY_ROWS, 0, SKY_ROWS).astype(int)
        radiance = np.where(z > 0, table[row, column % table.shape[1]], ground)
        if panels is not None and panels.group_of_portal[index] >= 0:
            weights.append(panels.mean_luminance(index, directions, radiance))
            continue
        passed = np.interp(local[:, 2] * TABLE_INTERVALS, np.arange(TABLE_INTERVALS + 1), glass[portal.opening])
        weights.append(float((radiance * passed).mean()))
    return np.array(weights)


def build_transport_scene(scene: Scene, condition: Condition, *, full_physics: bool = False) -> TransportScene:
    """Tables and ray-tracing scenes of a scene under a condition; float32, coordinates of the scene.

    full_physics: the sun is a disc, and the room side of glass a mirror; else a point, and diffuse.
    Raises InputError for full physics with a glazing product, whose room side is diffuse and whose sun is parallel.
    """
    products = [entry.name for entry in scene.openings if entry.product is not None]
    if full_physics and products:
        problem = f"cannot be used with the product in opening {products[0]}"
        raise InputError(problem, field="physics", value="full", remedy='Use "matched"')
    mesh = scene.mesh
    rows, source = mesh.triangles()
    material = mesh.face_material[source]
    opening = np.array([entry.opening for entry in scene.materials], dtype=np.int64)[material]
    is_glass = opening >= 0
    # Rows are put in the order opaque, glass, so that one table serves all three scenes.
    order = np.concatenate([np.flatnonzero(~is_glass), np.flatnonzero(is_glass)])
    portals = find_portals(scene)
    portal_of_row = np.zeros(len(rows), dtype=np.uint32)
    for index, portal in enumerate(portals):
        portal_of_row[list(portal.source_triangles)] = index

    corner = mesh.vertices[rows]
    smooth = np.array([entry.smooth for entry in scene.materials], dtype=bool)[material] & (
        mesh.corner_normals is not None
    )
    triangle_table = np.zeros((len(rows), 12))
    triangle_table[:, 0:3], triangle_table[:, 3] = corner[:, 0], material
    triangle_table[:, 4:7], triangle_table[:, 7] = corner[:, 1] - corner[:, 0], smooth
    triangle_table[:, 8:11] = corner[:, 2] - corner[:, 0]
    room = [room_reflectance(entry) for entry in scene.openings]
    material_table = np.array(
        [
            [*entry.reflectance, entry.opening, *entry.luminance, room[entry.opening] if entry.opening >= 0 else 0.0]
            for entry in scene.materials
        ]
    )
    table = sky_table(condition)
    panels = build_panels(scene, condition, [int(source[portal.source_triangles[0]]) for portal in portals])
    weights = _portal_weights(scene, condition, portals, table, panels)
    portal_table = np.array(
        [
            [*p.corner, p.area, *p.edge_u, p.is_triangle, *p.edge_v, w, *p.normal, p.opening]
            for p, w in zip(portals, weights, strict=True)
        ]
    ).reshape(-1, 16)
    glass = np.array([transmittance_table(entry) for entry in scene.openings]).reshape(-1, TABLE_INTERVALS + 1)
    sun = condition.sun_direction
    illuminance = np.asarray(condition.sun_illuminance_rgb, dtype=np.float64)
    has_sun = sun is not None and bool((illuminance > 0).any())
    sun_flux = _sun_flux(sun, portals, glass, panels, illuminance) if has_sun else np.zeros(len(portals))
    sources = np.array([[*s.position, *s.intensity] for s in scene.point_sources]).reshape(-1, 6)
    result = TransportScene(
        all=_ray_scene(mesh.vertices, rows[order]),
        opaque=_ray_scene(mesh.vertices, rows[~is_glass]),
        glass=_ray_scene(mesh.vertices, rows[is_glass]),
        triangles=floats(triangle_table[order]),
        normals=floats(_triangle_normals(mesh)[order].reshape(-1, 9)) if smooth.any() else None,
        materials=floats(material_table),
        glass_table=floats(glass),
        room_reflectance=floats(np.array(room)) if room else mi.Float(0.0),
        opaque_count=int((~is_glass).sum()),
        portal_of_glass_triangle=mi.UInt32(portal_of_row[is_glass]),
        portal_table=floats(portal_table),
        portals=portals,
        portal_weights=weights,
        sky_table=floats(table),
        ground=mi.Color3f(*(float(v) for v in condition.ground_luminance_rgb)),
        sky_rgb=mi.Color3f(*(float(v) for v in condition.sky_rgb)),
        sun_direction=np.asarray(sun, dtype=np.float64) if has_sun else None,
        sun_illuminance=illuminance,
        sun_starts_flux=sun_flux,
        sun_starts_probability=sun_flux / sun_flux.sum() if sun_flux.any() else sun_flux,
        point_sources=floats(sources),
        point_source_count=len(sources),
        has_emitters=any(max(entry.luminance) > 0 for entry in scene.materials),
        mirror_table=floats(_mirror_tables(scene)) if full_physics and scene.openings else None,
        sun_radius_rad=SUN_RADIUS_RAD if full_physics else 0.0,
        panels=panels,
    )
    dr.make_opaque(result.ground, result.sky_rgb)
    return result


def _mirror_tables(scene: Scene) -> NDArray[np.float64]:
    """Directional reflectance of each opening at cos(theta) = i / 1024, (openings, 1025); 0 of an unglazed one."""
    cosine = np.linspace(0.0, 1.0, TABLE_INTERVALS + 1)
    tables = [
        np.zeros_like(cosine) if entry.glazing == "none" else pane(entry.visible_transmittance, cosine)[1]
        for entry in scene.openings
    ]
    return np.array(tables)


def _triangle_normals(mesh: Mesh) -> Float64:
    """Corner normals (T, 3, 3) in the order of Mesh.triangles."""
    assert mesh.corner_normals is not None
    _, source = mesh.triangles()
    is_second = np.concatenate([[False], source[1:] == source[:-1]])
    choice = np.where(is_second[:, None], [0, 2, 3], [0, 1, 2])
    normals: Float64 = mesh.corner_normals[source[:, None], choice]
    return normals


def _sun_flux(
    sun: Any, portals: tuple[Portal, ...], glass: NDArray[Any], panels: Panels | None, illuminance: Float64
) -> Float64:
    """Flux through each portal for a sun of 1 lx that nothing outdoors hides [lm]; 0 where it does not face the sun.

    Panels' beams follow, each over all portals.
    """
    flux = np.zeros(len(portals))
    for index, portal in enumerate(portals):
        cosine = max(0.0, float(np.dot(portal.normal, sun)))
        passed = float(np.interp(cosine * TABLE_INTERVALS, np.arange(TABLE_INTERVALS + 1), glass[portal.opening]))
        flux[index] = cosine * portal.area * passed
    if panels is None:
        return flux
    rows = [flux]
    for beam in panels.beams:
        along = np.array([-np.dot(portal.normal, beam.direction) * portal.area for portal in portals])
        sent = along * beam.normal_rgb.max() / illuminance.max()
        rows.append(np.where(panels.group_of_portal == beam.group, sent, 0.0))
    return np.concatenate(rows)

"""The same scene for Mitsuba's own `volpath`, which cross-checks ours: glass BSDF, envmap, directional sun."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition
from transom.fenestration.load import load_fenestration
from transom.fenestration.panels import PanelGroup, panel_groups
from transom.glass import diffuse_reflectance, transmittance_table
from transom.scene.model import Scene, View
from transom_reference.glass_bsdf import glass_bsdf
from transom_reference.mitsuba_setup import mi
from transom_reference.panel_bsdf import SunLobes, panel_bsdf

ENVIRONMENT_HEIGHT = 1025
"""Rows of the sky image: odd, so that one row lies on the horizon."""

LEAST_LOBE_WIDTH_DEG = 6.0
"""Full angle of the cones that stand for parallel lobes."""


def stock_scene(scene: Scene, condition: Condition, environment_height: int = ENVIRONMENT_HEIGHT) -> Any:
    """A Mitsuba scene: one mesh a material, two-sided diffuse or glass; sky image; sun as a directional emitter.

    Emitting materials radiate from the front of their faces only: Mitsuba's area emitter has one side.
    """
    entries: dict[str, Any] = {"type": "scene"}
    rows, source = scene.mesh.triangles()
    material_of_row = scene.mesh.face_material[source]
    for number, group in enumerate(panel_groups(scene)):
        panes = rows[np.isin(source, group.faces)]
        bsdf = _panel_bsdf(scene, group, condition.sun_direction)
        entries[f"panel_{number}"] = _mesh(scene.mesh.vertices, panes, bsdf, (0.0, 0.0, 0.0))
    for index, material in enumerate(scene.materials):
        triangles = rows[material_of_row == index]
        if len(triangles) == 0 or (material.opening >= 0 and scene.openings[material.opening].product is not None):
            continue
        if material.opening >= 0:
            opening = scene.openings[material.opening]
            bsdf = glass_bsdf(transmittance_table(opening), diffuse_reflectance(opening))
        else:
            reflectance = {"type": "rgb", "value": list(material.reflectance)}
            bsdf = {"type": "twosided", "nested": {"type": "diffuse", "reflectance": reflectance}}
        entries[f"mesh_{index}"] = _mesh(scene.mesh.vertices, triangles, bsdf, material.luminance)
    image = environment_bitmap(condition.environment_image(environment_height))
    entries["sky"] = {
        "type": "envmap",
        "bitmap": mi.Bitmap(image),
        "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),
    }
    if condition.sun_direction is not None:
        entries["sun"] = {
            "type": "directional",
            "direction": [-float(v) for v in condition.sun_direction],
            "irradiance": {"type": "rgb", "value": [float(v) for v in condition.sun_illuminance_rgb]},
        }
    for index, point_source in enumerate(scene.point_sources):
        entries[f"point_{index}"] = {
            "type": "point",
            "position": list(point_source.position),
            "intensity": {"type": "rgb", "value": list(point_source.intensity)},
        }
    return mi.load_dict(entries)


def _panel_bsdf(scene: Scene, group: PanelGroup, sun: NDArray[np.float64] | None) -> dict[str, Any]:
    """A product with the lobes that it has for the sun, as cones: nothing parallel can be found by chance."""
    product = scene.openings[group.opening].product
    assert product is not None
    fenestration = load_fenestration(product)
    incident = group.to_panel(-sun) if sun is not None else None
    if incident is None or incident[2] <= 0:
        return panel_bsdf(fenestration, group)
    through = fenestration.sun(incident)
    if not through.lobes:
        return panel_bsdf(fenestration, group)
    lobes = [replace(lobe, width_rad=max(lobe.width_rad, np.radians(LEAST_LOBE_WIDTH_DEG))) for lobe in through.lobes]
    return panel_bsdf(fenestration, group, SunLobes(incident, lobes, through.residual))


def environment_bitmap(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Our sky image (azimuth from east towards north) in the column order of Mitsuba's envmap turned to z up.

    Turned by 90 degrees about x, the envmap's column coordinate is the azimuth from north (+y) towards east (+x).
    """
    width = image.shape[1]
    columns = (width // 4 - 1 - np.arange(width)) % width
    return np.ascontiguousarray(image[:, columns])


def stock_volpath(
    scene: Scene, condition: Condition, view: View, samples: int, seed: int = 1, max_depth: int = 256
) -> NDArray[np.float32]:
    """Image (height, width, 3) [cd/m²] by Mitsuba's `volpath`, box filter. Slow and noisy: for cross-checks only."""
    stock = stock_scene(scene, condition)
    horizontal_fov = 2 * np.arctan(np.tan(0.5 * view.vertical_fov_rad) * view.width / view.height)
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": float(np.degrees(horizontal_fov)),
            "fov_axis": "x",
            "near_clip": 1e-3,
            "to_world": mi.ScalarTransform4f().look_at(list(view.position), list(view.target), list(view.up)),
            "film": {
                "type": "hdrfilm",
                "width": view.width,
                "height": view.height,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
            "sampler": {"type": "independent"},
        }
    )
    integrator = mi.load_dict({"type": "volpath", "max_depth": max_depth, "rr_depth": 12})
    image = mi.render(stock, sensor=sensor, integrator=integrator, spp=samples, seed=seed)
    return np.array(image, dtype=np.float32)


def stock_illuminance(
    scene: Scene,
    condition: Condition,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    samples: int,
    seed: int = 1,
    max_depth: int = 256,
) -> NDArray[np.float64]:
    """Illuminance (N, 3) [lx] by Mitsuba's `volpath` and `irradiancemeter`: mean over a square millimetre each."""
    stock = stock_scene(scene, condition)
    integrator = mi.load_dict({"type": "volpath", "max_depth": max_depth, "rr_depth": 12})
    found = []
    for point, normal in zip(points, normals, strict=True):
        film = {
            "type": "hdrfilm",
            "width": 1,
            "height": 1,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        }
        meter = {"type": "irradiancemeter", "film": film, "sampler": {"type": "independent"}}
        up = [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [0.0, 1.0, 0.0]
        facing = mi.ScalarTransform4f().look_at(point.tolist(), (point + normal).tolist(), up)
        placed = facing @ mi.ScalarTransform4f().scale(5e-4)
        square = mi.load_dict({"type": "rectangle", "to_world": placed, "sensor": meter})
        image = mi.render(stock, sensor=square.sensor(), integrator=integrator, spp=samples, seed=seed)
        found.append(np.array(image, dtype=np.float64).reshape(3))
    return np.array(found)


def _mesh(vertices: NDArray[np.float64], triangles: NDArray[np.int32], bsdf: dict[str, Any], luminance: Any) -> Any:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    if max(luminance) > 0:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": list(luminance)}})
    used, renumbered = np.unique(triangles, return_inverse=True)
    mesh = mi.Mesh("part", vertex_count=len(used), face_count=len(triangles), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(vertices[used].astype(np.float32).ravel())
    parameters["faces"] = mi.UInt32(renumbered.astype(np.uint32).ravel())
    parameters.update()
    return mesh

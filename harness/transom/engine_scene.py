"""A scene and a condition as the engine's arrays, and what of a scene a solved engine can exchange."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from transom import _engine
from transom.daylight.condition import Condition
from transom.daylight.sky_bins import SkyBins
from transom.daylight.sun_disc import sub_sun_illuminance, sub_suns
from transom.fenestration.light import panel_light
from transom.fenestration.load import load_fenestration
from transom.fenestration.panels import panel_groups
from transom.fenestration.through import Fenestration
from transom.glass import diffuse_reflectance, transmittance_table
from transom.scene import content_key
from transom.scene.model import Scene


def engine_geometry(scene: Scene) -> _engine.SceneGeometry:
    """Faces, materials, openings and point sources; after the openings of the scene one more for each panel group."""
    mesh = scene.mesh
    normals = np.zeros((0, 3)) if mesh.corner_normals is None else mesh.corner_normals.reshape(-1, 3)
    groups = panel_groups(scene)
    face_material = np.array(mesh.face_material, dtype=np.int32)
    for index, group in enumerate(groups):
        face_material[group.faces] = len(scene.materials) + index
    geometry = _engine.SceneGeometry(
        np.ascontiguousarray(mesh.vertices, dtype=np.float64),
        np.ascontiguousarray(mesh.faces, dtype=np.int32),
        face_material,
        np.ascontiguousarray(normals, dtype=np.float32),
    )
    for material in scene.materials:
        geometry.add_material(material.reflectance, material.luminance, material.smooth, material.opening)
    for opening in scene.openings:
        geometry.add_opening(transmittance_table(opening), 0.0 if opening.product else diffuse_reflectance(opening))
    for index, group in enumerate(groups):  # one orientation each, after the openings of the scene
        geometry.add_material((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False, len(scene.openings) + index)
        fenestration = fenestration_of(scene, group.opening)
        basis = fenestration.basis
        geometry.add_panels(
            np.ascontiguousarray(group.axes, dtype=np.float32),
            np.radians(basis.edges_deg).astype(np.float32),
            np.asarray(basis.counts, dtype=np.int32),
            fenestration.room_reflectance(),
        )
    for source in scene.point_sources:
        geometry.add_point_source(source.position, source.intensity)
    return geometry


class EngineSky:
    """The sky's bins as an engine has them, and their luminance."""

    def __init__(self, bins: SkyBins) -> None:
        self.bins = bins
        arrays = (bins.directions, *bins.smooth, *bins.steep)
        middles, smooth_directions, smooth_weights, steep_directions, steep_weights = (
            np.ascontiguousarray(array, dtype=np.float32) for array in arrays
        )
        self._means = _engine.SkyBinMeans(
            middles,
            int(bins.row_counts[0]),
            bins.steep_cosine,
            smooth_weights,
            smooth_directions,
            steep_weights,
            steep_directions,
        )

    def luminance(self, condition: Condition) -> NDArray[np.float32]:
        """Mean over each bin (bins.count,) [cd/m²]: `Condition.bin_luminance` in single precision, within 1e-5."""
        formula = condition.sky.formula()
        if formula is None:
            return condition.bin_luminance(self.bins).astype(np.float32)
        return self._means.of(formula, condition.sky.sun_direction)


def engine_condition(scene: Scene, condition: Condition, sky: EngineSky, sub_sun_count: int) -> _engine.Condition:
    """Sky, ground and beams. Products receive a point sun whatever sub-suns stand for it elsewhere: their lobes are
    wider than its disc, or are made parallel on purpose."""
    core_condition = _engine.Condition(
        sky.luminance(condition),
        _triple(condition.sky_rgb),
        _triple(condition.ground_luminance_rgb),
    )
    if condition.sun_direction is None:
        return core_condition
    sun = _triple(condition.sun_direction)
    core_condition.add_beam(sun, _triple(condition.sun_illuminance_rgb))
    if sub_sun_count > 1:
        illuminance = _triple(sub_sun_illuminance(condition.sun_illuminance_rgb, sub_sun_count))
        for direction in sub_suns(condition.sun_direction, sub_sun_count):
            core_condition.add_sub_sun(_triple(direction), illuminance)
    for light in panel_light(scene, condition):
        opening = len(scene.openings) + light.group
        for beam in light.beams:
            core_condition.add_lobe(opening, _triple(-beam.direction), _triple(beam.normal_illuminance_rgb), sun)
        core_condition.add_residual(opening, np.ascontiguousarray(light.residual_rgb, dtype=np.float32), sun)
    return core_condition


def _triple(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in vector)
    return x, y, z


def fenestration_of(scene: Scene, opening: int) -> Fenestration:
    """The product that an opening holds, made ready."""
    product = scene.openings[opening].product
    assert product is not None
    return load_fenestration(product)


def what_else_changed(old: Scene, new: Scene) -> str | None:
    """What differs beside the parameters and names of products; None: nothing."""
    if [o.product is None for o in old.openings] != [o.product is None for o in new.openings]:
        return "openings that hold a product"
    same = tuple(
        dataclasses.replace(o, product=n.product, visible_transmittance=n.visible_transmittance) if o.product else o
        for o, n in zip(old.openings, new.openings, strict=True)
    )
    if content_key(dataclasses.replace(old, openings=same)) != content_key(new):
        return "geometry or materials"
    for opening, (before, after) in enumerate(zip(old.openings, new.openings, strict=True)):
        if before.product and fenestration_of(old, opening).basis != fenestration_of(new, opening).basis:
            return f"bins of the product in {after.name}"
    return None

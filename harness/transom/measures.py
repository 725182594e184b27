"""Measures: the few numbers by which an answer of ours is known again, chosen so that what drifts leads to the fault.

Each belongs to a category, which names what produced it: a component of light, the energy balance, the plan of the
solve, the geometry. A measure has a factor that turns a change of its value into the unit of its judged quantity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.renderer import ImageResult
from transom.scene.model import Scene, View
from transom.sensor_file import SensorTable, scene_sensors
from transom.sun_patch import sun_patches
from transom.visible import EXTERIOR, INTERIOR, FirstSurfaces, first_surfaces, region_masks

Float64 = NDArray[np.float64]

COMPONENTS = ("sun", "sky", "indirect", "emitted")

BLOCK_ROWS, BLOCK_COLUMNS = 6, 8
"""Blocks that a picture is divided into."""

LEAST_BLOCK_SHARE = 0.25
"""Blocks with fewer interior pixels than this share are left out."""

LEAST_COMPONENT_SHARE = 0.05
"""A change of a component is stated as a share of that component, or of this share of all light if it is weaker."""

PROBE_PIXELS = 96
"""Side of the six square pictures that a probe takes of what is around it."""

LEAST_FACE_PIXELS = 25
"""Faces that all probes together see with fewer pixels are not counted one by one."""

SEEN = "geometry seen"
"""Category of how much of a face probes in the rooms see."""

TRIANGLE = ", triangle "
UP_CLOSE = "faces up close"
"""Category of the light of each triangle, measured so near that nothing else is seen; its places are a face's words,
TRIANGLE and a number."""

UP_CLOSE_M = 1e-3
UP_CLOSE_RAYS = 64
LEAST_TRIANGLE_M2 = 1e-5
PLACE_DECIMALS = 12
"""Distance from the triangle, rays of each measurement, the smallest triangle that has one, and digits of its place."""

LEAST_LIGHT_SHARE = 0.01
"""Changes of a triangle's light are stated in percent of it, or of this share of the mean if it is darker."""

FACE_LOSS_SHARE = 0.2
"""That the probes see a face as they did is one claim; so much of its pixels lost or won counts as one broken claim."""

FACT_MEASURES = ("sweeps", "interior_patches", "nodes")
"""Facts of the solve and the relighting that are compared."""


@dataclass(frozen=True)
class Measure:
    """One number. quantity: as it is judged (transom.judge). category, place: what it is of. A change of `value` times
    `factor` is the change in the quantity's own unit: percent, millimetres, or a count."""

    quantity: str
    category: str
    place: str
    value: float
    factor: float

    @property
    def name(self) -> tuple[str, str, str]:
        return (self.quantity, self.category, self.place)


def relative(category: str, place: str, value: float, scale: float) -> Measure:
    """A measure whose change is stated in percent of `scale`."""
    return Measure("baseline_percent", category, place, value, 100 / scale if scale > 0 else 100.0)


def image_measures(scene: Scene, view: View, image: ImageResult, seen: FirstSurfaces) -> Iterator[Measure]:
    """Means by region and by block of each component of light, and the sun patches."""
    parts = {name: luminance(image.components[name]).astype(np.float64) for name in COMPONENTS}
    outside = luminance(image.components["exterior"]).astype(np.float64)
    total = sum(parts.values(), np.zeros_like(outside))
    masks = region_masks(scene, view, seen)
    for region, mask in masks.items():
        if region == EXTERIOR:
            yield relative("view through openings", region, float(outside[mask].mean()), float(outside[mask].mean()))
            continue
        light = float(total[mask].mean())
        for name, values in parts.items():
            mean = float(values[mask].mean())
            yield relative(name, region, mean, max(mean, LEAST_COMPONENT_SHARE * light))
    yield from _block_measures(parts, total, masks.get(INTERIOR, np.zeros_like(seen.interior)))
    yield from sun_measures(scene, view, parts["sun"], seen)


def sun_measures(scene: Scene, view: View, sun: Float64, seen: FirstSurfaces) -> Iterator[Measure]:
    """Place [m], and area against the length of its edges [mm], of the sun patch on each surface."""
    for patch in sun_patches(sun, scene, view, seen):
        for axis, value in zip("xyz", patch.centroid_m, strict=True):
            yield Measure("sun_edge_mm", "sun shadow", f"{patch.surface}, along {axis}", value, 1000.0)
        if patch.outline_m > 0:
            place = f"{patch.surface}, edges outwards"
            yield Measure("sun_edge_mm", "sun shadow", place, patch.area_m2, 1000 / patch.outline_m)


def sensor_measures(table: SensorTable) -> Iterator[Measure]:
    """The mean illuminance of each set of sensors, and each sensor by itself."""
    values = table.illuminance
    if values is None:
        return
    for name in dict.fromkeys(table.sets):
        chosen = [index for index, owner in enumerate(table.sets) if owner == name]
        mean = float(values[chosen].mean())
        yield relative("illuminance", name, mean, mean)
        if len(chosen) > 1:
            for number, index in enumerate(chosen):
                yield relative("illuminance by point", f"{name} {number}", float(values[index]), float(values[index]))


def fact_measures(facts: Mapping[str, Any]) -> Iterator[Measure]:
    """The energy balance, and what the solve planned."""
    yield Measure("energy_percent", "energy", "imbalance", float(facts["energy_imbalance"]), 100.0)
    for name in FACT_MEASURES:
        yield relative("plan", name, float(facts[name]), float(facts[name]))
    yield Measure("broken_claims", "geometry", "faces after cutting", float(facts["faces"]), 1.0)


def geometry_measures(scene: Scene) -> Iterator[Measure]:
    """Faces of the scene as it was read, and how much of each face probes in the room see, by the compiled engine."""
    yield Measure("broken_claims", "geometry", "faces of the scene", float(len(scene.mesh.faces)), 1.0)
    counts = _seen_pixels(scene)
    for face in np.flatnonzero(counts >= LEAST_FACE_PIXELS):
        count = float(counts[face])
        yield Measure("broken_claims", SEEN, face_words(scene, int(face)), count, 1 / (FACE_LOSS_SHARE * count))


def triangle_points(scene: Scene) -> SensorTable:
    """A point just before the middle of each triangle (two for a quad), looking at it; by face, in order."""
    mesh = scene.mesh
    names, points, normals = [], [], []
    for face, corners in enumerate(mesh.faces):
        for index, part in enumerate(((0, 1, 2), (0, 2, 3))[: 1 if corners[-1] < 0 or len(corners) == 3 else 2]):
            a, b, c = (mesh.vertices[corners[k]] for k in part)
            normal = np.cross(b - a, c - a)
            length = float(np.linalg.norm(normal))
            if length / 2 < LEAST_TRIANGLE_M2:
                continue
            names.append(f"{face_words(scene, face)}{TRIANGLE}{index + 1}")
            points.append((a + b + c) / 3 + UP_CLOSE_M * normal / length)
            normals.append(-normal / length)
    # The last bits of linear algebra hang on the processor: without them, the question is the same on every machine.
    return SensorTable(tuple(names), np.round(points, PLACE_DECIMALS), np.round(normals, PLACE_DECIMALS))


def triangle_measures(table: SensorTable) -> Iterator[Measure]:
    """The light of each triangle as it is measured from up close."""
    values = table.illuminance
    if values is None:
        return
    least = LEAST_LIGHT_SHARE * float(values.mean())
    for name, value in zip(table.sets, values, strict=True):
        yield relative(UP_CLOSE, name, float(value), max(float(value), least))


def face_words(scene: Scene, face: int) -> str:
    """A face for people."""
    mesh = scene.mesh
    material = scene.materials[int(mesh.face_material[face])].name
    return f"face {face} of {mesh.objects[mesh.face_object[face]]} ({material})"


def _block_measures(parts: Mapping[str, Float64], total: Float64, interior: NDArray[np.bool_]) -> Iterator[Measure]:
    """Mean of each component in each block, as a share of all the light in it. Sunlight is left to its patches."""
    height, width = interior.shape
    rows = np.linspace(0, height, BLOCK_ROWS + 1).astype(int)
    columns = np.linspace(0, width, BLOCK_COLUMNS + 1).astype(int)
    for row in range(BLOCK_ROWS):
        for column in range(BLOCK_COLUMNS):
            block = (slice(rows[row], rows[row + 1]), slice(columns[column], columns[column + 1]))
            mask = interior[block]
            if mask.mean() < LEAST_BLOCK_SHARE:
                continue
            light = float(total[block][mask].mean())
            for name in ("sky", "indirect", "emitted"):
                yield relative(f"{name} in blocks", f"{row},{column}", float(parts[name][block][mask].mean()), light)


def _seen_pixels(scene: Scene) -> NDArray[np.int64]:
    """By face, how many pixels of all probes see it first."""
    counts = np.zeros(len(scene.mesh.faces), np.int64)
    for place in _probe_places(scene):
        for direction, up in _CUBE_SIDES:
            (x, y, z), (dx, dy, dz) = place, direction
            probe = View("probe", place, (x + dx, y + dy, z + dz), up, math.pi / 2, PROBE_PIXELS, PROBE_PIXELS, 1.0)
            faces = first_surfaces(scene, probe).face
            counts += np.bincount(faces[faces >= 0], minlength=len(counts))
    return counts


def _probe_places(scene: Scene) -> list[tuple[float, float, float]]:
    """Eyes of all views, and the middle of each set of sensors, a little above it."""
    places = [view.position for view in scene.views]
    table = scene_sensors(scene) if scene.sensors else None
    for name in dict.fromkeys(table.sets) if table is not None else ():
        assert table is not None
        chosen = [index for index, owner in enumerate(table.sets) if owner == name]
        x, y, z = (float(value) for value in (table.points[chosen] + 0.3 * table.normals[chosen]).mean(axis=0))
        places.append((x, y, z))
    return places


_CUBE_SIDES: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = (
    ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
)

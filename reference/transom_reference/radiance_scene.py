"""A scene as Radiance reads it: the same triangles, materials and panes as text, with function files of our own.

Opaque surfaces are `plastic` without gloss, both sides alike. A pane is a `BRTDfunc` whose function file computes the
angular transmittance from Fresnel's equations, apart from the table that other renderers share, so that each checks
the other. Its room side reflects the hemispherical reflectance diffusely (matched), or the directional one as a mirror
(full physics). A product's BSDF file is Radiance's BSDF material: right for light from the sky and for the sun's where
it is spread; where a sun's lobe falls, a table of 10 to 15 degrees cannot say. A smooth face bends its normal by a
`texfunc`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.glass import NORMAL_REFLECTANCE, REFRACTIVE_INDEX, diffuse_reflectance, pane
from transom.scene.model import Material, Opening, ProductChoice, Scene
from transom_reference.radiance_daylight import SKY_FILE, SKY_FUNCTIONS, daylight_description, numbers, watts
from transom_reference.radiance_programs import make_octree

Float64 = NDArray[np.float64]

GLASS_FILE = "pane.cal"

GLASS_FUNCTIONS = f"""{{ A single pane of index {REFRACTIVE_INDEX}; arg(10): internal transmittance of one crossing
  at normal incidence. Fresnel's equations, all reflections between the two surfaces summed, mean of polarisations. }}
pane_index : {REFRACTIVE_INDEX};
pane_cosine = if(Rdot, if(Rdot - 1, 1, Rdot), if(-1 - Rdot, 1, -Rdot));
pane_refracted = sqrt(1 - (1 - pane_cosine*pane_cosine)/(pane_index*pane_index));
pane_crossing = if(arg(10), exp(log(arg(10))/pane_refracted), 0);
pane_square(x) : x*x;
pane_s = pane_square((pane_cosine - pane_index*pane_refracted)/(pane_cosine + pane_index*pane_refracted));
pane_p = pane_square((pane_index*pane_cosine - pane_refracted)/(pane_index*pane_cosine + pane_refracted));
pane_share(r, a) : if(1 - pane_square(r*a) - 1e-12, pane_square(1 - r)*a/(1 - pane_square(r*a)), 0);
pane_back(r, a) : r*(1 + a*pane_share(r, a));
pane_transmittance = (pane_share(pane_s, pane_crossing) + pane_share(pane_p, pane_crossing))/2;
pane_mirror = if(Rdot, 0, (pane_back(pane_s, pane_crossing) + pane_back(pane_p, pane_crossing))/2);
"""

NORMAL_FILE = "normal.cal"

NORMAL_FUNCTIONS = """{ Bends a face's normal to one that is linear in the place: arg(1..4), arg(5..8), arg(9..12). }
bend_x = arg(1)*Px + arg(2)*Py + arg(3)*Pz + arg(4);
bend_y = arg(5)*Px + arg(6)*Py + arg(7)*Pz + arg(8);
bend_z = arg(9)*Px + arg(10)*Py + arg(11)*Pz + arg(12);
"""

POINT_RADIUS_M = 0.001
"""A point source is a sphere of this radius: 0.0001 % off at 1 m."""

EMITTER_GAP_M = 1e-5
"""Radiance's lights have one side; an emitting face is two faces this far apart, back to back."""

EMISSION_SHARE = 1e-4
"""An emitter that also reflects is a mixture: this share a light that is 1 / share stronger, the rest the reflector."""


def write_scene(folder: Path, scene: Scene, condition: Condition, *, full_physics: bool = False) -> Path:
    """Writes description, function files and octree into `folder`; the octree's path.

    Raises InputError for a sky that Radiance has no function for, and with oconv's words for a scene that it refuses.
    """
    (folder / SKY_FILE).write_text(SKY_FUNCTIONS)
    (folder / GLASS_FILE).write_text(GLASS_FUNCTIONS)
    (folder / NORMAL_FILE).write_text(NORMAL_FUNCTIONS)
    text = [daylight_description(condition, full_physics=full_physics)]
    for index, material in enumerate(scene.materials):
        text.append(_material(index, material, scene.openings, full_physics))
    text += list(_faces(scene))
    for index, source in enumerate(scene.point_sources):
        # Radiance times the sphere's cross-section is intensity.
        level = watts(source.intensity) / (np.pi * POINT_RADIUS_M**2)
        text.append(f"void illum point_{index}\n1 void\n0\n3 {numbers(level)}")
        text.append(f"point_{index} sphere place_{index}\n0\n0\n4 {numbers(source.position)} {POINT_RADIUS_M}")
    description, octree = folder / "scene.rad", folder / "scene.oct"
    description.write_text("\n".join(text) + "\n")
    make_octree(description, octree)
    return octree


def internal_transmittance(opening: Opening) -> float:
    """Internal transmittance of one crossing at normal incidence, from the visible one by bisection of the pane."""
    surface = NORMAL_REFLECTANCE
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        passed = (1 - surface) ** 2 * middle / (1 - (surface * middle) ** 2)
        low, high = (middle, high) if passed < opening.visible_transmittance else (low, middle)
    pane(opening.visible_transmittance, np.ones(1))  # Refuses a transmittance that no pane has.
    return 0.5 * (low + high)


def _material(index: int, material: Material, openings: tuple[Opening, ...], full_physics: bool) -> str:
    name = f"material_{index}"
    if material.opening >= 0:
        return _pane(name, openings[material.opening], full_physics)
    reflector = f"void plastic {name}\n0\n0\n5 {numbers(material.reflectance)} 0 0"
    if max(material.luminance) <= 0:
        return reflector
    if max(material.reflectance) <= 0:
        return f"void glow {name}\n0\n0\n4 {numbers(watts(material.luminance))} 0"
    share = EMISSION_SHARE
    grey = np.asarray(material.reflectance) / (1 - share)
    if grey.max() > 1:
        raise InputError("emits and reflects too much for Radiance", field=material.name, value=material.reflectance)
    return (
        f"void plastic {name}_body\n0\n0\n5 {numbers(grey)} 0 0\n"
        f"void glow {name}_light\n0\n0\n4 {numbers(watts(material.luminance) / share)} 0\n"
        f"void mixfunc {name}\n4 {name}_light {name}_body {share} .\n0\n0"
    )


def _pane(name: str, opening: Opening, full_physics: bool) -> str:
    """Front: outdoors, black but for what passes. Back: the room side. A product's front is turned to the room."""
    if opening.glazing == "none":
        return f"# {name}: {opening.name} is an unglazed hole"
    if opening.product is not None:
        return _bsdf(name, opening.product)
    room = 0.0 if full_physics else diffuse_reflectance(opening)
    mirror = "pane_mirror" if full_physics else "0"
    values = [0.0, 0.0, 0.0, room, room, room, 0.0, 0.0, 0.0, internal_transmittance(opening)]
    through = "pane_transmittance"
    functions = f"{mirror} {mirror} {mirror} {through} {through} {through} 0 0 0 {GLASS_FILE}"
    return f"void BRTDfunc {name}\n10 {functions}\n0\n{len(values)} {numbers(values)}"


def _bsdf(name: str, product: ProductChoice) -> str:
    """Radiance's own BSDF material, of the file itself; its front faces the room, its up is the steepest way up."""
    if not product.name.lower().endswith(".xml"):
        remedy = f"Write its table first: transom measure {product.name}, and glaze with the XML file"
        raise InputError("is not a BSDF file that Radiance reads", field="product", value=product.name, remedy=remedy)
    return f"void BSDF {name}\n6 0 {product.name} 0 0 1 .\n0\n0"


def _faces(scene: Scene) -> Iterator[str]:
    """The mesh's triangles, without those of unglazed openings."""
    mesh = scene.mesh
    rows, source = mesh.triangles()
    is_second = np.concatenate([[False], source[1:] == source[:-1]])
    for index, row in enumerate(rows):
        face = int(source[index])
        number = int(mesh.face_material[face])
        material = scene.materials[number]
        if material.opening >= 0 and scene.openings[material.opening].glazing == "none":
            continue
        name, corners = f"material_{number}", mesh.vertices[row]
        if _area(corners) == 0:
            continue
        if material.opening >= 0 and scene.openings[material.opening].product is not None:
            corners = corners[::-1]
        if material.smooth and mesh.corner_normals is not None:
            choice = [0, 2, 3] if is_second[index] else [0, 1, 2]
            yield _bend(index, corners, mesh.corner_normals[face][choice], number)
            name = f"bent_{index}"
        if max(material.luminance) > 0:
            lift = 0.5 * EMITTER_GAP_M * _normal(corners)
            yield _polygon(name, f"face_{index}", corners + lift)
            yield _polygon(name, f"back_{index}", corners[::-1] - lift)
        else:
            yield _polygon(name, f"face_{index}", corners)


def _bend(index: int, corners: Float64, normals: Float64, number: int) -> str:
    """A texture for one triangle: interpolated normal less the face's own, and the material over it."""
    normal = _normal(corners)
    # Rows: the three corners, and a point off the plane, so that the linear function has one solution.
    places = np.column_stack([np.vstack([corners, corners[0] + normal]), np.ones(4)])
    turned = np.where((normals @ normal)[:, None] < 0, -normals, normals)
    wanted = np.vstack([turned, turned[:1]]) - normal
    weights = np.linalg.solve(places, wanted).T
    texture = f"void texfunc bend_{index}\n4 bend_x bend_y bend_z {NORMAL_FILE}\n0\n12 {numbers(weights)}"
    return f"{texture}\nbend_{index} alias bent_{index} material_{number}"


def _polygon(material: str, name: str, corners: Float64) -> str:
    return f"{material} polygon {name}\n0\n0\n{corners.size} {numbers(corners)}"


def _normal(corners: Float64) -> Float64:
    cross = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal: Float64 = cross / np.linalg.norm(cross)
    return normal


def _area(corners: Float64) -> float:
    return 0.5 * float(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])))

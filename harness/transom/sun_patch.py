"""Sun patches: where direct sunlight falls on each flat surface of a picture, in metres, and how far it has moved.

A pixel's share of sunlight is its direct luminance against that of the same surface in full sun. Edges are averaged
over a pixel, so that the share says where in it an edge runs: areas and centroids are known to a small part of a pixel.

Where the picture or furniture in front cuts a patch, those of its edges that the cut makes do not move with the sun:
its centroid then moves by less than its shadows do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Scene, View
from transom.visible import FirstSurfaces

Float64 = NDArray[np.float64]

FULL_SUN_PERCENTILE = 90.0
"""Of the lit pixels of a surface: their luminance is that of full sun."""

LEAST_LIT_SHARE = 1e-3
"""Pixels with less than this share of the picture's brightest sunlight count as dark when surfaces are chosen."""

LEAST_PIXELS = 100.0
"""Surfaces with less sunlight than so many whole pixels are left out."""

PLANE_STEP_M, NORMAL_STEP = 1e-3, 1e-3
"""Faces of one object are one surface when their planes agree to this."""


@dataclass(frozen=True)
class SunPatch:
    """Direct sunlight on one surface, as far as a view sees it.

    surface: its object and the direction that it faces. outline_m: length of the edges of sunlight inside the surface.
    """

    surface: str
    area_m2: float
    centroid_m: tuple[float, float, float]
    outline_m: float


@dataclass(frozen=True)
class PatchShift:
    """How a sun patch differs from an earlier one. shift_mm: of its centroid along x, y, z. growth_mm: mean
    displacement of its edges outwards, the change of its area over their length."""

    surface: str
    shift_mm: tuple[float, float, float]
    growth_mm: float

    @property
    def distance_mm(self) -> float:
        """Length of the shift."""
        return float(np.linalg.norm(self.shift_mm))


def sun_patches(sun_luminance: NDArray[np.floating], scene: Scene, view: View, seen: FirstSurfaces) -> list[SunPatch]:
    """Sun patches on the flat surfaces that a view sees, by name. sun_luminance: (h, w), direct sunlight alone."""
    luminance = np.asarray(sun_luminance, np.float64)
    names = surface_names(scene)
    position = np.asarray(seen.position, np.float64)
    owner = np.full(luminance.shape, -1)
    order = {name: index for index, name in enumerate(sorted(set(names)))}
    face_surface = np.array([order[name] for name in names])
    owner[seen.interior] = face_surface[seen.face[seen.interior]]
    normals = face_normals(scene)
    patches = []
    lit = luminance > LEAST_LIT_SHARE * luminance.max(initial=0.0)
    for name, index in order.items():
        mask = owner == index
        if (mask & lit).sum() < LEAST_PIXELS:
            continue
        normal = normals[names.index(name)]
        patch = sun_patch(name, luminance, mask, position, footprints(view, position, normal))
        if patch is not None:
            patches.append(patch)
    return patches


def sun_patch(
    surface: str, luminance: Float64, mask: NDArray[np.bool_], position: Float64, footprint: Float64
) -> SunPatch | None:
    """The patch on one flat surface, whose pixels are `mask` (h, w); None where there is too little sun.

    position: (h, w, 3) of pixel centres [m]. footprint: (h, w), area of the surface that a pixel sees [m²].
    """
    values = luminance[mask]
    lit = values[values > LEAST_LIT_SHARE * values.max(initial=0.0)]
    if lit.size == 0:
        return None
    share = np.where(mask, np.clip(luminance / np.percentile(lit, FULL_SUN_PERCENTILE), 0.0, 1.0), 0.0)
    if share.sum() < LEAST_PIXELS:
        return None
    weight = share[mask] * footprint[mask]
    area = float(weight.sum())
    x, y, z = (float(value) for value in weight @ position[mask] / area)
    return SunPatch(surface, area, (x, y, z), _outline(share, mask, position, footprint))


def patch_shift(before: SunPatch, now: SunPatch) -> PatchShift:
    """How `now` differs from `before`, the same surface's patch earlier."""
    x, y, z = (1000 * (b - a) for a, b in zip(before.centroid_m, now.centroid_m, strict=True))
    outline = before.outline_m
    growth = 1000 * (now.area_m2 - before.area_m2) / outline if outline > 0 else 0.0
    return PatchShift(before.surface, (x, y, z), growth)


def footprints(view: View, position: Float64, normal: Float64) -> Float64:
    """Area [m²] of a plane with this unit normal in each pixel, (h, w); position: of pixel centres, (h, w, 3)."""
    eye, target = np.array(view.position), np.array(view.target)
    axis = (target - eye) / np.linalg.norm(target - eye)
    ray = position - eye
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.linalg.norm(ray, axis=-1)
        direction = ray / distance[..., None]
        side = 2 * np.tan(view.vertical_fov_rad / 2) / view.height  # of a pixel, one metre ahead
        solid_angle = side**2 * np.abs(direction @ axis) ** 3
        area: Float64 = solid_angle * distance**2 / np.abs(direction @ normal)
    return area


def surface_names(scene: Scene) -> list[str]:
    """By face, the name of the flat surface that it belongs to: its object, the direction, and a number where one
    object has several parallel planes."""
    normals = face_normals(scene)
    anchors = scene.mesh.vertices[scene.mesh.faces[:, 0]]
    offsets = np.round(np.einsum("ij,ij->i", normals, anchors) / PLANE_STEP_M).astype(int)
    keys = np.round(normals / NORMAL_STEP).astype(int)
    planes: dict[str, list[tuple[int, ...]]] = {}
    names = []
    for face, owner in enumerate(scene.mesh.face_object):
        title = f"{scene.mesh.objects[owner]} facing {facing(normals[face])}"
        plane = (*(int(value) for value in keys[face]), int(offsets[face]))
        known = planes.setdefault(title, [])
        if plane not in known:
            known.append(plane)
        number = known.index(plane)
        names.append(title if number == 0 else f"{title} {number + 1}")
    return names


def face_normals(scene: Scene) -> Float64:
    """Unit normals of all faces, (N, 3)."""
    corners = scene.mesh.vertices[scene.mesh.faces[:, :3]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    found: Float64 = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return found


def facing(normal: Sequence[float] | Float64) -> str:
    """The direction of a normal in words: up, down, or the nearest of north, east, south and west."""
    x, y, z = (float(value) for value in normal)
    if abs(z) >= max(abs(x), abs(y)):
        return "up" if z > 0 else "down"
    if abs(x) >= abs(y):
        return "east" if x > 0 else "west"
    return "north" if y > 0 else "south"


def _outline(share: Float64, mask: NDArray[np.bool_], position: Float64, footprint: Float64) -> float:
    """Length of the edges of a share (h, w): the integral of its gradient's length over the surface (co-area formula,
    Federer 1959). The gradient in metres follows from differences between neighbouring pixels."""
    inner = mask[:-1, :-1] & mask[1:, :-1] & mask[:-1, 1:]
    along, down = (position[:-1, 1:] - position[:-1, :-1])[inner], (position[1:, :-1] - position[:-1, :-1])[inner]
    change_along = (share[:-1, 1:] - share[:-1, :-1])[inner]
    change_down = (share[1:, :-1] - share[:-1, :-1])[inner]
    aa, dd = (along * along).sum(axis=1), (down * down).sum(axis=1)
    ad = (along * down).sum(axis=1)
    determinant = aa * dd - ad**2
    squared = change_along**2 * dd - 2 * change_along * change_down * ad + change_down**2 * aa
    slope = np.sqrt(np.divide(squared, determinant, out=np.zeros_like(squared), where=determinant > 0).clip(0))
    return float((slope * footprint[:-1, :-1][inner]).sum())

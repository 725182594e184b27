"""What each pixel sees first: the masks by which errors are told apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.scene import region_mask
from transom.scene.model import Region, Scene, View

INTERIOR = "interior"
"""Name of the region of all pixels that see a surface of the interior."""

EXTERIOR = "exterior"
"""Name of the region of all other pixels: sky and ground seen directly."""


@dataclass(frozen=True)
class FirstSurfaces:
    """First surface at each pixel's centre, looking through openings.

    face: (h, w) index of the scene's face, -1 for none. position: (h, w, 3) [m].
    interior: (h, w) True where the pixel sees a surface of the interior, and not the sky, the ground or an opening.
    """

    face: NDArray[np.int32]
    position: NDArray[np.float32]
    interior: NDArray[np.bool_]


def first_surfaces(scene: Scene, view: View) -> FirstSurfaces:
    """Traces one ray through the centre of each pixel, in the compiled engine."""
    from transom.engine import trace_primary

    face, position, interior = trace_primary(scene, view)
    return FirstSurfaces(face, position, interior)


def region_masks(scene: Scene, view: View, surfaces: FirstSurfaces | None = None) -> dict[str, NDArray[np.bool_]]:
    """The regions that a view is compared on and that it sees, as masks (h, w): the interior, the scene's own regions
    within it, and the exterior apart."""
    surfaces = surfaces or first_surfaces(scene, view)
    masks = {INTERIOR: surfaces.interior}
    masks |= {region.name: region_pixels(scene, region, surfaces) for region in scene.regions}
    masks[EXTERIOR] = ~surfaces.interior
    return {name: mask for name, mask in masks.items() if mask.any()}


def region_pixels(scene: Scene, region: Region, surfaces: FirstSurfaces) -> NDArray[np.bool_]:
    """(h, w) True where a pixel sees the interior and its surface belongs to the region."""
    objects = np.where(surfaces.face >= 0, scene.mesh.face_object[surfaces.face], -1).astype(np.int32)
    return region_mask(region, scene.mesh.objects, objects, surfaces.position) & surfaces.interior

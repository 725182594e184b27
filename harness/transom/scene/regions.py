"""Regions: the named parts of a picture that comparisons are made on."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from transom.scene.model import Region

BOX_MARGIN_M = 1e-4
"""Surfaces that lie in a face of the box count as inside, although positions come in single precision."""


def region_objects(region: Region, object_names: Sequence[str]) -> list[int]:
    """Indices of the objects whose names match one of the region's shell patterns; all of them when it has none."""
    if not region.objects:
        return list(range(len(object_names)))
    return [
        index
        for index, name in enumerate(object_names)
        if any(fnmatchcase(name, pattern) for pattern in region.objects)
    ]


def region_mask(
    region: Region,
    object_names: Sequence[str],
    face_object_image: NDArray[np.integer],
    position_image: NDArray[np.floating],
) -> NDArray[np.bool_]:
    """Pixels that belong to the region, (height, width).

    object_names: the mesh's objects. face_object_image: (height, width) index of the object of each pixel's first
    surface, -1 where there is none. position_image: (height, width, 3) that surface's point [m]. A pixel belongs when
    its object matches one of the patterns (any object, when there are none) and its point lies in the box, if any.
    """
    chosen = np.zeros(len(object_names) + 1, dtype=bool)
    chosen[region_objects(region, object_names)] = True
    mask: NDArray[np.bool_] = chosen[np.where(face_object_image < 0, len(object_names), face_object_image)]
    if region.box is not None:
        low, high = np.array(region.box[0]) - BOX_MARGIN_M, np.array(region.box[1]) + BOX_MARGIN_M
        with np.errstate(invalid="ignore"):
            mask = mask & np.all((position_image >= low) & (position_image <= high), axis=-1)
    return mask

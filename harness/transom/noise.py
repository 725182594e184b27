"""How noisy a reference is: in the terms in which it is ordered and published, and what its noise does to a sum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.renderer import ImageResult

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

FLOOR_SHARE = 0.01
"""Floor of relative errors, as a share of the median luminance: it keeps nearly black pixels from deciding the mean."""

TILE_PIXELS = 16
"""Pixels of one batch have paths in common, so that their noise is alike over some pixels. Sums over tiles of this side
count as independent; what a whole picture has in common is in the spread of its batches' means."""

LEAST_TILES = 32
"""A region that meets fewer tiles is divided into smaller ones."""


def floor_cd_m2(luminances: NDArray[np.floating]) -> float:
    """Floor added to the denominator of relative errors [cd/m²]: 1 % of the median of the given luminances; of their
    mean where more than half of them are black."""
    if not luminances.size:
        return 0.0
    middle = float(np.median(luminances))
    return FLOOR_SHARE * (middle if middle > 0 else max(0.0, float(np.mean(luminances))))


def mean_relative_standard_error(result: ImageResult, mask: Bool) -> float:
    """Mean over the pixels in `mask` of standard error / (luminance + floor). 0 for a picture without noise.

    Raises ValueError for an empty mask.
    """
    if not mask.any():
        raise ValueError("no pixel to average over")
    if result.standard_error is None:
        return 0.0
    reference = luminance(result.mean)[mask]
    scale = reference + floor_cd_m2(reference)
    error = result.standard_error[mask].astype(np.float64)
    return float(np.mean(np.divide(error, scale, out=np.zeros_like(error), where=scale > 0)))


def tile_indices(mask: Bool, cell_pixels: int = 1) -> NDArray[np.intp]:
    """The tile of each True cell of `mask`, (N,), counted from 0. cell_pixels: side of a cell, 1 for pixels.

    Tiles have TILE_PIXELS a side, halved until the region meets LEAST_TILES of them or a tile is one cell.
    """
    rows, columns = np.nonzero(mask)
    side = max(1, TILE_PIXELS // cell_pixels)
    while True:
        _, found = np.unique((rows // side) * mask.shape[1] + columns // side, return_inverse=True)
        if side == 1 or found.size == 0 or found.max() + 1 >= LEAST_TILES:
            return found.ravel()
        side //= 2


def standard_error_of_mean(noise: Float64, tiles: NDArray[np.intp]) -> float:
    """Standard error of the mean of N values, from one draw of their noise (N,), whose sums over tiles are independent.

    Half the difference of a reference's halves is such a draw: its variance and its likeness between neighbours are
    those of the noise of their average.
    """
    sums = np.bincount(tiles, weights=noise)
    return float(np.sqrt(np.sum(sums**2))) / len(noise)

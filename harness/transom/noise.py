"""How noisy a reference is, in the terms in which it is ordered and published."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.renderer import ImageResult

FLOOR_SHARE = 0.01
"""Floor of relative errors, as a share of the median luminance: it keeps nearly black pixels from deciding the mean."""


def floor_cd_m2(luminances: NDArray[np.floating]) -> float:
    """Floor added to the denominator of relative errors [cd/m²]: 1 % of the median of the given luminances."""
    return FLOOR_SHARE * float(np.median(luminances)) if luminances.size else 0.0


def mean_relative_standard_error(result: ImageResult, mask: NDArray[np.bool_]) -> float:
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

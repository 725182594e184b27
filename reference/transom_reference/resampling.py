"""Choosing one of several candidates by what it would bring."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from transom_reference.mitsuba_setup import dr, mi

Candidate = Callable[[int], tuple[Any, tuple[Any, ...]]]
"""candidate(k) gives a weight >= 0 and what it belongs to, as a tuple of Dr.Jit values."""


def resample(candidate: Candidate, count: int, number: Any) -> tuple[Any, Any, Any]:
    """One of `count` candidates with probability in proportion to its weight: weighted reservoir sampling.

    Returns the mean weight, the chosen weight (0: none has any) and what was chosen. An
    estimate value / weight x mean weight is unbiased [Talbot et al. 2005, importance resampling].
    """
    chosen, kept = candidate(0)
    total = mi.Float(chosen)
    for part in range(1, count):
        weight, offered = candidate(part)
        total = total + weight
        share = weight / dr.maximum(total, 1e-30)
        take = number < share
        # The number is used again: within the part of [0, 1) that led to an outcome it is uniform.
        number = dr.select(take, number / dr.maximum(share, 1e-30), (number - share) / dr.maximum(1.0 - share, 1e-7))
        chosen = dr.select(take, weight, chosen)
        kept = tuple(dr.select(take, new, old) for new, old in zip(offered, kept, strict=True))
    return total * (1.0 / count), chosen, kept

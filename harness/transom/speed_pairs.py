"""Two builds timed in pairs: the ratio's median, its bootstrap interval, and what the A/A control teaches.

Each round times the base build, a second process of the same base build (A/A) and ours, in random order, so that drift
and load fall on all alike; only ratios within a round are used: ours to the geometric mean of the two others, and the
one of these to the other. The median of an odd number n of values has a bootstrap
distribution that is known exactly: of n draws with replacement, the median is at most the k-th smallest value when more
than half of them are, P = P(Binomial(n, k / n) >= (n + 1) / 2)  [Efron 1979, section 3]. Nothing is drawn at random.
The decision itself is `transom.judge.decide_speed`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from transom.judge import SpeedChange

Float64 = NDArray[np.float64]

FAMILY_ALPHA = 0.05
"""Chance that noise makes any quantity of one comparison look slower. The second build must say the same of the same
quantity, so that the comparison as a whole is wrong far more rarely."""

LEAST_RELEVANT = 1.02
"""A slowdown below this ratio is never relevant."""

CONTROL_QUANTILE = 0.95
"""A change is relevant beyond this quantile of the A/A control's median ratio. It is asked of two builds, on top of
significance: 0.99 would find a tenth fewer of the phases that are 10 % slower, and raise no fewer false alarms."""

DEFAULT_ROUNDS = 31
"""With 5 % of noise in each time, 31 rounds find a phase that is 10 % slower in nine cases out of ten."""

LEAST_ROUNDS = 9
"""Fewer pairs cannot exclude chance for a dozen quantities: all nine on one side happens once in 512."""


@dataclass(frozen=True)
class PairedTimes:
    """Times of one quantity [s], one of each build in every round, raw."""

    quantity: str
    base_s: tuple[float, ...]
    control_s: tuple[float, ...]
    ours_s: tuple[float, ...]


def speed_change(times: PairedTimes, quantity_count: int) -> SpeedChange:
    """The change of one of `quantity_count` quantities that are judged together.

    Raises ValueError for too few rounds or an even number of them.
    """
    rounds = len(times.base_s)
    if rounds < LEAST_ROUNDS or rounds % 2 == 0:
        raise ValueError(f"{rounds} rounds: an odd number from {LEAST_ROUNDS} is needed")
    base = np.sqrt(np.multiply(times.base_s, times.control_s))
    ours = log_ratios(times.ours_s, base)
    control = log_ratios(times.control_s, times.base_s)
    tail = 1 - (1 - FAMILY_ALPHA) ** (1 / quantity_count)
    low, high = median_interval(ours, tail)
    return SpeedChange(
        quantity=times.quantity,
        pair_count=rounds,
        base_s=float(np.median(base)),
        ours_s=float(np.median(times.ours_s)),
        ratio=math.exp(float(np.median(ours))),
        low=math.exp(low),
        high=math.exp(high),
        control_ratio=math.exp(float(np.median(control))),
        threshold=relevance_threshold(control),
    )


def log_ratios(ours: Sequence[float] | Float64, base: Sequence[float] | Float64) -> Float64:
    """ln(ours / base), pair by pair."""
    return np.log(np.asarray(ours, np.float64)) - np.log(np.asarray(base, np.float64))


def median_interval(values: Float64, tail: float) -> tuple[float, float]:
    """Bootstrap interval of the median of an odd number of values, with probability `tail` beyond each end."""
    ordered = np.sort(values)
    below = np.cumsum(median_weights(len(ordered)))
    low = int(np.searchsorted(below, tail, side="right"))
    high = len(ordered) - 1 - low
    return float(ordered[min(low, high)]), float(ordered[max(low, high)])


def relevance_threshold(control_log_ratios: Float64) -> float:
    """Ratio beyond which a change exceeds what two processes of one build show, and LEAST_RELEVANT."""
    sizes = np.abs(np.sort(control_log_ratios))
    order = np.argsort(sizes)
    reached = np.cumsum(median_weights(len(sizes))[order])
    last = min(int(np.searchsorted(reached, CONTROL_QUANTILE)), len(sizes) - 1)
    return max(LEAST_RELEVANT, math.exp(float(sizes[order][last])))


@cache
def median_weights(count: int) -> Float64:
    """(count,) probability that the bootstrap median of `count` (odd) values is the k-th smallest of them."""
    at_most = stats.binom.sf((count - 1) // 2, count, np.arange(count + 1) / count)
    return np.asarray(np.diff(at_most), np.float64)

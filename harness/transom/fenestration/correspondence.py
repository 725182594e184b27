"""Which lobe of one incident direction becomes which of a neighbouring one: by rank, or by assignment."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from transom.fenestration.through import Lobe

Float64 = NDArray[np.float64]

GRAZING = 1e-6
"""Least z of a sum of vectors: light goes into the room."""

FOLLOWS_RAD = math.radians(20.0)
"""A lobe without a link moves with one that has, less the farther they are apart, and not at all from here on."""

SAME_RAD = math.radians(0.3)
REACH_RAD = math.radians(10.0)
REACH_PER_STEP = 2.5
"""A lobe that would turn by more than REACH_RAD + REACH_PER_STEP times the angle between the incident directions has
not moved: it went out and another one came up. Light turned by a flat mirror turns by at most twice that angle."""


def matched(first: Sequence[Lobe], second: Sequence[Lobe], step_rad: float) -> dict[int, int]:
    """Lobes of two incident directions, `step_rad` apart, that are one: numbers of the second by those of the first.

    The assignment that moves the least flux by the least squared angle; a lobe, or the flux by which two differ, may
    also go out or come up, at the price of moving it by the reach [unbalanced transport with a node of no mass].
    """
    if not first or not second:
        return {}
    flux = [np.array([lobe.share for lobe in lobes]) for lobes in (first, second)]
    cosine = np.array([lobe.direction for lobe in first]) @ np.array([lobe.direction for lobe in second]).T
    angle2 = np.arccos(np.clip(cosine, -1, 1)) ** 2
    reach2 = (REACH_RAD + REACH_PER_STEP * step_rad) ** 2
    shared = np.minimum.outer(flux[0], flux[1])
    gain = np.maximum(0.0, shared * (reach2 - angle2))  # against letting both go out and come up
    rows, columns = linear_sum_assignment(gain, maximize=True)
    return {int(i): int(j) for i, j in zip(rows, columns, strict=True) if gain[i, j] > 0}


def followed(
    corners: Sequence[Sequence[Lobe]], links: Sequence[Sequence[dict[int, int]]], weights: Float64
) -> list[Lobe]:
    """Every lobe of every corner, its share by the corner's weight, moved towards the other two as its links say:

        direction = d_k + sum over other corners m of w_m (d_m - d_k), made a unit vector,

    where d_m is the linked lobe's direction. A lobe that all corners have comes out three times at the same place and
    is put together again. One without a link to a corner fades on the way there and moves with a close one that has.
    On an edge only the links along it count, so that the light is continuous from triangle to triangle, even where
    links contradict each other around a triangle. links: by corner and other corner.
    """
    found: list[Lobe] = []
    for here, lobes in enumerate(corners):
        if not lobes or not weights[here] > 0:
            continue
        start = np.array([lobe.direction for lobe in lobes])
        moved = start.copy()
        for there, others in enumerate(corners):
            link = links[here][there]
            if link and here != there:
                linked = list(link)
                turn = np.array([others[link[i]].direction - lobes[i].direction for i in linked])
                cosine = start @ start[linked].T
                apart = np.arccos(np.clip(cosine.max(axis=1), -1, 1))
                follows = np.maximum(0.0, 1 - apart / FOLLOWS_RAD)
                moved += weights[there] * follows[:, None] * turn[np.argmax(cosine, axis=1)]
        moved[:, 2] = np.maximum(moved[:, 2], GRAZING)
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        for lobe, vector in zip(lobes, moved, strict=True):
            found.append(Lobe(vector, lobe.share * float(weights[here]), lobe.width_rad, lobe.along))
    return merged(found)


def merged(lobes: Sequence[Lobe]) -> list[Lobe]:
    """Lobes with those that lie within SAME_RAD of a brighter one put into it; brightest first."""
    rest = sorted(lobes, key=lambda lobe: -lobe.share)
    found: list[Lobe] = []
    while rest:
        near = [bool(lobe.direction @ rest[0].direction >= math.cos(SAME_RAD)) or k == 0 for k, lobe in enumerate(rest)]
        group = [lobe for lobe, is_near in zip(rest, near, strict=True) if is_near]
        rest = [lobe for lobe, is_near in zip(rest, near, strict=True) if not is_near]
        shares = np.array([lobe.share for lobe in group])
        vector = shares @ np.array([lobe.direction for lobe in group])
        width = float(shares @ [lobe.width_rad for lobe in group] / shares.sum())
        found.append(Lobe(vector / np.linalg.norm(vector), float(shares.sum()), width, group[0].along))
    return sorted(found, key=lambda lobe: -lobe.share)


def interpolated_by_rank(corners: Sequence[Sequence[Lobe]], weights: Float64) -> list[Lobe]:
    """The paper's: lobes correspond by their brightness, the brightest with the brightest; shares linear, directions
    as weighted sums over the corners that have so many [Cutler et al. 2008, section 3.4]."""
    ranked = [sorted(lobes, key=lambda lobe: -lobe.share) for lobes in corners]
    found: list[Lobe] = []
    for rank in range(max(len(lobes) for lobes in ranked)):
        there = [
            (lobes[rank], float(weight))
            for lobes, weight in zip(ranked, weights, strict=True)
            if rank < len(lobes) and weight > 0
        ]
        if not there:
            continue
        vector = np.sum([weight * lobe.direction for lobe, weight in there], axis=0)
        share = sum(weight * lobe.share for lobe, weight in there)
        width = sum(weight * lobe.width_rad for lobe, weight in there) / sum(weight for _, weight in there)
        found.append(Lobe(vector / np.linalg.norm(vector), share, width))
    return found

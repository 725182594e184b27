"""Which lobe of one incident direction becomes which of a neighbouring one: by rank, or by assignment."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from transom.fenestration.through import Lobe

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

Branch = tuple[int, int, int]
"""One lobe followed over a triangle: its number at each corner, or NONE where it is not there."""

NONE = -1

GRAZING = 1e-6
"""Least z of a sum of vectors: light goes into the room."""

REACH_RAD = math.radians(10.0)
REACH_PER_STEP = 2.5
"""A lobe that would turn by more than REACH_RAD + REACH_PER_STEP times the angle between the incident directions has
not moved: it went out and another one came up. Light turned by a flat mirror turns by at most twice that angle."""


def by_rank(corners: Sequence[Sequence[Lobe]]) -> list[Branch]:
    """The paper's: the brightest with the brightest, and so on [Cutler et al. 2008, section 3.4]. Brightest first."""
    count = max(len(lobes) for lobes in corners)
    a, b, c = (len(lobes) for lobes in corners)
    return [(i if i < a else NONE, i if i < b else NONE, i if i < c else NONE) for i in range(count)]


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


def consistent(links: Sequence[dict[int, int]]) -> tuple[list[Branch], list[tuple[int, int, int]]]:
    """Branches from the links between corners 0-1, 1-2 and 2-0, and links that contradict others.

    A branch needs all three links, or one whose ends have no other. In a chain of two links, and where going round
    leads to another lobe, nothing says how the lobe moves within the triangle: the last return value lists these links
    as (side, from, to).
    """
    branches: list[Branch] = []
    wrong: list[tuple[int, int, int]] = []
    back = [{j: i for i, j in link.items()} for link in links]
    for side in range(3):
        following, previous = (side + 1) % 3, (side + 2) % 3
        for i, j in links[side].items():
            onward, backward = links[following].get(j, NONE), back[previous].get(i, NONE)
            branch = [NONE, NONE, NONE]
            branch[side], branch[following] = i, j
            if onward == backward == NONE:
                branches.append((branch[0], branch[1], branch[2]))
            elif onward == backward:
                branch[previous] = onward
                if side == 0:
                    branches.append((branch[0], branch[1], branch[2]))
            else:
                wrong.append((side, i, j))
    return branches, wrong


def with_lone(branches: Sequence[Branch], counts: Sequence[int]) -> list[Branch]:
    """The branches, and one for each lobe that is in none: it fades towards the other corners."""
    found = list(branches)
    for corner, count in enumerate(counts):
        taken = {branch[corner] for branch in branches}
        for i in range(count):
            if i not in taken:
                lone = [NONE, NONE, NONE]
                lone[corner] = i
                found.append((lone[0], lone[1], lone[2]))
    return found


Motions = Sequence[Sequence[Float64]]
"""By corner and by other corner, (lobes, 3): how the vector of each lobe changes on the way there."""


def motions(corners: Sequence[Sequence[Lobe]], links: Sequence[Sequence[dict[int, int]]]) -> Motions:
    """links: by corner and other corner. A lobe that has no link to the other corner fades on the way, and moves as
    the nearest that has one; without any it stays."""
    found: list[list[Float64]] = []
    for here, lobes in enumerate(corners):
        vectors = np.array([lobe.direction for lobe in lobes]).reshape(-1, 3)
        row: list[Float64] = []
        for there, others in enumerate(corners):
            link = links[here][there]
            if not link or here == there:
                row.append(np.zeros_like(vectors))
                continue
            starts = list(link)
            turned = np.array([others[link[i]].direction - lobes[i].direction for i in starts])
            row.append(turned[np.argmax(vectors @ vectors[starts].T, axis=1)])
        found.append(row)
    return found


def interpolated(
    corners: Sequence[Sequence[Lobe]], branches: Sequence[Branch], weights: Float64, moves: Motions | None = None
) -> list[Lobe]:
    """Each branch at the weights (3,) of a triangle's corners: shares linear, directions as sums of unit vectors.

    Without `moves`, weighted sums over the corners where the lobe is. With them, each corner's lobe also moves towards
    the corners where it is not; for a lobe that all three have, that is the same.
    """
    found: list[Lobe] = []
    for branch in branches:
        there = [(k, i) for k, i in enumerate(branch) if i != NONE and weights[k] > 0]
        lobes = [corners[k][i] for k, i in there]
        parts = np.array([weights[k] for k, _ in there])
        share = float(sum(part * lobe.share for part, lobe in zip(parts, lobes, strict=True)))
        if share <= 0:
            continue
        vectors = np.array([lobe.direction for lobe in lobes])
        if moves is not None:
            for row, (k, i) in enumerate(there):
                vectors[row] += sum(weights[m] * moves[k][m][i] for m in range(3))
            parts = parts * [lobe.share for lobe in lobes]
        vector = parts @ vectors
        vector[2] = max(vector[2], GRAZING)
        width = float(parts @ [lobe.width_rad for lobe in lobes] / parts.sum())
        found.append(Lobe(vector / np.linalg.norm(vector), share, width))
    return found

"""Lobes as in the paper: the k cones that hold the most light, and a prism's two lobes [Cutler et al. 2008, 3.4]."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis
from transom.fenestration.splitting import gathered
from transom.fenestration.through import Lobe, SunThrough

Float64 = NDArray[np.float64]

COUNT = 3
WIDTH_RAD = math.radians(23.0)
"""What the paper found enough for the laser cut panel: the full angle of a cone."""

CENTRES = 400
"""Brightest cells that are tried as the middle of a cone."""


def greedy_split(
    directions: Float64, flux: Float64, basis: AngleBasis, count: int = COUNT, width_rad: float = WIDTH_RAD
) -> SunThrough:
    """Cones of full angle `width_rad`, each holding the most of the light (N, 3), (N,) that those before it left, in
    the order found; a lobe's direction is the mean of what its cone holds. What none holds is the residual, by bin.
    Fewer than `count` cones where nothing is left.
    """
    if not len(flux):
        return SunThrough((), np.zeros(basis.count))
    towards, carried, cell = gathered(directions, flux)
    centres = towards[np.argsort(-carried, kind="stable")[:CENTRES]]
    inside = centres @ towards.T > math.cos(width_rad / 2)
    is_left = np.ones(len(carried), bool)
    lobes: list[Lobe] = []
    for _ in range(count):
        held = inside[int(np.argmax(inside @ np.where(is_left, carried, 0.0)))] & is_left
        share = float(carried[held].sum())
        if share <= 0:
            break
        mean = carried[held] @ towards[held]
        lobes.append(Lobe(mean / np.linalg.norm(mean), share, width_rad))
        is_left &= ~held
    residual = np.bincount(basis.bin_of(directions), flux * is_left[cell], basis.count).astype(np.float64)
    return SunThrough(tuple(lobes), residual)


def prism_lobes(incident: Float64, angle_low_deg: float, angle_high_deg: float, index: float) -> list[Lobe]:
    """Two lobes of a prismatic panel whose prisms look into the room: one refraction at the flat face, one at each
    facet; unpolarised, without what facets reflect. Shares by what each facet intercepts."""
    entering, into = _refracted(incident, np.array([0.0, 0.0, 1.0]), 1 / index)
    if into <= 0:
        return []
    lobes: list[Lobe] = []
    slopes = (math.radians(angle_low_deg), -math.radians(angle_high_deg))
    spread = sum(1 / math.tan(abs(slope)) if abs(slope) < math.pi / 2 else 0.0 for slope in slopes)
    for slope in slopes:
        normal = np.array([0.0, -math.sin(slope), math.cos(slope)])
        length = 1 / math.sin(abs(slope)) / spread  # of the facet, per period
        intercepted = length * float(entering @ normal) / float(entering[2])
        leaving, out = _refracted(entering, normal, index)
        if intercepted > 0 and out > 0 and leaving[2] > 0:
            lobes.append(Lobe(leaving, min(intercepted, 1.0) * into * out))
    return sorted(lobes, key=lambda lobe: -lobe.share)


def _refracted(direction: Float64, normal: Float64, ratio: float) -> tuple[Float64, float]:
    """Direction beyond a face whose normal points the way of the light, and the unpolarised transmittance; ratio: of
    the indices, before over beyond. Transmittance 0 where reflection is total [Snell, Fresnel]."""
    cosine = float(direction @ normal)
    beyond2 = 1 - ratio**2 * (1 - cosine**2)
    if cosine <= 0 or beyond2 <= 0:
        return direction, 0.0
    beyond = math.sqrt(beyond2)
    vector = ratio * direction + (beyond - ratio * cosine) * normal
    s = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    p = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    return np.asarray(vector / np.linalg.norm(vector)), 1 - 0.5 * (s * s + p * p)

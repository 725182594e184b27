"""Products that are known by their BSDF files alone: what of a table is a lobe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.bsdf import Bsdf, KlemsMatrix, Path, Scattering
from transom.bsdf.directions import KLEMS_FULL, AngleBasis, disc_from_square
from transom.fenestration.splitting import split
from transom.fenestration.through import Lobe, SunThrough

Float64 = NDArray[np.float64]

GRID = 128
"""Directions along a side of the Shirley-Chiu square at which a finely resolved table is read: about 0.8 degrees, as
the finest trees in use."""

SUNS_KEPT = 256

PEAK = 3.0
"""How many times brighter the bin straight on must be than the brightest beside it to hold light that passes
straight."""


@dataclass(frozen=True, eq=False)
class TabulatedFenestration:
    """A product by its tables.

    Klems matrices: what passes straight shows as a bin on the diagonal that outshines its neighbours; it becomes a
    lobe along the sun, and redirected light stays in its bin, whose 10 to 15 degrees say no more. Trees and scans: the
    exits at the sun's direction are read on a fine grid, and split as traced light is.
    """

    bsdf: Bsdf

    @property
    def basis(self) -> AngleBasis:
        return KLEMS_FULL

    @cached_property
    def _scattering(self) -> Scattering:
        return self.bsdf.get(Path.transmission_front)

    @cached_property
    def _matrix(self) -> Float64:
        return self._scattering.klems(KLEMS_FULL)

    def transmission(self) -> Float64:
        return self._matrix

    def room_reflectance(self) -> float:
        weights = KLEMS_FULL.projected_solid_angles
        matrix = self.bsdf.get(Path.reflection_back).klems(KLEMS_FULL)
        return float(weights @ matrix @ weights / np.pi)

    def sun(self, incident: Float64) -> SunThrough:
        return self._kept(tuple(float(v) for v in incident))

    @cached_property
    def _kept(self) -> Callable[[tuple[float, ...]], SunThrough]:
        return lru_cache(maxsize=SUNS_KEPT)(self._read)

    def _read(self, incident: tuple[float, ...]) -> SunThrough:
        direction = np.array(incident)
        if isinstance(self._scattering, KlemsMatrix):
            return self._straight_on(direction)
        cells = (np.arange(GRID) + 0.5) / GRID
        u, v = np.meshgrid(cells, cells, indexing="ij")
        xy = disc_from_square(u.ravel(), v.ravel())
        leaving = np.column_stack([xy, np.sqrt(np.maximum(0.0, 1 - (xy**2).sum(axis=1)))])
        flux = self._scattering.evaluate(np.broadcast_to(direction, leaving.shape), leaving) * (np.pi / GRID**2)
        lit = flux > 0
        return split(leaving[lit], flux[lit], KLEMS_FULL)

    def _straight_on(self, direction: Float64) -> SunThrough:
        here = int(KLEMS_FULL.bin_of(direction))
        column = self._matrix[:, here]
        beside = float(column[neighbours(KLEMS_FULL, here)].max())
        residual = column * KLEMS_FULL.projected_solid_angles
        if column[here] <= PEAK * beside:
            return SunThrough((), residual)
        share = float((column[here] - beside) * KLEMS_FULL.projected_solid_angles[here])
        residual[here] -= share
        return SunThrough((Lobe(direction, share),), residual)


def neighbours(basis: AngleBasis, index: int) -> NDArray[np.int64]:
    """Bins that share a border or a corner with a bin: those a little beyond its limits."""
    ring = int(np.searchsorted(np.cumsum(basis.counts), index, side="right"))
    low, high = basis.edges_deg[ring], basis.edges_deg[ring + 1]
    centre = basis.centres[index]
    middle, half = float(np.arctan2(centre[1], centre[0])), np.pi / basis.counts[ring]
    polar = np.radians([low - 0.5, low + 0.5, high - 0.5, high + 0.5])
    azimuth = middle + half * np.linspace(-1.01, 1.01, 25)
    if basis.counts[ring] == 1:
        azimuth = np.linspace(0, 2 * np.pi, 64)
    theta, phi = np.meshgrid(polar[(polar > 0) & (polar < np.pi / 2)], azimuth)
    around = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    found = np.unique(basis.bin_of(around))
    return np.asarray(found[found != index], np.int64)

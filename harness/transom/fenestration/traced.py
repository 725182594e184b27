"""Products whose section is known: light of the very direction of the sun is traced through them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis
from transom.fenestration.bins import PANEL_BINS, directions_within, mirror_in_x
from transom.fenestration.splitting import split
from transom.fenestration.through import SunThrough
from transom.products.section import Section

Float64 = NDArray[np.float64]

SUN_RAYS = 1024
"""Rays over a period for the sun."""

BIN_DIRECTIONS = 16
BIN_RAYS = 16
"""Directions in each incident bin, and rays over a period for each: 256 rays a bin."""

REFLECTED_DIRECTIONS = 8
"""Directions in each bin for the reflectance of the room side, which is one number."""

SUNS_KEPT = 256
SEED = 1


@dataclass(frozen=True, eq=False)
class TracedFenestration:
    """A product by its section, which is extruded along x, so that light mirrored in x leaves mirrored in x."""

    section: Section

    @property
    def basis(self) -> AngleBasis:
        return PANEL_BINS

    def sun(self, incident: Float64) -> SunThrough:
        return self._kept(tuple(float(v) for v in incident))

    @cached_property
    def _kept(self) -> Callable[[tuple[float, ...]], SunThrough]:
        return lru_cache(maxsize=SUNS_KEPT)(self._traced_sun)

    def _traced_sun(self, incident: tuple[float, ...]) -> SunThrough:
        exits = self.section.trace(incident, SUN_RAYS, SEED).transmitted
        return split(exits.directions, exits.flux, self.basis)

    @cached_property
    def _matrix(self) -> Float64:
        """Only incident bins with x >= 0 are traced; the others are their mirror images."""
        mirrored, own = mirror_in_x(self.basis), self._traced_bins
        sweep = self.section.sweep(self._directions(own, BIN_DIRECTIONS), BIN_RAYS, SEED)
        count = self.basis.count
        column = own[sweep.incidence // BIN_DIRECTIONS]
        cell = self.basis.bin_of(sweep.transmitted.directions) * count + column
        flux = np.bincount(cell, sweep.transmitted.flux / BIN_DIRECTIONS, count * count).reshape(count, count)
        turned = np.zeros_like(flux)
        turned[np.ix_(mirrored, mirrored[own])] = flux[:, own]
        flux = (flux + turned) * np.where(mirrored == np.arange(count), 0.5, 1.0)
        return flux / self.basis.projected_solid_angles[:, None]

    @cached_property
    def _traced_bins(self) -> NDArray[np.int64]:
        return np.flatnonzero(mirror_in_x(self.basis) >= np.arange(self.basis.count))

    def _directions(self, bins: NDArray[np.int64], count: int) -> Float64:
        return directions_within(self.basis, count)[bins].reshape(-1, 3)

    def transmission(self) -> Float64:
        return self._matrix

    @cached_property
    def _room_reflectance(self) -> float:
        own = self._traced_bins
        from_room = self._directions(own, REFLECTED_DIRECTIONS) * [1.0, 1.0, -1.0]
        by_bin = self.section.sweep(from_room, BIN_RAYS, SEED).reflectance.reshape(len(own), -1).mean(axis=1)
        weight = self.basis.projected_solid_angles[own] * np.where(mirror_in_x(self.basis)[own] == own, 1, 2)
        return float(by_bin @ weight / weight.sum())

    def room_reflectance(self) -> float:
        return self._room_reflectance

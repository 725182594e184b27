"""Products whose geometry is known: light of the very direction of the sun is traced through them."""

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
from transom.products.section import Exits, Section
from transom.products.unit_cell import UnitCell

Float64 = NDArray[np.float64]

SUN_RAYS = 4096
GUIDED_RAYS = 1024
"""Rays that stand for the sun where surfaces are diffuse or curved; fewer where curved glass, or glass that
repeats along two axes, guides light far. Between flat faces light is followed as beams, exactly."""

BIN_DIRECTIONS = 16
BIN_RAYS = 16
"""Directions in each incident bin, and rays over a period for each: 256 rays a bin."""

REFLECTED_DIRECTIONS = 4
"""Directions in each bin for the reflectance of the room side, which is one number."""

SUNS_KEPT = 256
SEED = 1


@dataclass(frozen=True, eq=False)
class TracedFenestration:
    """A product by its section or its unit cell. A section is extruded along x, so that light mirrored in x leaves
    mirrored in x: of its incident bins only those with x >= 0 are traced."""

    geometry: Section | UnitCell

    @property
    def basis(self) -> AngleBasis:
        return PANEL_BINS

    def sun(self, incident: Float64) -> SunThrough:
        return self._kept(tuple(float(v) for v in incident))

    def exits(self, incident: Float64) -> Exits:
        """All light of one direction (3,) that leaves into the room, before it is split."""
        if isinstance(self.geometry, Section):
            is_costly = any(line.bow and line.kind == "interface" for line in self.geometry.lines)
        else:
            is_costly = any(surface.kind == "interface" for surface in self.geometry.surfaces)
        return self.geometry.trace(incident, GUIDED_RAYS if is_costly else SUN_RAYS, SEED).transmitted

    @cached_property
    def _kept(self) -> Callable[[tuple[float, ...]], SunThrough]:
        return lru_cache(maxsize=SUNS_KEPT)(self._traced_sun)

    def _traced_sun(self, incident: tuple[float, ...]) -> SunThrough:
        exits = self.exits(np.array(incident))
        return split(exits.directions, exits.flux, self.basis)

    @cached_property
    def _matrix(self) -> Float64:
        mirrored, own = self._mirrored, self._traced_bins
        sweep = self.geometry.sweep(self._directions(own, BIN_DIRECTIONS), BIN_RAYS, SEED)
        count = self.basis.count
        column = own[sweep.incidence // BIN_DIRECTIONS]
        cell = self.basis.bin_of(sweep.transmitted.directions) * count + column
        flux = np.bincount(cell, sweep.transmitted.flux / BIN_DIRECTIONS, count * count).reshape(count, count)
        turned = np.zeros_like(flux)
        turned[np.ix_(mirrored, mirrored[own])] = flux[:, own]
        flux = (flux + turned) * np.where(mirrored == np.arange(count), 0.5, 1.0)  # on the plane: the mean of both
        return flux / self.basis.projected_solid_angles[:, None]

    @cached_property
    def _traced_bins(self) -> NDArray[np.int64]:
        return np.flatnonzero(self._mirrored >= np.arange(self.basis.count))

    @cached_property
    def _mirrored(self) -> NDArray[np.int64]:
        """By bin, the one whose light is the same mirrored in x; itself where nothing says so."""
        is_extruded = isinstance(self.geometry, Section)
        return mirror_in_x(self.basis) if is_extruded else np.arange(self.basis.count)

    def _directions(self, bins: NDArray[np.int64], count: int) -> Float64:
        return directions_within(self.basis, count)[bins].reshape(-1, 3)

    def transmission(self) -> Float64:
        return self._matrix

    @cached_property
    def _room_reflectance(self) -> float:
        own = self._traced_bins
        from_room = self._directions(own, REFLECTED_DIRECTIONS) * [1.0, 1.0, -1.0]
        by_bin = self.geometry.sweep(from_room, BIN_RAYS, SEED).reflectance.reshape(len(own), -1).mean(axis=1)
        weight = self.basis.projected_solid_angles[own] * np.where(self._mirrored[own] == own, 1, 2)
        return float(by_bin @ weight / weight.sum())

    def room_reflectance(self) -> float:
        return self._room_reflectance

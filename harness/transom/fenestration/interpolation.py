"""Lobes of a product between the directions in which it was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis
from transom.fenestration.correspondence import followed, interpolated_by_rank, matched
from transom.fenestration.through import SunThrough
from transom.fenestration.triangulation import SphericalTriangulation

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Edge = tuple[int, int]


@dataclass(frozen=True, eq=False)
class LobeTable:
    """What parallel light of each of N incident directions (N, 3) becomes, and what lies between them.

    is_by_rank: lobes correspond by their brightness, as in the paper; else by assignment along each edge of the
    triangulation.
    """

    incident: Float64
    through: Sequence[SunThrough]
    basis: AngleBasis
    is_by_rank: bool = False
    known_links: dict[Edge, dict[int, int]] = field(default_factory=dict)
    """Links already found, by corners in rising order."""

    @cached_property
    def triangulation(self) -> SphericalTriangulation:
        return SphericalTriangulation(self.incident)

    def at(self, incident: Float64) -> SunThrough:
        """Lobes and residual of any direction (3,), z > 0: their sum is the corners' transmittance, interpolated."""
        corners, weights = self.triangulation.locate(incident)
        key = tuple(int(corner) for corner in corners)
        lobes = [self.through[corner].lobes for corner in key]
        if self.is_by_rank:
            found = interpolated_by_rank(lobes, weights)
        else:
            found = followed(lobes, [[self._directed(a, b) if a != b else {} for b in key] for a in key], weights)
        residual = np.sum([self.through[k].residual * w for k, w in zip(key, weights, strict=True)], axis=0)
        return SunThrough(tuple(sorted(found, key=lambda lobe: -lobe.share)), residual)

    def _directed(self, a: int, b: int) -> dict[int, int]:
        """Lobes of corner b by those of corner a that they are."""
        edge = (min(a, b), max(a, b))
        if edge not in self.known_links:
            step = float(np.arccos(np.clip(self.incident[a] @ self.incident[b], -1, 1)))
            self.known_links[edge] = matched(self.through[edge[0]].lobes, self.through[edge[1]].lobes, step)
        links = self.known_links[edge]
        return links if a < b else {j: i for i, j in links.items()}

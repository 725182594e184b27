"""Lobes of a product between the directions in which it was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis
from transom.fenestration.correspondence import by_rank, consistent, interpolated, matched, motions, with_lone
from transom.fenestration.through import SunThrough
from transom.fenestration.triangulation import SphericalTriangulation

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Edge = tuple[int, int]


@dataclass(frozen=True, eq=False)
class LobeTable:
    """What parallel light of each of N incident directions (N, 3) becomes, and what lies between them.

    by_rank: lobes correspond by their brightness, as in the paper; else by assignment along each edge of the
    triangulation, of which a triangle follows what is consistent around it. Links that contradict others in any
    triangle are cut in all, so that the answer is continuous across edges.
    """

    incident: Float64
    through: Sequence[SunThrough]
    basis: AngleBasis
    is_by_rank: bool = False
    known_links: dict[Edge, dict[int, int]] = field(default_factory=dict)
    """Links already found, by corners in rising order: tables that share corners may share this."""

    @cached_property
    def triangulation(self) -> SphericalTriangulation:
        return SphericalTriangulation(self.incident)

    def at(self, incident: Float64) -> SunThrough:
        """Lobes and residual of any direction (3,), z > 0: their sum is the corners' transmittance, interpolated."""
        corners, weights = self.triangulation.locate(incident)
        key = tuple(int(corner) for corner in corners)
        lobes = [self.through[corner].lobes for corner in key]
        if self.is_by_rank:
            found = interpolated(lobes, by_rank(lobes), weights)
        else:
            links = [[self._directed(a, b) if a != b else {} for b in key] for a in key]
            branches, _ = consistent([links[0][1], links[1][2], links[2][0]])
            branches = with_lone(branches, [len(of_corner) for of_corner in lobes])
            found = interpolated(lobes, branches, weights, motions(lobes, links))
        residual = np.sum([self.through[k].residual * w for k, w in zip(key, weights, strict=True)], axis=0)
        return SunThrough(tuple(sorted(found, key=lambda lobe: -lobe.share)), residual)

    def _directed(self, a: int, b: int) -> dict[int, int]:
        links = self._links[(min(a, b), max(a, b))]
        return links if a < b else {j: i for i, j in links.items()}

    @cached_property
    def _links(self) -> dict[Edge, dict[int, int]]:
        """By edge (corners in rising order), lobes of the second by those of the first; contradictions cut."""
        triangles = [tuple(sorted(int(v) for v in triangle)) for triangle in self.triangulation.triangles]
        edges = {(t[i], t[j]) for t in triangles for i, j in ((0, 1), (1, 2), (0, 2))}
        for edge in edges - self.known_links.keys():
            a, b = edge
            step = float(np.arccos(np.clip(self.incident[a] @ self.incident[b], -1, 1)))
            self.known_links[edge] = matched(self.through[a].lobes, self.through[b].lobes, step)
        links = {edge: dict(self.known_links[edge]) for edge in edges}
        pending = triangles
        while pending:
            changed: set[Edge] = set()
            for triangle in pending:
                changed |= self._cut_weakest(links, triangle)
            pending = [t for t in triangles if not changed.isdisjoint({(t[0], t[1]), (t[1], t[2]), (t[0], t[2])})]
        return links

    def _cut_weakest(self, links: dict[Edge, dict[int, int]], triangle: tuple[int, ...]) -> set[Edge]:
        """Cuts, of the links of a triangle that contradict each other, those that move the least light; until none
        does. Returns the edges that lost one."""
        a, b, c = triangle
        sides = ((a, b), (b, c), (a, c))
        changed: set[Edge] = set()
        while True:
            backward = {j: i for i, j in links[a, c].items()}
            _, wrong = consistent([links[a, b], links[b, c], backward])
            if not wrong:
                return changed
            named = [(sides[side], (j, i) if side == 2 else (i, j)) for side, i, j in wrong]
            edge, (i, _) = min(named, key=lambda link: self._moved(*link))
            del links[edge][i]
            changed.add(edge)

    def _moved(self, edge: Edge, lobes: tuple[int, int]) -> float:
        return min(self.through[corner].lobes[lobe].share for corner, lobe in zip(edge, lobes, strict=True))

"""Tensor trees: scattering tables whose resolution follows the data, over Shirley-Chiu squares [Ward et al. 2012].

Coordinates, each 0..1. Rank 4: the square of the incident direction, then that of the leaving one. Rank 3, for
products that look the same however they are turned: (1 - sin(theta_in)) / 2, then the square of the leaving direction
turned so that the incident one has azimuth 0. Branches have 2^rank children, child bit d for the upper half of
coordinate d; a leaf is one value or a grid of 2^(rank k) with the first coordinate slowest [Radiance: bsdf_t.c].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from transom.bsdf.directions import AngleBasis, disc_from_square, square_from_disc

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

LARGEST_LEVEL = 7
"""A resolution of 2^7 a coordinate is the largest that Radiance makes: 268 million values."""

LEAST_KLEMS_LEVEL, LARGEST_KLEMS_LEVEL = 5, 6
"""Levels of the grid through which a tree becomes a Klems matrix."""

SUBCELLS = 8
"""Points a side by which the share of a cell in a bin is found."""


class TreeError(ValueError):
    """What is wrong with the text of a tree."""


@dataclass(frozen=True)
class TensorTree:
    """A tree flattened to cells. low (N, rank): corner of each cell. level (N,): its side is 2^-level. values (N,).

    cell_of: by coordinates on the grid of the finest level, in the order of a Z-curve.
    """

    rank: int
    low: Float64
    level: Int64
    values: Float64

    @cached_property
    def _order(self) -> tuple[Int64, Int64]:
        """Cells by their first Z-curve code at the finest level."""
        codes = self._codes(self.low)
        order = np.argsort(codes, kind="stable")
        return codes[order], order

    @cached_property
    def finest(self) -> int:
        return int(self.level.max())

    def _codes(self, places: Float64) -> Int64:
        """Z-curve codes of points (..., rank) at the finest level."""
        side = 1 << self.finest
        cells = np.minimum((np.asarray(places) * side).astype(np.int64), side - 1)
        codes = np.zeros(cells.shape[:-1], np.int64)
        for bit in range(self.finest):
            for axis in range(self.rank):
                codes |= ((cells[..., axis] >> bit) & 1) << (bit * self.rank + axis)
        return codes

    def at(self, places: Float64) -> Float64:
        """Values at coordinates (..., rank)."""
        codes, order = self._order
        found = np.searchsorted(codes, self._codes(places), side="right") - 1
        return np.asarray(self.values[order[found]])

    def coordinates(self, incident: Float64, leaving: Float64) -> Float64:
        """Coordinates (..., rank) of pairs of directions of propagation (..., 3)."""
        incident, leaving = np.broadcast_arrays(np.asarray(incident, np.float64), np.asarray(leaving, np.float64))
        if self.rank == 4:
            first = square_from_disc(incident[..., 0], incident[..., 1])
            second = square_from_disc(leaving[..., 0], leaving[..., 1])
            return np.concatenate([first, second], -1)
        sine = np.minimum(np.hypot(incident[..., 0], incident[..., 1]), 1.0)
        phi = np.arctan2(incident[..., 1], incident[..., 0])
        x = np.cos(phi) * leaving[..., 0] + np.sin(phi) * leaving[..., 1]
        y = np.cos(phi) * leaving[..., 1] - np.sin(phi) * leaving[..., 0]
        # Just below 1/2 at normal incidence: the upper half of this coordinate is not used.
        return np.concatenate([np.minimum(0.5 - 0.5 * sine, 0.5 - 1e-6)[..., None], square_from_disc(x, y)], -1)

    def evaluate(self, incident: Float64, leaving: Float64) -> Float64:
        return self.at(self.coordinates(incident, leaving))

    def hemispherical(self, incident: Float64) -> Float64:
        """Exact: cells that the incident direction meets, by their share of the leaving square, times pi."""
        incident = np.asarray(incident, np.float64)
        flat = incident.reshape(-1, 3)
        place = self.coordinates(flat, np.broadcast_to([0.0, 0.0, 1.0], flat.shape))[:, : self.rank - 2]
        size = 2.0**-self.level
        share = self.values * size**2 * np.pi
        result = np.empty(len(flat))
        for row, position in enumerate(place):
            inside = np.all(
                (self.low[:, : self.rank - 2] <= position) & (position < self.low[:, : self.rank - 2] + size[:, None]),
                1,
            )
            result[row] = share[inside].sum()
        return result.reshape(incident.shape[:-1])

    def klems(self, basis: AngleBasis) -> Float64:
        """Means over pairs of bins. Flux is kept: a cell of the finest grid gives each bin the share that it covers."""
        side = 1 << min(max(self.finest, LEAST_KLEMS_LEVEL), LARGEST_KLEMS_LEVEL)
        shares = csr_array(_bin_shares(basis, side))
        centres, places = _square_directions(side), _square_places(side)
        flux = np.empty((basis.count, len(centres)))
        for column in range(len(centres)):
            if self.rank == 4:
                where = np.column_stack([np.broadcast_to(places[column], places.shape), places])
            else:
                where = self.coordinates(centres[column], centres)
            flux[:, column] = shares @ self.at(where)
        cell = np.pi / side**2
        solid = basis.projected_solid_angles
        return np.asarray((shares @ flux.T).T * cell**2 / np.outer(solid, solid))


def _square_places(side: int) -> Float64:
    """Middles of the cells of a square (side², 2)."""
    places = (np.arange(side) + 0.5) / side
    u, v = np.meshgrid(places, places, indexing="ij")
    return np.column_stack([u.ravel(), v.ravel()])


def _square_directions(side: int) -> Float64:
    """Directions (side², 3) at the middles of the cells of a square."""
    places = _square_places(side)
    xy = disc_from_square(places[:, 0], places[:, 1])
    return np.column_stack([xy, np.sqrt(np.maximum(0.0, 1 - (xy**2).sum(1)))])


@cache
def _bin_shares(basis: AngleBasis, side: int) -> Float64:
    """Share of each cell of a square that lies in each bin (B, side²)."""
    fine = _square_directions(side * SUBCELLS)
    bins = basis.bin_of(fine).reshape(side, SUBCELLS, side, SUBCELLS)
    cells = np.broadcast_to(np.arange(side * side).reshape(side, 1, side, 1), bins.shape)
    shares = np.zeros((basis.count, side * side))
    np.add.at(shares, (bins.ravel(), cells.ravel()), 1 / SUBCELLS**2)
    return shares


def parse_tree(text: str, rank: int) -> TensorTree:
    """Reads the nested braces of a tree. Raises TreeError naming what is wrong."""
    tokens = text.replace(",", " ").replace("{", " { ").replace("}", " } ").split()
    lows: list[Float64] = []
    levels: list[NDArray[np.int64]] = []
    values: list[Float64] = []
    position = 0

    def node(low: Float64, level: int) -> None:
        nonlocal position
        if level > LARGEST_LEVEL:
            raise TreeError(f"is more than {LARGEST_LEVEL} levels deep")
        if position >= len(tokens) or tokens[position] != "{":
            raise TreeError("an opening brace is missing")
        position += 1
        if position < len(tokens) and tokens[position] == "{":
            half = 0.5 ** (level + 1)
            for child in range(1 << rank):
                offset = np.array([half * (child >> axis & 1) for axis in range(rank)])
                node(low + offset, level + 1)
            if position >= len(tokens) or tokens[position] != "}":
                raise TreeError(f"a branch has not {1 << rank} parts")
        else:
            end = position
            while end < len(tokens) and tokens[end] not in "{}":
                end += 1
            grid(low, level, tokens[position:end])
            position = end
            if position >= len(tokens) or tokens[position] != "}":
                raise TreeError("a closing brace is missing")
        position += 1

    def grid(low: Float64, level: int, words: list[str]) -> None:
        fineness = next((k for k in range(LARGEST_LEVEL + 1) if (1 << (rank * k)) == len(words)), None)
        if fineness is None:
            raise TreeError(f"a grid has {len(words)} values, which is no power of 2^{rank}")
        try:
            numbers = np.array(words, np.float64)
        except ValueError as error:
            raise TreeError(f"a value is not a number ({error})") from None
        side = 1 << fineness
        cells = np.indices((side,) * rank).reshape(rank, -1).T
        lows.append(low + cells * 0.5 ** (level + fineness))
        levels.append(np.full(len(numbers), level + fineness))
        values.append(numbers)

    node(np.zeros(rank), 0)
    if position != len(tokens):
        raise TreeError("there is text after the end of the tree")
    tree = TensorTree(rank, np.concatenate(lows), np.concatenate(levels), np.concatenate(values))
    if tree.finest > LARGEST_LEVEL:
        raise TreeError(f"is {tree.finest} levels deep, more than {LARGEST_LEVEL}")
    return tree

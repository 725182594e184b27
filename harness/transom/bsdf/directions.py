"""Directions at a product: its frame, the Klems basis and the Shirley-Chiu square.

The frame of a product: x to the right and y up as seen from the room looking out, z from outdoors into the room.
Every direction here is one of propagation. A direction's (theta, phi) are its angle to the z axis, whichever way along
it light goes, and the azimuth of its (x, y). Light that passes straight keeps both; light that is mirrored does too.
That is also how LBNL's WINDOW and Radiance number them [Radiance: src/common/bsdf_m.c, klems_full.cal].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]


@dataclass(frozen=True)
class AngleBasis:
    """Bins of the hemisphere in rings. edges_deg: polar limits (R + 1). counts: bins of each ring (R); bin 0 of a ring
    is centred at azimuth 0, the others follow counter-clockwise."""

    name: str
    edges_deg: tuple[float, ...]
    counts: tuple[int, ...]

    @property
    def count(self) -> int:
        return sum(self.counts)

    @cached_property
    def _first(self) -> Int64:
        return np.concatenate([[0], np.cumsum(self.counts)])

    @cached_property
    def projected_solid_angles(self) -> Float64:
        """Integral of cos(theta) over each bin (B,) [sr]; their sum is pi."""
        squares = np.sin(np.radians(self.edges_deg)) ** 2
        return np.repeat(np.pi * np.diff(squares) / np.asarray(self.counts), self.counts)

    @cached_property
    def centres(self) -> Float64:
        """Unit (x, y, |z|) at the middle of each bin (B, 3): mid polar angle of its ring, 0 for a cap."""
        rows: list[Float64] = []
        for low, high, count in zip(self.edges_deg[:-1], self.edges_deg[1:], self.counts, strict=True):
            theta = np.radians(0.0 if count == 1 else 0.5 * (low + high))
            phi = 2 * np.pi * np.arange(count) / count
            rows.append(
                np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.full(count, np.cos(theta))], 1)
            )
        return np.concatenate(rows)

    def bin_of(self, directions: Float64) -> Int64:
        """Bin of each direction (..., 3), whatever the sign of its z."""
        unit = np.asarray(directions, np.float64)
        radius = np.hypot(unit[..., 0], unit[..., 1])
        theta = np.degrees(np.arctan2(radius, np.abs(unit[..., 2])))
        ring = np.clip(np.searchsorted(self.edges_deg, theta, side="right") - 1, 0, len(self.counts) - 1)
        count = np.asarray(self.counts)[ring]
        turn = np.arctan2(unit[..., 1], unit[..., 0]) / (2 * np.pi)
        return np.asarray(self._first[ring] + np.floor(turn * count + 0.5).astype(np.int64) % count)

    @cached_property
    def opposite(self) -> Int64:
        """By bin, the bin at the other side of the normal (azimuth + 180 degrees): where light goes when it is turned
        back (B,)."""
        return self.bin_of(self.centres * np.array([-1.0, -1.0, 1.0]))


KLEMS_FULL = AngleBasis(
    "LBNL/Klems Full", (0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 90.0), (1, 8, 16, 20, 24, 24, 24, 16, 12)
)
"""145 bins [Klems 1994, ASHRAE Transactions 100(1); limits as in LBNL WINDOW's files]."""


def square_from_disc(x: Float64, y: Float64) -> Float64:
    """The point (..., 2) of the unit square that area-preservingly maps to (x, y) of the unit disc
    [Shirley & Chiu 1997]. Equal areas of the square are equal projected solid angles: pi sr in all."""
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    radius = np.minimum(np.hypot(x, y), 1.0)
    phi = np.arctan2(y, x)
    phi = np.where(phi < -np.pi / 4, phi + 2 * np.pi, phi)
    sector = np.minimum((phi + np.pi / 4) // (np.pi / 2), 3).astype(int)
    along = (phi - sector * np.pi / 2) * radius / (np.pi / 4)
    a = np.choose(sector, [radius, -along, -radius, along])
    b = np.choose(sector, [along, radius, -along, -radius])
    return np.asarray(np.stack([(a + 1) / 2, (b + 1) / 2], -1))


def disc_from_square(u: Float64, v: Float64) -> Float64:
    """The point (..., 2) of the unit disc for a point of the unit square; the inverse of `square_from_disc`."""
    a, b = np.broadcast_arrays(2 * np.asarray(u, np.float64) - 1, 2 * np.asarray(v, np.float64) - 1)
    wide = np.abs(a) >= np.abs(b)
    larger, smaller = np.where(wide, a, b), np.where(wide, b, a)
    angle = np.divide(smaller, larger, out=np.zeros_like(smaller), where=larger != 0) * (np.pi / 4)
    phi = np.where(wide, angle, np.pi / 2 - angle)
    return np.asarray(np.stack([larger * np.cos(phi), larger * np.sin(phi)], -1))

"""The bins in which products spread light that is not in a lobe, and directions spread over bins."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

PANEL_BINS = AngleBasis(
    "Transom 205",
    (0.0, 6.0, 16.0, 26.0, 36.0, 46.0, 56.0, 66.0, 76.0, 90.0),
    (1, 8, 16, 22, 28, 32, 34, 34, 30),
)
"""205 bins. Finer in azimuth than the Klems basis away from the normal, where floors and desks see a panel."""


def directions_within(basis: AngleBasis, count: int) -> Float64:
    """Directions (B, count, 3), z > 0, spread over each bin in proportion to projected solid angle, always the same.

    A lattice by the golden section: each of `count` equal steps of the polar coordinate holds one direction.
    """
    ring = np.repeat(np.arange(len(basis.counts)), basis.counts)
    counts = np.asarray(basis.counts)
    place = np.arange(basis.count) - np.concatenate([[0], np.cumsum(counts)])[ring]
    u = (np.arange(count) + 0.5) / count
    v = (0.5 + 0.6180339887498949 * np.arange(count)) % 1
    squares = np.sin(np.radians(basis.edges_deg)) ** 2
    sine = np.sqrt(squares[ring, None] + np.diff(squares)[ring, None] * u)
    phi = 2 * np.pi * (place[:, None] + v - 0.5) / counts[ring, None]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - sine**2)], axis=-1)


@lru_cache(maxsize=8)
def mirror_in_x(basis: AngleBasis) -> Int64:
    """By bin, the bin on the other side of the plane x = 0 (B,); every ring but a cap must have an even count."""
    if any(count % 2 for count in basis.counts if count > 1):
        raise ValueError(f"{basis.name} is not symmetric in x: a ring has an odd count")
    return basis.bin_of(basis.centres * np.array([-1.0, 1.0, 1.0]))

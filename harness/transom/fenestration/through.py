"""What a glazing product does to light from outdoors: the sun as lobes and a residual, the sky by a matrix."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis

Float64 = NDArray[np.float64]


PART_RAD = math.radians(1.5)
"""Light of one direction at most so wide counts as parallel: 0.13 m of soft edge at 5 m, narrower than
most eyes look for."""


@dataclass(frozen=True)
class Lobe:
    """Light that leaves a product almost parallel, in the product's frame (transom.bsdf.directions).

    direction: unit direction of propagation (3,), z > 0: into the room. share: of the flux incident on the product,
    0..1. width_rad: full angle of the cone that it stands for; 0 is parallel light. along: for a lobe that is longer
    than broad, such as light from a curved mirror, a vector across the direction (3,): its tip and its opposite are
    where the lobe ends [rad].
    """

    direction: Float64
    share: float
    width_rad: float = 0.0
    along: Float64 | None = None

    def parallel_parts(self, most_rad: float = PART_RAD) -> tuple[Lobe, ...]:
        """The lobe as parts beside each other along its length, none longer than `most_rad`, of equal shares; itself
        where it is short or round. Their shadows overlap as the soft edge of the lobe's."""
        length = 2 * float(np.linalg.norm(self.along)) if self.along is not None else 0.0
        count = int(np.ceil(length / most_rad - 1e-9))
        if count < 2 or self.along is None or self.direction[2] <= abs(self.along[2]):
            return (self,)
        places = (2 * np.arange(count) + 1 - count) / count
        vectors = self.direction + places[:, None] * self.along
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        share, width = self.share / count, self.width_rad / count
        return tuple(Lobe(vector, share, width) for vector in vectors)


@dataclass(frozen=True)
class SunThrough:
    """Parallel light behind a product: lobes, and everything else by exit bin. Shares of the incident flux; their sum
    is the transmittance.

    residual: (B,), by bin of the product's basis; what it holds counts as evenly spread over its bin.
    """

    lobes: tuple[Lobe, ...]
    residual: Float64

    @property
    def parallel_lobes(self) -> tuple[Lobe, ...]:
        """The lobes as parts that are near enough to parallel light."""
        return tuple(part for lobe in self.lobes for part in lobe.parallel_parts())

    @property
    def total(self) -> float:
        """Direct-hemispherical transmittance, 0..1."""
        return sum(lobe.share for lobe in self.lobes) + float(self.residual.sum())


class Fenestration(Protocol):
    """A product ready for a scene, in its own frame: directions of propagation, z from outdoors into the room."""

    @property
    def basis(self) -> AngleBasis:
        """Bins of incident and of exit directions."""
        ...

    def transmission(self) -> Float64:
        """Mean BTDF from outdoors over bins (B, B) [1/sr]: row = exit bin, column = incident bin."""
        ...

    def room_reflectance(self) -> float:
        """Hemispherical-hemispherical reflectance of the room side, 0..1."""
        ...

    def sun(self, incident: Float64) -> SunThrough:
        """Parallel light of one direction (3,), z > 0, behind the product."""
        ...

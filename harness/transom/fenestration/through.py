"""What a glazing product does to light from outdoors: the sun as lobes and a residual, the sky by a matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.directions import AngleBasis

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Lobe:
    """Light that leaves a product almost parallel, in the product's frame (transom.bsdf.directions).

    direction: unit direction of propagation (3,), z > 0: into the room. share: of the flux incident on the product,
    0..1. width_rad: full angle of the cone that it stands for; 0 is parallel light.
    """

    direction: Float64
    share: float
    width_rad: float = 0.0


@dataclass(frozen=True)
class SunThrough:
    """Parallel light behind a product: lobes, and everything else by exit bin. Shares of the incident flux; their sum
    is the transmittance.

    residual: (B,), by bin of the product's basis; what it holds counts as evenly spread over its bin.
    """

    lobes: tuple[Lobe, ...]
    residual: Float64

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

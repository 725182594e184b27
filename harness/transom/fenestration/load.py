"""Products made ready for a scene: from their sections, or from BSDF files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from transom.bsdf import read_bsdf
from transom.bsdf.bsdf import Bsdf, Path
from transom.bsdf.directions import KLEMS_FULL, AngleBasis
from transom.fenestration.choice import is_file
from transom.fenestration.through import Fenestration, SunThrough
from transom.fenestration.traced import TracedFenestration
from transom.products import load_product
from transom.scene.model import ProductChoice

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class TabulatedFenestration:
    """A product that is known by its tables alone: no lobes, everything spread over the bins of the Klems basis."""

    bsdf: Bsdf

    @property
    def basis(self) -> AngleBasis:
        return KLEMS_FULL

    @cached_property
    def _matrix(self) -> Float64:
        return self.bsdf.get(Path.transmission_front).klems(KLEMS_FULL)

    def transmission(self) -> Float64:
        return self._matrix

    def room_reflectance(self) -> float:
        weights = KLEMS_FULL.projected_solid_angles
        matrix = self.bsdf.get(Path.reflection_back).klems(KLEMS_FULL)
        return float(weights @ matrix @ weights / np.pi)

    def sun(self, incident: Float64) -> SunThrough:
        column = self._matrix[:, int(KLEMS_FULL.bin_of(incident))]
        return SunThrough((), column * KLEMS_FULL.projected_solid_angles)


@lru_cache(maxsize=32)
def load_fenestration(choice: ProductChoice) -> Fenestration:
    """The product of an opening. Raises InputError for a file or a product that cannot be used."""
    if is_file(choice.name):
        return TabulatedFenestration(read_bsdf(FilePath(choice.name)))
    product = load_product(choice.name).with_parameters(dict(choice.parameters))
    return TracedFenestration(product.section())

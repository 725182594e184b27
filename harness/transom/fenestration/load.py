"""Products made ready for a scene: from their geometry, or from BSDF files."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path as FilePath

from transom.bsdf import read_bsdf
from transom.fenestration.choice import is_file
from transom.fenestration.tabulated import TabulatedFenestration
from transom.fenestration.through import Fenestration
from transom.fenestration.traced import TracedFenestration
from transom.products import load_product
from transom.scene.model import ProductChoice


@lru_cache(maxsize=32)
def load_fenestration(choice: ProductChoice) -> Fenestration:
    """The product of an opening. Raises InputError for a file or a product that cannot be used."""
    if is_file(choice.name):
        return TabulatedFenestration(read_bsdf(FilePath(choice.name)))
    product = load_product(choice.name).with_parameters(dict(choice.parameters))
    return TracedFenestration(product.tracer())

"""Which product an opening holds: a name or a BSDF file, parameters, and a digest of what its light depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from transom.errors import InputError
from transom.products import load_product
from transom.scene.model import ProductChoice

FORMAT = 1
"""Raised when the same product would be turned into other light."""

FILE_ENDINGS = (".xml", ".txt", ".dat")


def choose_product(
    name: str, parameters: Mapping[str, float] | None = None, folder: Path | None = None
) -> ProductChoice:
    """The product of that name (transom list products), or of that BSDF file, relative to `folder`.

    parameters: other numbers than the product's own. Raises InputError for an unknown product, file or parameter.
    """
    parameters = dict(sorted((parameters or {}).items()))
    if is_file(name):
        file = (folder or Path()) / name
        if parameters:
            remedy = "Remove them: a file holds one product as it was measured"
            raise InputError("has no parameters", field="product", value=name, remedy=remedy)
        if not file.is_file():
            raise InputError("does not exist", file=file, field="product", value=name)
        return ProductChoice(str(file), (), _digest({"file": hashlib.sha256(file.read_bytes()).hexdigest()}))
    product = load_product(name).with_parameters(parameters)
    product.section()
    digest = _digest({"shape": product.record.shape, "parameters": product.record.parameters})
    return ProductChoice(name, tuple(parameters.items()), digest)


def is_file(name: str) -> bool:
    """Whether a product is named by its file, not by its folder."""
    return name.lower().endswith(FILE_ENDINGS)


def _digest(content: Mapping[str, object]) -> str:
    return hashlib.sha256(json.dumps({"format": FORMAT, **content}, sort_keys=True).encode()).hexdigest()

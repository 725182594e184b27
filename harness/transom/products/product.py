"""Products as data: btdf_measurements/NAME/product.toml. Its form is in btdf_measurements/README.md."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from transom.errors import InputError, invalid_field
from transom.products.section import Section
from transom.products.shapes import SHAPES

PRODUCT_ROOT = Path(__file__).resolve().parents[3] / "btdf_measurements"


class ProductFile(BaseModel):
    """product.toml. shape: which builder of transom.products.shapes; parameters: its numbers, SI units and degrees.

    status: "generic" (dimensions that define the product), or "look-alike" (the maker's dimensions are not public).
    uncertainty: what is not known of the product, in words and numbers.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[1]
    title: str = Field(min_length=1)
    description: str = Field(min_length=1)
    shape: str
    status: Literal["generic", "look-alike"]
    provenance: str = Field(min_length=1)
    uncertainty: str = Field(min_length=1)
    licence: str = Field(min_length=1)
    parameters: dict[str, float | int] = Field(default_factory=dict)


@dataclass(frozen=True)
class Product:
    """A product ready to be measured."""

    name: str
    file: Path
    record: ProductFile

    @property
    def title(self) -> str:
        return self.record.title

    def section(self) -> Section:
        """Its section. Raises InputError for parameters that the shape cannot have."""
        try:
            return SHAPES[self.record.shape].build(**self.record.parameters)
        except ValueError as error:
            raise InputError(f"cannot be built: {error}", file=self.file, field="parameters") from None

    def with_parameters(self, changes: dict[str, float]) -> Product:
        """The product with other numbers. Raises InputError for one that its shape does not have."""
        known = SHAPES[self.record.shape].parameters()
        for name, value in changes.items():
            if name not in known:
                raise InputError(
                    f"is not a parameter of {self.name}",
                    field=name,
                    value=value,
                    remedy=f"Choose from {', '.join(known)}",
                )
        record = self.record.model_copy(update={"parameters": {**self.record.parameters, **changes}})
        return replace(self, record=record)


def list_products() -> list[str]:
    """Names of the products, alphabetically."""
    return sorted(path.parent.name for path in PRODUCT_ROOT.glob("*/product.toml"))


def load_product(name: str) -> Product:
    """A product by name, or by the path of its folder. Raises InputError for a malformed product."""
    folder = Path(name) if "/" in name else PRODUCT_ROOT / name
    file = folder / "product.toml"
    if not file.is_file():
        raise InputError(
            "is not a product", field="PRODUCT", value=name, remedy=f"Choose from {', '.join(list_products())}"
        )
    try:
        content: dict[str, Any] = tomllib.loads(file.read_text(encoding="utf-8"))
        record = ProductFile.model_validate(content)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not TOML ({error})", file=file) from error
    except ValidationError as error:
        raise invalid_field(error, file) from error
    if record.shape not in SHAPES:
        raise InputError(
            "is not known", file=file, field="shape", value=record.shape, remedy=f"Use {', '.join(SHAPES)}"
        )
    product = Product(folder.name, file, record)
    return product.with_parameters({key: float(value) for key, value in record.parameters.items()})

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
from transom.products.unit_cell import CellSurface, UnitCell, cell_from_mesh

PRODUCT_ROOT = Path(__file__).resolve().parents[3] / "btdf_measurements"


class MediumFile(BaseModel):
    """A medium of a mesh. absorption [1/m]."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    index: float | int = Field(ge=1)
    absorption: float | int = Field(default=0.0, ge=0)


class SurfaceFile(BaseModel):
    """A surface of a mesh, by the name that the mesh has as material. front, back: names of media, or "air"."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    kind: Literal["interface", "gap", "mirror", "diffuse"] = "interface"
    front: str = "air"
    back: str = "air"
    reflectance: float | int = Field(default=0.0, ge=0, le=1)
    reflectance_back: float | int = Field(default=0.0, ge=0, le=1)
    transmittance: float | int = Field(default=0.0, ge=0, le=1)
    openness: float | int = Field(default=0.0, ge=0, le=1)


class CellFile(BaseModel):
    """The [cell] table: a mesh in metres beside product.toml, and what repeats it."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    mesh: str
    period_x: float = Field(gt=0)
    period_y: float = Field(gt=0)
    media: dict[str, MediumFile] = Field(default_factory=dict)
    surfaces: dict[str, SurfaceFile] = Field(min_length=1)


class ProductFile(BaseModel):
    """product.toml. shape: which builder of transom.products.shapes; parameters: its numbers, SI units and degrees;
    or cell: a mesh.

    status: "generic" (its numbers define it), "published" (the maker's published dimensions), or "look-alike" (the
    maker's dimensions are not public).
    uncertainty: what is not known of the product, in words and numbers. conventions: which side is which.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[1]
    title: str = Field(min_length=1)
    description: str = Field(min_length=1)
    shape: str = ""
    status: Literal["generic", "published", "look-alike"]
    provenance: str = Field(min_length=1)
    conventions: str = Field(min_length=1)
    uncertainty: str = Field(min_length=1)
    licence: str = Field(min_length=1)
    parameters: dict[str, float | int] = Field(default_factory=dict)
    cell: CellFile | None = None


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
        """Its section. Raises InputError for parameters that the shape cannot have, and for a product that has none."""
        built = self.tracer()
        if isinstance(built, Section):
            return built
        raise InputError(
            "has no section: it repeats along two axes",
            file=self.file,
            field="shape" if self.record.shape else "cell",
            remedy="Trace its unit cell (Product.tracer), or measure it and use the table",
        )

    def tracer(self) -> Section | UnitCell:
        """What light is traced through. Raises InputError for parameters or a mesh that cannot be."""
        if self.record.cell is not None:
            return self._cell(self.record.cell)
        try:
            return SHAPES[self.record.shape].build(**self.record.parameters)
        except ValueError as error:
            raise InputError(f"cannot be built: {error}", file=self.file, field="parameters") from None

    def _cell(self, cell: CellFile) -> UnitCell:
        media = {"air": (1.0, 0.0)} | {n: (float(m.index), float(m.absorption)) for n, m in cell.media.items()}
        names = list(media)
        surfaces: dict[str, CellSurface] = {}
        for name, s in cell.surfaces.items():
            for side in (s.front, s.back):
                if side not in names:
                    field, remedy = f"cell.surfaces.{name}", f"Choose from {', '.join(names)}"
                    raise InputError("names no medium", file=self.file, field=field, value=side, remedy=remedy)
            surfaces[name] = CellSurface(
                s.kind,
                names.index(s.front),
                names.index(s.back),
                float(s.reflectance),
                float(s.reflectance_back),
                float(s.transmittance),
                float(s.openness),
            )
        mesh = self.file.parent / cell.mesh
        if not mesh.is_file():
            raise InputError("does not exist", file=self.file, field="cell.mesh", value=cell.mesh)
        return cell_from_mesh(mesh, cell.period_x, cell.period_y, tuple(media.values()), surfaces)

    def with_parameters(self, changes: dict[str, float]) -> Product:
        """The product with other numbers. Raises InputError for one that its shape does not have."""
        known = SHAPES[self.record.shape].parameters() if self.record.shape else []
        for name, value in changes.items():
            if name not in known:
                raise InputError(
                    f"is not a parameter of {self.name}",
                    field=name,
                    value=value,
                    remedy=f"Choose from {', '.join(known)}" if known else "Its mesh fixes all of its dimensions",
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
    if bool(record.shape) == (record.cell is not None):
        raise InputError("is given together with [cell], or neither is", file=file, field="shape", value=record.shape)
    if record.shape and record.shape not in SHAPES:
        raise InputError(
            "is not known", file=file, field="shape", value=record.shape, remedy=f"Use {', '.join(SHAPES)}"
        )
    product = Product(folder.name, file, record)
    return product.with_parameters({key: float(value) for key, value in record.parameters.items()})

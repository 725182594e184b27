"""LBNL WINDOW's XML files of optical products: Klems matrices and tensor trees, read; Klems matrices, written.

Values are in 1/sr. "Front" is outdoors. With IncidentDataStructure Columns a column of the matrix is an incident bin.
[LBNL WINDOW's BSDF-v1.4 schema; conventions checked against Radiance's reader, src/common/bsdf_m.c and bsdf_t.c]
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path as FilePath
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from transom.bsdf.bsdf import Bsdf, KlemsMatrix, Path, Scattering, Spectrum
from transom.bsdf.directions import KLEMS_FULL
from transom.bsdf.tensor_tree import TreeError, parse_tree
from transom.errors import InputError
from transom.files import write_atomic

Element = ET.Element
TREE_RANKS = {"tensortree3": 3, "tensortree4": 4}
LENGTH_UNITS = {"meter": 1.0, "metre": 1.0, "m": 1.0, "millimeter": 1e-3, "mm": 1e-3, "inch": 0.0254, "foot": 0.3048}
ROUNDING = 1e-6
"""Negative values down to this share of the largest are rounding, and become 0."""


def read_window_xml(file: FilePath) -> Bsdf:
    """A product from its XML file. Raises InputError naming the field and what is wrong with it."""
    root = _parsed(file)
    layer = _one(root, "Optical/Layer", file)
    material = layer.find("Material")
    name = _text(material, "Name") or file.stem
    structure = _text(_one(layer, "DataDefinition", file), "IncidentDataStructure")
    _check_basis(layer, file)
    scattering: dict[tuple[Spectrum, Path], Scattering] = {}
    notes: list[str] = []
    for number, wavelength in enumerate(layer.findall("WavelengthData")):
        place = f"WavelengthData[{number}]"
        spectrum = _spectrum(wavelength, place, file, notes)
        if spectrum is None:
            continue
        for block in wavelength.findall("WavelengthDataBlock"):
            path = _path(block, place, file)
            if (spectrum, path) in scattering:
                raise InputError("is there twice", file=file, field=place, value=f"{spectrum} {path}")
            scattering[spectrum, path] = _block(block, structure, f"{place} {path}", file, notes)
    if not scattering:
        raise InputError("holds no visible or solar scattering data", file=file, field="WavelengthData")
    return Bsdf(
        name=name,
        manufacturer=_text(material, "Manufacturer"),
        source=str(file),
        scattering=scattering,
        thickness_m=_length(material, "Thickness", file),
        notes=tuple(dict.fromkeys(notes)),
    )


def write_klems_xml(file: FilePath, product: Bsdf) -> None:
    """Writes all of a product's functions on the Klems full basis, whatever form they had. Replaces the file whole."""
    spectra = {spectrum for spectrum, _ in product.scattering}
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<WindowElement xmlns="http://windows.lbl.gov" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="http://windows.lbl.gov/BSDF-v1.4.xsd">',
        "<WindowElementType>System</WindowElementType>",
        "<FileType>BSDF</FileType>",
        "<Optical>",
        "<Layer>",
        f"<Material><Name>{escape(product.name)}</Name><Manufacturer>{escape(product.manufacturer)}</Manufacturer>"
        f'<Thickness unit="Meter">{product.thickness_m:.6g}</Thickness><DeviceType>Other</DeviceType></Material>',
        "<DataDefinition><IncidentDataStructure>Columns</IncidentDataStructure>",
        "<AngleBasis>",
        f"<AngleBasisName>{KLEMS_FULL.name}</AngleBasisName>",
        *_basis_blocks(),
        "</AngleBasis></DataDefinition>",
    ]
    for spectrum in sorted(spectra, reverse=True):
        for path in Path:
            if (spectrum, path) in product.scattering:
                parts += _data_block(spectrum, path, product.scattering[spectrum, path].klems(KLEMS_FULL))
    parts += ["</Layer>", "</Optical>", "</WindowElement>", ""]
    write_atomic(file, "\n".join(parts))


def _basis_blocks() -> Iterable[str]:
    for low, high, count in zip(KLEMS_FULL.edges_deg[:-1], KLEMS_FULL.edges_deg[1:], KLEMS_FULL.counts, strict=True):
        middle = 0.0 if count == 1 else (low + high) / 2
        yield (
            f"<AngleBasisBlock><Theta>{middle:g}</Theta><nPhis>{count}</nPhis><ThetaBounds><LowerTheta>{low:g}"
            f"</LowerTheta><UpperTheta>{high:g}</UpperTheta></ThetaBounds></AngleBasisBlock>"
        )


def _data_block(spectrum: Spectrum, path: Path, values: NDArray[np.float64]) -> list[str]:
    rows = [",\t".join(f"{value:.7e}" for value in row) + "," for row in values]
    return [
        "<WavelengthData><LayerNumber>System</LayerNumber>",
        f'<Wavelength unit="Integral">{spectrum}</Wavelength>',
        "<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>",
        "<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>",
        f"<WavelengthDataBlock><WavelengthDataDirection>{path}</WavelengthDataDirection>",
        f"<ColumnAngleBasis>{KLEMS_FULL.name}</ColumnAngleBasis><RowAngleBasis>{KLEMS_FULL.name}</RowAngleBasis>",
        "<ScatteringDataType>BTDF</ScatteringDataType>",
        "<ScatteringData>",
        *rows,
        "</ScatteringData></WavelengthDataBlock></WavelengthData>",
    ]


def _parsed(file: FilePath) -> Element:
    try:
        root = ET.parse(file).getroot()
    except (ET.ParseError, LookupError, ValueError) as error:  # the last two: an encoding that does not exist
        raise InputError(f"is not XML ({error})", file=file) from None
    for element in root.iter():  # names without their namespace
        if isinstance(element.tag, str):
            element.tag = element.tag.rsplit("}", 1)[-1]
    if root.tag != "WindowElement":
        raise InputError("is not a WindowElement file", file=file, field="root element", value=root.tag)
    return root


def _one(parent: Element, path: str, file: FilePath) -> Element:
    found = parent.findall(path)
    if len(found) != 1:
        remedy = "A file describes one layer" if found else None
        raise InputError(f"is there {len(found)} times, not once", file=file, field=path, remedy=remedy)
    return found[0]


def _text(parent: Element | None, name: str) -> str:
    child = parent.find(name) if parent is not None else None
    return (child.text or "").strip() if child is not None else ""


def _length(material: Element | None, name: str, file: FilePath) -> float:
    """A length [m]; 0 where none is given."""
    child = material.find(name) if material is not None else None
    text = (child.text or "").strip() if child is not None else ""
    if child is None or not text:
        return 0.0
    unit = child.get("unit", "meter").lower()
    if unit not in LENGTH_UNITS:
        raise InputError("is not a known unit", file=file, field=f"{name}.unit", value=unit, remedy="Use meter")
    try:
        return float(text) * LENGTH_UNITS[unit]
    except ValueError:
        raise InputError("is not a number", file=file, field=name, value=text) from None


def _spectrum(wavelength: Element, place: str, file: FilePath, notes: list[str]) -> Spectrum | None:
    text = _text(wavelength, "Wavelength")
    for spectrum in Spectrum:
        if text.lower() == spectrum.lower():
            return spectrum
    if not text:
        raise InputError("is missing", file=file, field=f"{place}.Wavelength")
    notes.append(f"data for {text!r} were left out: only Visible and Solar are read")
    return None


def _path(block: Element, place: str, file: FilePath) -> Path:
    text = " ".join(_text(block, "WavelengthDataDirection").split())
    for path in Path:
        if text.lower() == path.lower():
            return path
    remedy = f"Choose from {', '.join(Path)}"
    raise InputError(
        "is not a direction", file=file, field=f"{place}.WavelengthDataDirection", value=text, remedy=remedy
    )


def _check_basis(layer: Element, file: FilePath) -> None:
    """A file that spells out the Klems basis must mean the Klems basis."""
    for basis in layer.findall("DataDefinition/AngleBasis"):
        name = _text(basis, "AngleBasisName")
        _require_klems(name, "AngleBasisName", file)
        blocks = basis.findall("AngleBasisBlock")
        if not blocks:
            continue
        bounds = [block.find("ThetaBounds") for block in blocks]
        if None in bounds:
            remedy = "Each block has ThetaBounds with LowerTheta and UpperTheta"
            field = f"AngleBasisBlock[{bounds.index(None)}]"
            raise InputError("has no ThetaBounds", file=file, field=field, remedy=remedy)
        try:
            counts = tuple(int(_text(block, "nPhis")) for block in blocks)
            edges = (float(_text(bounds[0], "LowerTheta")), *(float(_text(bound, "UpperTheta")) for bound in bounds))
        except ValueError as error:
            raise InputError(f"is not a number ({error})", file=file, field="AngleBasisBlock") from None
        same = counts == KLEMS_FULL.counts and len(edges) == len(KLEMS_FULL.edges_deg)
        if not same or not np.allclose(edges, KLEMS_FULL.edges_deg, atol=1e-3):
            remedy = f"It has limits {KLEMS_FULL.edges_deg} with {KLEMS_FULL.counts} azimuths"
            value = f"limits {edges} with {counts} azimuths"
            raise InputError(f"is named {name} but is not", file=file, field="AngleBasis", value=value, remedy=remedy)


def _require_klems(name: str, field: str, file: FilePath) -> None:
    if " ".join(name.split()).lower() != KLEMS_FULL.name.lower():
        remedy = f"Only {KLEMS_FULL.name} and tensor trees are read: export the product on that basis"
        raise InputError("is an angle basis that is not supported", file=file, field=field, value=name, remedy=remedy)


def _block(block: Element, structure: str, place: str, file: FilePath, notes: list[str]) -> Scattering:
    kind = structure.lower()
    data = _text(block, "ScatteringData")
    if kind in TREE_RANKS:
        basis = _text(block, "AngleBasis")
        if basis.lower() != "lbnl/shirley-chiu":
            remedy = "Trees are read on LBNL/Shirley-Chiu"
            raise InputError("is not supported", file=file, field=f"{place}.AngleBasis", value=basis, remedy=remedy)
        try:
            tree = parse_tree(data, TREE_RANKS[kind])
        except TreeError as error:
            raise InputError(f"is malformed: {error}", file=file, field=f"{place}.ScatteringData") from None
        _checked_values(tree.values, place, file, notes)
        np.maximum(tree.values, 0.0, out=tree.values)
        return tree
    if kind not in ("columns", "rows"):
        remedy = "Columns, Rows, TensorTree3 and TensorTree4 are read"
        raise InputError(
            "is not supported", file=file, field="IncidentDataStructure", value=structure or "nothing", remedy=remedy
        )
    for field in ("ColumnAngleBasis", "RowAngleBasis"):
        _require_klems(_text(block, field), f"{place}.{field}", file)
    words = data.replace(",", " ").split()
    try:
        numbers = np.array(words, np.float64)
    except ValueError as error:
        raise InputError(f"holds what is not a number ({error})", file=file, field=f"{place}.ScatteringData") from None
    count = KLEMS_FULL.count
    if numbers.size != count * count:
        value = f"{numbers.size} values"
        remedy = f"{KLEMS_FULL.name} has {count} x {count} = {count * count}"
        raise InputError("is incomplete", file=file, field=f"{place}.ScatteringData", value=value, remedy=remedy)
    _checked_values(numbers, place, file, notes)
    matrix = np.maximum(numbers, 0.0).reshape(count, count)
    return KlemsMatrix(KLEMS_FULL, matrix if kind == "columns" else np.ascontiguousarray(matrix.T))


def _checked_values(values: NDArray[np.float64], place: str, file: FilePath, notes: list[str]) -> None:
    """Refuses what is not finite, and what is below 0 by more than rounding."""
    if not np.isfinite(values).all():
        bad = int((~np.isfinite(values)).sum())
        raise InputError("holds values that are not finite", file=file, field=f"{place}.ScatteringData", value=bad)
    least, largest = float(values.min()), float(values.max())
    if least < -ROUNDING * max(largest, math.ulp(1.0)):
        remedy = "A BSDF is never negative: the data were changed or are not a BSDF"
        raise InputError(
            "holds negative values", file=file, field=f"{place}.ScatteringData", value=f"{least:g}", remedy=remedy
        )
    if least < 0:
        notes.append(f"{place}: {int((values < 0).sum())} values below 0 by rounding were set to 0")

"""Picture files: radiance as OpenEXR with named layers, and PNG on a fixed, printed scale.

Layers of an EXR (all linear Rec. 709, Y in cd/m²): `R G B` the picture itself; `half_1.R` ... `half_2.B` two
independent estimates whose average it is; `standard_error.Y`; and any component by name, such as `sun.R`. A channel is
stored in half floats (relative rounding 0.05 % at most) unless one of its values does not fit.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from transom.errors import InputError
from transom.files import write_atomic
from transom.renderer import ImageResult

Float32 = NDArray[np.float32]
UInt8 = NDArray[np.uint8]

HALF_MAX = 65504.0
"""Largest finite half float (IEEE 754 binary16)."""

HALF_LAYERS = ("half_1", "half_2")
ERROR_LAYER = "standard_error"


def write_exr(path: Path, result: ImageResult, half: bool = True) -> None:
    """Writes a picture with its halves, standard error and components. `half`: half floats where they fit."""
    layers: dict[str, Float32] = {"": result.mean}
    if result.halves is not None:
        layers.update(zip(HALF_LAYERS, result.halves, strict=True))
    layers.update(result.components)
    channels: dict[str, NDArray[np.float16] | Float32] = {}
    for layer, rgb in layers.items():
        for index, colour in enumerate("RGB"):
            channels[f"{layer}.{colour}" if layer else colour] = _stored(rgb[:, :, index], half)
    if result.standard_error is not None:
        channels[f"{ERROR_LAYER}.Y"] = _stored(result.standard_error, half)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    stream = io.BytesIO()
    OpenEXR.File(header, channels).write(stream)
    write_atomic(path, stream.getvalue())


def read_exr(path: Path) -> ImageResult:
    """Reads what `write_exr` wrote. Raises InputError for a file that is missing, cut short, or not such a picture."""
    if not path.is_file():
        raise InputError("does not exist", file=path)
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            pixels = {name: np.array(channel.pixels, np.float32) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError, TypeError) as error:
        raise InputError(f"is not a whole EXR picture ({error})", file=path, remedy="Render it again") from error
    if not {"R", "G", "B"} <= pixels.keys():
        raise InputError("holds no R, G and B channel", file=path, remedy="Render it again")
    if not all(np.isfinite(values).all() for values in pixels.values()):
        raise InputError("holds values that are not finite", file=path, remedy="Render it again")
    names = {name.rpartition(".")[0] for name in pixels if name.endswith(".R")}
    layers = {name: _stack(pixels, name) for name in sorted(names)}
    halves = (layers.pop(HALF_LAYERS[0]), layers.pop(HALF_LAYERS[1])) if names.issuperset(HALF_LAYERS) else None
    return ImageResult(_stack(pixels, ""), halves, pixels.get(f"{ERROR_LAYER}.Y"), layers)


def tone_mapped(rgb: NDArray[np.floating], white_cd_m2: float) -> UInt8:
    """Linear from 0 to `white_cd_m2`, clipped, then the sRGB curve of IEC 61966-2-1. (h, w, 3) -> 8 bits.

    The scale is fixed by the view (its display white), never by the picture, so that two pictures can be compared.
    """
    linear = np.clip(np.asarray(rgb, np.float64) / white_cd_m2, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255 * encoded).astype(np.uint8)


def png_bytes(pixels: UInt8, text: Mapping[str, str] | None = None) -> bytes:
    """An 8-bit picture (h, w, 3) or (h, w) as a PNG file. `text`: notes stored in it, such as its scale."""
    from PIL.PngImagePlugin import PngInfo

    notes = PngInfo()
    for name, value in (text or {}).items():
        notes.add_text(name, value)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", optimize=True, pnginfo=notes)
    return stream.getvalue()


def write_picture(path: Path, result: ImageResult, white_cd_m2: float) -> None:
    """Writes .exr (floats, all layers) or .png (tone mapped with `white_cd_m2`), by the file's ending."""
    ending = path.suffix.lower()
    if ending == ".exr":
        write_exr(path, result, half=False)
    elif ending == ".png":
        note = f"linear to {white_cd_m2:g} cd/m2 = white, then sRGB"
        write_atomic(path, png_bytes(tone_mapped(result.mean, white_cd_m2), {"Scale": note}))
    else:
        raise InputError("is not a picture format", field="-o", value=str(path), remedy="End it in .exr or .png")


def _stored(values: Float32, half: bool) -> NDArray[np.float16] | Float32:
    plain = np.ascontiguousarray(values, np.float32)
    return plain.astype(np.float16) if half and float(np.abs(plain).max(initial=0.0)) <= HALF_MAX else plain


def _stack(pixels: Mapping[str, Float32], layer: str) -> Float32:
    names = [f"{layer}.{colour}" if layer else colour for colour in "RGB"]
    return np.stack([pixels[name] for name in names], axis=2)

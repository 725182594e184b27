"""The data of the page's image viewer: luminance, illuminance and noise of every pixel, small enough to be in the page.

Luminance is kept as 16-bit logarithms (steps of 0.03 %), illuminance as its ratio to luminance in the same code, noise
as 8 bits of 0.1 %. Each array is split into its high and low bytes, deflated, and written in base64.
"""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.figures import (
    DIFFERENCE_SCALE,
    ILLUMINANCE_SCALE,
    NO_VALUE_GREY,
    NOISE_SCALE,
    Scale,
    illuminance_image,
    luminance_scale,
    palette,
)
from transom.report.pictures import (
    CasePictures,
    Picture,
    difference_and_noise,
    false_coloured,
    toned_picture,
    white_words,
)
from transom.report.table import runs
from transom.scene.model import View
from transom.suite import SuiteCase
from transom.visible import first_surfaces

NO_VALUE, ZERO, FIRST_CODE = 0, 1, 2
LAST_CODE = 65535
LOWEST_OCTAVE, OCTAVES = -12.0, 36.0
"""Codes from FIRST_CODE to LAST_CODE are 2^-12 to 2^24, in equal steps of the logarithm."""

NOISE_STEP_PERCENT = 0.1
NO_NOISE_VALUE = 255


@dataclass(frozen=True)
class Viewer:
    """One view in one condition, to be looked into.

    pictures: ours, the reference's, their difference, and the noise; the first three are shown where no script runs,
    all are printed in the PDF. data: what the script decodes, JSON.
    """

    anchor: str
    title: str
    condition: str
    source: str
    pictures: list[Picture]
    data: str
    white_cd_m2: float
    luminance_scale: Scale


def make_viewer(anchor: str, title: str, condition: str, entry: SuiteCase, view: View, found: CasePictures) -> Viewer:
    """The viewer of a view that both have rendered. Raises ValueError without one of the two pictures."""
    if found.volumes is None or found.reference is None:
        raise ValueError("a viewer compares two pictures")
    ours, reference = found.volumes.image(), found.reference.image()
    surfaces = first_surfaces(entry.scene, view)
    difference, noise, floor = difference_and_noise(ours, reference, surfaces)
    source = runs(found.volumes.record.key, found.reference.record.key)
    scale = luminance_scale(view.display_white_cd_m2)
    material = entry.scene.mesh.face_material[np.maximum(surfaces.face, 0)]
    seen = np.where(surfaces.face >= 0, material + 1, 0)
    data: dict[str, Any] = {
        "width": int(seen.shape[1]),
        "height": int(seen.shape[0]),
        "floor": floor,
        "noise": _packed(_noise_codes(noise)),
        "surface": _packed(seen.astype(np.uint16)),
        "surfaces": ["sky or ground", *(item.name for item in entry.scene.materials)],
        "luminanceScale": scale_record(scale),
    }
    for name, image in (("ours", ours), ("reference", reference)):
        values = np.asarray(luminance(image.mean), np.float64)
        lux = illuminance_image(image.mean, entry.scene, surfaces)
        ratio = np.divide(lux, values, out=np.full_like(lux, np.nan), where=values > 0)
        data[name] = {"luminance": _packed(log_codes(values)), "lux": _packed(log_codes(ratio))}
    pictures = [
        toned_picture(f"Transom, shadow volumes ({white_words(view)})", found.volumes, view),
        toned_picture(f"Mitsuba 3 ({white_words(view)})", found.reference, view),
        false_coloured("Transom minus Mitsuba 3, relative to Mitsuba 3", difference, DIFFERENCE_SCALE, source),
        false_coloured("Noise of the Mitsuba 3 picture", noise, NOISE_SCALE, runs(found.reference.record.key)),
    ]
    text = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    return Viewer(anchor, title, condition, source, pictures, text, view.display_white_cd_m2, scale)


def shared_scales() -> str:
    """Scales that all viewers share, JSON for the page's script."""
    scales = {"difference": DIFFERENCE_SCALE, "noise": NOISE_SCALE, "illuminance": ILLUMINANCE_SCALE}
    record: dict[str, Any] = {name: scale_record(scale) for name, scale in scales.items()}
    record["codes"] = {"lowestOctave": LOWEST_OCTAVE, "octaves": OCTAVES, "first": FIRST_CODE, "last": LAST_CODE}
    record["noiseStep"], record["noValueGrey"] = NOISE_STEP_PERCENT, NO_VALUE_GREY
    return json.dumps(record, separators=(",", ":"))


def scale_record(scale: Scale) -> dict[str, Any]:
    """A scale as the page's script needs it."""
    colours = base64.b64encode(palette(scale).tobytes()).decode()
    return {"kind": scale.kind, "low": scale.low, "high": scale.high, "unit": scale.unit, "colours": colours}


def log_codes(values: NDArray[np.floating]) -> NDArray[np.uint16]:
    """Non-negative values as 16-bit logarithms; NO_VALUE for NaN, ZERO for 0."""
    plain = np.asarray(values, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (np.log2(np.where(plain > 0, plain, np.nan)) - LOWEST_OCTAVE) / OCTAVES
    steps = LAST_CODE - FIRST_CODE
    codes = FIRST_CODE + np.round(np.clip(np.nan_to_num(share), 0, 1) * steps)
    return np.where(np.isnan(plain), NO_VALUE, np.where(plain > 0, codes, ZERO)).astype(np.uint16)


def log_values(codes: NDArray[np.uint16]) -> NDArray[np.float64]:
    """The values of codes: the inverse of log_codes, to half a step."""
    share = (codes.astype(np.float64) - FIRST_CODE) / (LAST_CODE - FIRST_CODE)
    values = 2.0 ** (LOWEST_OCTAVE + OCTAVES * share)
    return np.where(codes == NO_VALUE, np.nan, np.where(codes == ZERO, 0.0, values))


def _noise_codes(noise: NDArray[np.float64]) -> NDArray[np.uint16]:
    steps = np.round(np.nan_to_num(noise) / NOISE_STEP_PERCENT)
    return np.where(np.isnan(noise), NO_NOISE_VALUE, np.clip(steps, 0, NO_NOISE_VALUE - 1)).astype(np.uint16)


def _packed(codes: NDArray[np.uint16]) -> str:
    """High bytes, then low bytes, deflated (RFC 1950), base64."""
    flat = codes.ravel()
    planes = np.concatenate([(flat >> 8).astype(np.uint8), (flat & 255).astype(np.uint8)])
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode()

"""The report's pictures: each as a data URI, with a caption that says what it shows, its scale and its runs."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from transom.bundle import Bundle, find_bundle, make_case
from transom.colour import luminance
from transom.compare import signed_relative_error
from transom.errors import InputError
from transom.figures import Scale, false_colour_png
from transom.images import tone_mapped
from transom.noise import floor_cd_m2
from transom.renderer import ImageResult, load_renderer
from transom.report.numbers import fixed
from transom.report.table import runs
from transom.scene.model import View
from transom.suite import SuiteCase
from transom.visible import FirstSurfaces


@dataclass(frozen=True)
class Picture:
    """One picture. scale: the name of the printed scale below it, "" for one that its section prints once.
    source: the runs that it was made from. content: the file, WebP.

    Raises InputError for a picture that does not say where it is from.
    """

    caption: str
    content: bytes
    width: int
    height: int
    source: str
    scale: str = ""

    def __post_init__(self) -> None:
        require_source(self.caption, self.source)

    @property
    def uri(self) -> str:
        return "data:image/webp;base64," + base64.b64encode(self.content).decode()


@dataclass(frozen=True)
class Drawing:
    """A figure as SVG, with the same rule. description: what a reader who cannot see it is told."""

    svg: str
    caption: str
    description: str
    source: str

    def __post_init__(self) -> None:
        require_source(self.caption, self.source)


def require_source(figure: str, source: str) -> None:
    """Raises InputError for a figure without provenance: the report is not built with one."""
    if not source:
        raise InputError("is a figure without provenance", field=figure, remedy="Name the runs that it was made from")


@dataclass(frozen=True)
class CasePictures:
    """What there is of one view in one condition: ours by each visibility method, and the reference's."""

    volumes: Bundle | None
    rays: Bundle | None
    reference: Bundle | None


def find_pictures(entry: SuiteCase, view: View) -> CasePictures:
    """The bundles of a view, from the stores."""
    engine, mitsuba = load_renderer("engine"), load_renderer("mitsuba")

    def ours(visibility: str) -> Bundle | None:
        return find_bundle(make_case(entry.scene, entry.condition, engine, {"visibility": visibility}, view=view))

    reference = find_bundle(make_case(entry.scene, entry.condition, mitsuba, {}, view=view))
    return CasePictures(ours("volumes"), ours("rays"), reference)


def factoring_pictures(view: View, found: CasePictures) -> list[Picture]:
    """The paper's Figure 5: everything but direct sun, direct sun, and their sum, by volumes and by rays."""
    if found.volumes is None or found.rays is None:
        return []
    parts = []
    for bundle, what in ((found.volumes, "shadow volumes"), (found.rays, "shadow rays")):
        image = bundle.image()
        sun = image.components["sun"]
        named = (("Sky and interreflected light", image.mean - sun), (f"Direct sun, {what}", sun))
        for caption, rgb in (*named, (f"Sum, {what}", image.mean)):
            parts.append(toned(caption, rgb, view, bundle, lossless=False))
    return parts


def toned_picture(caption: str, bundle: Bundle, view: View) -> Picture:
    """One picture on its view's fixed scale, without loss."""
    return toned(caption, bundle.image().mean, view, bundle)


def illustration(caption: str, bundle: Bundle, view: View) -> Picture:
    """The same, smaller: to be looked at, not into."""
    return toned(caption, bundle.image().mean, view, bundle, lossless=False)


def white_words(view: View) -> str:
    return f"linear, white = {fixed(view.display_white_cd_m2, 0)} cd/m²"


def difference_and_noise(
    ours: ImageResult, reference: ImageResult, surfaces: FirstSurfaces
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Signed relative difference and the reference's relative standard error (h, w) [%], NaN outside the interior; and
    the floor [cd/m²] that both divide by."""
    truth = np.asarray(luminance(reference.mean), np.float64)
    inside = surfaces.interior
    floor = floor_cd_m2(truth[inside]) if inside.any() else 0.0
    difference = 100 * signed_relative_error(np.asarray(luminance(ours.mean), np.float64), truth, floor)
    error = np.zeros_like(truth) if reference.standard_error is None else reference.standard_error
    noise = 100 * np.divide(error, truth + floor, out=np.zeros_like(truth), where=truth + floor > 0)
    return np.where(inside, difference, np.nan), np.where(inside, noise, np.nan), floor


def toned(caption: str, rgb: NDArray[np.floating], view: View, bundle: Bundle, *, lossless: bool = True) -> Picture:
    """Radiance on the view's fixed scale."""
    pixels = tone_mapped(rgb, view.display_white_cd_m2)
    height, width = pixels.shape[:2]
    return Picture(caption, webp_bytes(pixels, lossless), width, height, runs(bundle.record.key))


def false_coloured(caption: str, values: NDArray[np.floating], scale: Scale, source: str) -> Picture:
    """Values on a printed scale."""
    height, width = values.shape
    pixels = np.asarray(Image.open(io.BytesIO(false_colour_png(values, scale))).convert("RGB"))
    return Picture(caption, webp_bytes(pixels, lossless=True), width, height, source, scale.quantity)


def webp_bytes(pixels: NDArray[np.uint8], lossless: bool) -> bytes:
    """An 8-bit picture (h, w, 3) as WebP."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", lossless=lossless, quality=90, method=5)
    return stream.getvalue()

"""The report's pictures: each as a data URI, with a caption that says what it shows and on which scale."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from transom.bundle import Bundle, find_bundle, make_case
from transom.colour import luminance
from transom.compare import signed_relative_error
from transom.figures import (
    DIFFERENCE_SCALE,
    ILLUMINANCE_SCALE,
    LUMINANCE_SCALE,
    NOISE_SCALE,
    false_colour_png,
    illuminance_image,
)
from transom.images import png_bytes, tone_mapped
from transom.noise import floor_cd_m2
from transom.renderer import ImageResult, load_renderer
from transom.report.numbers import fixed
from transom.scene.model import View
from transom.suite import SuiteCase
from transom.visible import FirstSurfaces, first_surfaces


@dataclass(frozen=True)
class Picture:
    """One picture. scale: "" for a toned picture, else the name of the printed scale below it. source: run bundle."""

    caption: str
    uri: str
    width: int
    height: int
    scale: str = ""
    source: str = ""


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


def comparison_pictures(entry: SuiteCase, view: View, found: CasePictures) -> list[Picture]:
    """Ours, the reference's, their signed difference; both in false colour, luminance and illuminance; the noise."""
    if found.volumes is None:
        return []
    ours = found.volumes.image()
    white = f"linear, white = {fixed(view.display_white_cd_m2, 0)} cd/m²"
    surfaces = first_surfaces(entry.scene, view)
    pictures = [_toned(f"Transom, shadow volumes ({white})", ours.mean, view, found.volumes)]
    if found.reference is None:
        pictures.append(_false("Transom, luminance", luminance(ours.mean), view, LUMINANCE_SCALE.quantity))
        lux = illuminance_image(ours.mean, entry.scene, surfaces)
        return [*pictures, _false("Transom, illuminance", lux, view, ILLUMINANCE_SCALE.quantity)]
    reference = found.reference.image()
    pictures.append(_toned(f"Mitsuba 3 ({white})", reference.mean, view, found.reference))
    difference, noise = _relative(ours, reference, surfaces)
    pictures += [
        _false("Transom minus Mitsuba 3", difference, view, DIFFERENCE_SCALE.quantity),
        _false("Transom, luminance", luminance(ours.mean), view, LUMINANCE_SCALE.quantity, found.volumes),
        _false("Mitsuba 3, luminance", luminance(reference.mean), view, LUMINANCE_SCALE.quantity, found.reference),
        _false("Noise of the Mitsuba 3 picture", noise, view, NOISE_SCALE.quantity, found.reference),
    ]
    for label, image, bundle in (("Transom", ours, found.volumes), ("Mitsuba 3", reference, found.reference)):
        lux = illuminance_image(image.mean, entry.scene, surfaces)
        pictures.append(_false(f"{label}, illuminance", lux, view, ILLUMINANCE_SCALE.quantity, bundle))
    return pictures


def factoring_pictures(view: View, found: CasePictures) -> list[Picture]:
    """The paper's Figure 5: everything but direct sun, direct sun, and their sum, by volumes and by rays."""
    if found.volumes is None or found.rays is None:
        return []
    volumes, rays = found.volumes.image(), found.rays.image()
    return [
        _toned("Sky and interreflected light", volumes.mean - volumes.components["sun"], view, found.volumes),
        _toned("Direct sun, shadow volumes", volumes.components["sun"], view, found.volumes),
        _toned("Sum, shadow volumes", volumes.mean, view, found.volumes),
        _toned("Sky and interreflected light", rays.mean - rays.components["sun"], view, found.rays),
        _toned("Direct sun, shadow rays", rays.components["sun"], view, found.rays),
        _toned("Sum, shadow rays", rays.mean, view, found.rays),
    ]


def toned_picture(caption: str, bundle: Bundle, view: View) -> Picture:
    """One picture on its view's fixed scale."""
    return _toned(caption, bundle.image().mean, view, bundle)


def _relative(
    ours: ImageResult, reference: ImageResult, surfaces: FirstSurfaces
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Signed relative difference and the reference's relative standard error (h, w) [%]; NaN outside the interior."""
    truth = np.asarray(luminance(reference.mean), np.float64)
    inside = surfaces.interior
    floor = floor_cd_m2(truth[inside]) if inside.any() else 0.0
    difference = 100 * signed_relative_error(np.asarray(luminance(ours.mean), np.float64), truth, floor)
    error = np.zeros_like(truth) if reference.standard_error is None else reference.standard_error
    noise = 100 * np.divide(error, truth + floor, out=np.zeros_like(truth), where=truth + floor > 0)
    return np.where(inside, difference, np.nan), np.where(inside, noise, np.nan)


def _toned(caption: str, rgb: NDArray[np.floating], view: View, bundle: Bundle) -> Picture:
    content = png_bytes(tone_mapped(rgb, view.display_white_cd_m2))
    return Picture(caption, _uri(content), view.width, view.height, source=bundle.folder.name)


SCALES = {scale.quantity: scale for scale in (LUMINANCE_SCALE, ILLUMINANCE_SCALE, DIFFERENCE_SCALE, NOISE_SCALE)}


def _false(caption: str, values: NDArray[np.floating], view: View, scale: str, bundle: Bundle | None = None) -> Picture:
    content = false_colour_png(values, SCALES[scale])
    source = "" if bundle is None else bundle.folder.name
    return Picture(caption, _uri(content), view.width, view.height, scale, source)


def _uri(content: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(content).decode()

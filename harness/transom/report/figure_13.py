"""The paper's Figure 13 (fast, truth, ours, difference), and the sunlit corners of its section 4.3.2."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from transom.bundle import Bundle, Case, find_bundle, make_case
from transom.colour import luminance
from transom.compare import signed_relative_error
from transom.figures import DIFFERENCE_SCALE
from transom.noise import floor_cd_m2
from transom.renderer import ImageResult, load_renderer
from transom.report.numbers import fixed, words
from transom.report.pictures import false_coloured, find_pictures, toned, white_words
from transom.report.rows_images import HEADLINE_METHOD
from transom.report.sections import Strip
from transom.report.table import Cell, Row, Table, number, runs, signed_number
from transom.scene.model import Scene, View
from transom.suite import Suite, SuiteCase
from transom.visible import FirstSurfaces, first_surfaces

Bool = NDArray[np.bool_]

CORNER_REACH_M = 0.5
"""A pixel is in a sunlit corner if it sees an unlit point so near to a sunlit one on a surface of another direction."""

CORNER_COSINE = 0.7
"""Surfaces whose normals have a smaller cosine than this are of another direction."""

LIT_SHARE = 0.05
"""A pixel is sunlit where the sun gives this share of its luminance."""


@dataclass(frozen=True)
class CornerError:
    """Errors of one view in sunlit corners and elsewhere in the room, against the same reference [%]."""

    scene: str
    view: str
    condition: str
    pixel_count: int
    corner_percent: float
    corner_bias_percent: float
    elsewhere_percent: float
    source: str


def figure_13_strips(suites: Sequence[Suite]) -> list[Strip]:
    """A row a view of the suites that check references, for which fast and accurate Radiance have been rendered."""
    return [
        strip
        for suite in suites
        if suite.reference == "crosscheck"
        for entry in suite.cases
        for view in entry.views
        if (strip := _strip(entry, view)) is not None
    ]


def figure_13_cases(suites: Sequence[Suite]) -> list[Case]:
    """Our part of the figure, at the size of the referees' pictures."""
    return [
        _ours(entry, view)
        for suite in suites
        if suite.reference == "crosscheck"
        for entry in suite.cases
        for view in entry.views
    ]


def corner_errors(suites: Sequence[Suite]) -> Iterator[CornerError]:
    """Views that the sun enters, against Mitsuba."""
    for suite in suites:
        for entry in suite.cases if suite.reference == "mitsuba" and suite.layout == "views" else ():
            for view in entry.views if entry.condition.sun_direction is not None else ():
                found = find_pictures(entry, view)
                if found.volumes is not None and found.reference is not None:
                    row = _corner_error(entry, view, found.volumes, found.reference)
                    if row is not None:
                        yield row


def corner_table(found: Sequence[CornerError]) -> Table:
    """Section 4.3.2 of the paper in numbers."""
    rows = [
        Row(
            (
                Cell(f"{words(row.scene)}, {words(row.view).lower()}, {row.condition}"),
                number(row.pixel_count, 0),
                number(row.corner_percent, 2),
                signed_number(row.corner_bias_percent, 2),
                number(row.elsewhere_percent, 2),
                number(row.corner_percent / row.elsewhere_percent, 1) if row.elsewhere_percent > 0 else Cell(""),
            ),
            row.source,
        )
        for row in found
    ]
    head = (
        "View",
        "Pixels in sunlit corners",
        "Mean error there [%]",
        "Bias there [%]",
        "Mean error elsewhere [%]",
        "Times larger",
    )
    return Table("corners", "Where sunlight falls into corners", head, tuple(rows), "transom run rooms")


def sunlit_corners(scene: Scene, surfaces: FirstSurfaces, lit: Bool) -> Bool:
    """(h, w) True where a pixel of the room is not lit by the sun itself but sees a point within CORNER_REACH_M of a
    sunlit one on a surface of another direction: light that comes there has been reflected once, from near by."""
    inside = surfaces.interior & (surfaces.face >= 0)
    found = np.zeros_like(inside)
    bright, dim = inside & lit, inside & ~lit
    if not bright.any() or not dim.any():
        return found
    normals = _face_normals(scene)
    tree = cKDTree(surfaces.position[bright])
    bright_normals = normals[surfaces.face[bright]]
    dim_normals = normals[surfaces.face[dim]]
    near = tree.query_ball_point(surfaces.position[dim], CORNER_REACH_M)
    found[dim] = [
        bool(len(places)) and bool((np.abs(bright_normals[places] @ normal) < CORNER_COSINE).any())
        for places, normal in zip(near, dim_normals, strict=True)
    ]
    return found


def _corner_error(entry: SuiteCase, view: View, ours: Bundle, truth: Bundle) -> CornerError | None:
    picture, reference = ours.image(), truth.image()
    surfaces = first_surfaces(entry.scene, view)
    sun = picture.components.get("sun")
    if sun is None:
        return None
    values, expected = _luminance(picture), _luminance(reference)
    lit = np.asarray(luminance(sun), np.float64) > LIT_SHARE * values
    corners = sunlit_corners(entry.scene, surfaces, lit)
    elsewhere = surfaces.interior & ~corners
    if not corners.any() or not elsewhere.any():
        return None
    error = signed_relative_error(values, expected, floor_cd_m2(expected[surfaces.interior]))
    return CornerError(
        scene=entry.scene.name,
        view=view.name,
        condition=entry.condition.name,
        pixel_count=int(corners.sum()),
        corner_percent=100 * float(np.abs(error[corners]).mean()),
        corner_bias_percent=100 * float(values[corners].mean() / expected[corners].mean() - 1),
        elsewhere_percent=100 * float(np.abs(error[elsewhere]).mean()),
        source=runs(ours.record.key, truth.record.key),
    )


def _strip(entry: SuiteCase, view: View) -> Strip | None:
    """Fast, truth, ours at the size of the truth, and the difference; None where a picture is missing."""
    fast, truth = (_radiance(entry, view, preset) for preset in ("fast", "accurate"))
    ours = find_bundle(_ours(entry, view))
    if fast is None or truth is None or ours is None:
        return None
    surfaces = first_surfaces(entry.scene, view)
    values, expected = _luminance(ours.image()), _luminance(truth.image())
    inside = surfaces.interior
    relative = 100 * signed_relative_error(values, expected, floor_cd_m2(expected[inside]))
    pictures = [
        toned("Radiance, fast", fast.image().mean, view, fast),
        toned("Radiance, ground truth: parameters raised", truth.image().mean, view, truth),
        toned("Transom, shadow volumes", ours.image().mean, view, ours),
        false_coloured(
            f"Transom minus ground truth, mean size {fixed(float(np.abs(relative[inside]).mean()), 1)} %",
            np.where(inside, relative, np.nan),
            DIFFERENCE_SCALE,
            runs(ours.record.key, truth.record.key),
        ),
    ]
    title = f"{entry.scene.title}, {words(view.name).lower()}, {entry.condition.name}"
    return Strip(title, white_words(view), pictures)


def _ours(entry: SuiteCase, view: View) -> Case:
    engine = load_renderer("engine")
    return make_case(entry.scene, entry.condition, engine, {"visibility": HEADLINE_METHOD}, view=view)


def _radiance(entry: SuiteCase, view: View, preset: str) -> Bundle | None:
    renderer = load_renderer("radiance")
    return find_bundle(make_case(entry.scene, entry.condition, renderer, {"preset": preset}, view=view))


def _luminance(image: ImageResult) -> NDArray[np.float64]:
    return np.asarray(luminance(image.mean), np.float64)


def _face_normals(scene: Scene) -> NDArray[np.float64]:
    """Unit normals (F, 3) of faces that are triangles or planar quads; zero for one without area."""
    corners = scene.mesh.vertices[scene.mesh.faces[:, :3]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: NDArray[np.float64] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    return unit

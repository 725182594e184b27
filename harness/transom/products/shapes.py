"""Builders of sections, one a kind of product. Lengths in metres, angles in degrees; outdoors is z <= 0, y is up.

Left and right of a line from a to b are seen with y to the right and z up: along +y the left side looks to the room.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass

from transom.products.section import Line, Point, Section, polyline
from transom.products.unit_cell import UnitCell, perforated_sheet

AIR = (1.0, 0.0)
SHEET_M = 1e-6
"""Distance between the two sides of a sheet whose sides differ, and from cuts to the faces that they nearly reach."""


@dataclass(frozen=True)
class Shape:
    """A builder and what it is."""

    words: str
    build: Callable[..., Section | UnitCell]

    def parameters(self) -> list[str]:
        return list(inspect.signature(self.build).parameters)


def slab(thickness: float, index: float = 1.52, absorption: float = 0.0) -> Section:
    """One flat pane: the identity among products."""
    _require(thickness > 0, "thickness must be > 0")
    return Section(thickness, (AIR, (index, absorption)), tuple(_pane(0.0, thickness, thickness, 1)))


def prismatic(
    pitch: float,
    angle_low: float,
    angle_high: float,
    base: float,
    index: float = 1.49,
    absorption: float = 0.0,
    prisms_outdoors: float = 0.0,
) -> Section:
    """Prisms on a flat sheet. angle_low, angle_high: between the sheet and the facet that rises with y, and that falls
    with y; 90 at most for one of them. prisms_outdoors: 1 turns the prisms towards the sun, 0 towards the room."""
    _require(pitch > 0 and base > 0, "pitch and base must be > 0")
    _require(0 < angle_low <= 90 and 0 < angle_high <= 90, "facet angles are within 0..90 degrees")
    _require(angle_low < 90 or angle_high < 90, "only one facet can be upright")
    low, high = 1 / math.tan(math.radians(angle_low)), 1 / math.tan(math.radians(angle_high))
    height = pitch / (low + high)
    profile: list[Point] = [(0.0, base), (height * low, base + height), (pitch, base)]
    lines = [
        Line((0.0, 0.0), (pitch, 0.0), left=1, right=0),
        *(line for line in polyline(profile, left=0, right=1) if line.a != line.b),
    ]
    section = Section(pitch, (AIR, (index, absorption)), tuple(lines))
    return _turned(section) if prisms_outdoors else section


def laser_cut_panel(
    spacing: float, depth: float, index: float = 1.49, absorption: float = 0.0, kerf: float = 0.0
) -> Section:
    """Horizontal cuts through a sheet [Edmonds 1993]. kerf: width of a cut; 0 is a gap without width."""
    _require(spacing > kerf >= 0 and depth > 0, "0 <= kerf < spacing and depth > 0")
    if kerf == 0:
        lines = [*_pane(0.0, depth, spacing, 1), Line((0.0, SHEET_M), (0.0, depth - SHEET_M), "gap", 1, 1)]
    else:
        wide = spacing - kerf
        lines = [
            Line((0.0, 0.0), (wide, 0.0), left=1, right=0),
            Line((0.0, depth), (wide, depth), left=0, right=1),
            Line((0.0, 0.0), (0.0, depth), left=0, right=1),
            Line((wide, 0.0), (wide, depth), left=1, right=0),
        ]
    return Section(spacing, (AIR, (index, absorption)), tuple(lines))


def slat_blind(
    spacing: float,
    width: float,
    tilt: float,
    sagitta: float = 0.0,
    mirror_top: float = 0.0,
    diffuse_top: float = 0.0,
    mirror_bottom: float = 0.0,
    diffuse_bottom: float = 0.0,
    openness: float = 0.0,
) -> Section:
    """A venetian blind. tilt: 0 is horizontal (open), positive lowers the outer edge. sagitta: how far a slat curves up
    in its middle. Each side is a mirror or diffuse, by which reflectance is not 0. openness: share of holes."""
    _require(spacing > 0 and width > 0, "spacing and width must be > 0")
    for mirror, diffuse in ((mirror_top, diffuse_top), (mirror_bottom, diffuse_bottom)):
        _require(mirror == 0 or diffuse == 0, "a side is a mirror or diffuse, not both")
    _require(0 <= sagitta < width / 2, "sagitta is within 0..width / 2")
    t = math.radians(tilt)
    outer, inner = (-0.5 * width * math.sin(t), 0.0), (0.5 * width * math.sin(t), width * math.cos(t))
    # outer -> inner runs into the room: its left is below (-y), its right above.
    lines = [
        _line(outer, inner, bow=-sagitta, **_side("right", mirror_top, diffuse_top)),
        _line(_below(outer), _below(inner), bow=-sagitta, **_side("left", mirror_bottom, diffuse_bottom)),
    ]
    if openness > 0:
        # Holes go through both sheets at once: one sheet carries them, and what the two sides reflect.
        _require(
            (mirror_top == 0) == (mirror_bottom == 0), "a perforated slat has two diffuse sides or two mirrored sides"
        )
        kind = "mirror" if mirror_top or mirror_bottom else "diffuse"
        lines = [
            Line(
                outer,
                inner,
                kind,
                reflectance=mirror_bottom or diffuse_bottom,
                reflectance_right=mirror_top or diffuse_top,
                openness=openness,
                bow=-sagitta,
            )
        ]
    return Section(spacing, (AIR,), tuple(lines))


def curved_lamellae(
    spacing: float,
    thickness: float,
    depth: float,
    slope_out: float,
    slope_in: float,
    index: float = 1.49,
    absorption: float = 0.0,
    pane: float = 0.004,
    gap: float = 0.003,
) -> Section:
    """Curved bars stacked between two panes of glass, which guide light by total reflection. slope_out, slope_in: of
    the bars at the outdoor and the room end, degrees from horizontal, positive rising into the room. Bars as thick as
    their spacing lie on each other, with a gap of air without width between them."""
    _require(spacing >= thickness > 0 and depth > 0, "0 < thickness <= spacing and depth > 0")
    start, end = pane + gap, pane + gap + depth
    middle, turn = math.radians(slope_out + slope_in) / 2, math.radians(slope_in - slope_out)
    low = (0.0, start), (depth * math.tan(middle), end)
    high = (thickness, start), (depth * math.tan(middle) + thickness, end)
    bow = 0.5 * depth / math.cos(middle) * math.tan(turn / 4)
    faces = [Line(*low, left=0, right=1, bow=bow), Line(*high, left=1, right=0, bow=bow)]
    lines = [
        *(faces if thickness < spacing else [Line(*low, "gap", 1, 1, bow=bow)]),
        Line(low[0], high[0], left=1, right=0),
        Line(low[1], high[1], left=0, right=1),
        *_pane(0.0, pane, spacing, 2),
        *_pane(end + gap, end + gap + pane, spacing, 2),
    ]
    return Section(spacing, (AIR, (index, absorption), (1.52, 0.0)), tuple(lines))


def voids(
    spacing: float, void_depth: float, void_height: float, cover: float, index: float = 1.49, absorption: float = 0.0
) -> Section:
    """A sheet with slender voids inside: level above, sloping below, blunt towards the room. cover: sheet before and
    behind the voids."""
    _require(
        spacing > void_height > 0 and void_depth > 0 and cover > 0, "0 < void_height < spacing, depth and cover > 0"
    )
    thickness = void_depth + 2 * cover
    tip, top, bottom = (0.0, cover), (0.0, cover + void_depth), (-void_height, cover + void_depth)
    lines = [
        *_pane(0.0, thickness, spacing, 1),
        Line(tip, top, left=0, right=1),  # level: sheet above it
        Line(tip, bottom, left=1, right=0),
        Line(bottom, top, left=1, right=0),
    ]
    return Section(spacing, (AIR, (index, absorption)), tuple(lines))


def reflective_louvre(
    spacing: float,
    width: float,
    slope_out: float,
    slope_in: float,
    knee_depth: float,
    knee_drop: float,
    reflectance: float,
    reflectance_shade: float = 0.05,
) -> Section:
    """Fixed slats with a hollow mirror above, which send sun to the ceiling [US 6,239,910: light reflecting segment].

    slope_out, slope_in: of the mirror at its outdoor and room edge, degrees from horizontal, positive rising into the
    room. Below, a dark face (light shading segment) runs from the outdoor edge to a knee, knee_depth in and knee_drop
    under that edge, and a mirror (light redirecting segment) from there to the room edge.
    """
    _require(spacing > 0 and width > knee_depth > 0, "spacing > 0 and 0 < knee_depth < width")
    _require(-90 < slope_out < slope_in < 90, "-90 < slope_out < slope_in < 90 degrees")
    middle, turn = math.radians(slope_out + slope_in) / 2, math.radians(slope_in - slope_out)
    outer, inner, knee = (0.0, 0.0), (width * math.tan(middle), width), (-knee_drop, knee_depth)
    bow = 0.5 * width / math.cos(middle) * math.tan(turn / 4)
    lines = [
        _line(outer, inner, bow=bow, **_side("right", reflectance, 0.0)),
        _line(_below(outer), knee, bow=0.0, **_side("left", reflectance_shade, 0.0)),
        _line(knee, _below(inner), bow=0.0, **_side("left", reflectance, 0.0)),
    ]
    return Section(spacing, (AIR,), tuple(lines))


SHAPES: dict[str, Shape] = {
    "slab": Shape("a flat pane", slab),
    "prismatic": Shape("prisms on a sheet", prismatic),
    "laser_cut_panel": Shape("a sheet with level cuts", laser_cut_panel),
    "slat_blind": Shape("a venetian blind, plain, mirrored or perforated", slat_blind),
    "curved_lamellae": Shape("curved bars between panes", curved_lamellae),
    "voids": Shape("a sheet with slender voids", voids),
    "reflective_louvre": Shape("fixed hollow mirrors", reflective_louvre),
    "perforated_sheet": Shape("a thin sheet with round holes", perforated_sheet),
}


def _require(is_true: bool, words: str) -> None:
    if not is_true:
        raise ValueError(words)


def _pane(low: float, high: float, period: float, medium: int) -> list[Line]:
    return [
        Line((0.0, low), (period, low), left=medium, right=0),
        Line((0.0, high), (period, high), left=0, right=medium),
    ]


def _below(place: Point) -> Point:
    """Where the lower side of a sheet is."""
    return place[0] - SHEET_M, place[1]


def _side(side: str, mirror: float, diffuse: float) -> dict[str, object]:
    """Arguments of the line of one side of a sheet; the other side, which nothing meets, is black."""
    name = "reflectance" if side == "left" else "reflectance_right"
    return {"kind": "mirror" if mirror else "diffuse", name: mirror or diffuse}


def _line(a: Point, b: Point, bow: float, **side: object) -> Line:
    return Line(a, b, bow=bow, **side)  # type: ignore[arg-type]


def _turned(section: Section) -> Section:
    """The same product with its faces exchanged: z mirrored, so that left and right of each line change places."""
    depth = section.depth[1]
    lines = tuple(
        Line(
            (line.a[0], depth - line.a[1]),
            (line.b[0], depth - line.b[1]),
            line.kind,
            line.right,
            line.left,
            line.reflectance_right,
            line.reflectance,
            line.transmittance,
            line.openness,
            -line.bow,
        )
        for line in section.lines
    )
    return Section(section.period_m, section.media, lines, section.notes)

"""Lamps, beams and single reflections in black rooms: what follows from solid angles and the pane's formula alone."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from transom.known.builder import Drawing, Range, dark, sky_condition
from transom.known.case import Answer, KnownCase, point_answer, sensor_table
from transom.known.truth import analytic

Float64 = NDArray[np.float64]
Places = tuple[tuple[tuple[float, ...], tuple[float, ...]], ...]

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)

LAMP_ROOM_M, LAMP_M, LAMP_CD = (4.0, 4.0, 3.0), (1.2, 1.5, 2.4), 1000.0
LAMP_SENSORS: Places = (
    ((1.2, 1.5, 0.01), UP),
    ((3.4, 3.0, 0.01), UP),
    ((3.99, 1.0, 1.5), (-1, 0, 0)),
    ((2.0, 3.99, 0.5), (0, -1, 0)),
    ((3.0, 2.0, 1.0), (-0.6, 0.0, 0.8)),
)

PANEL_ROOM_M, PANEL_CD_M2 = (4.0, 4.0, 3.0), 1000.0
PANEL: tuple[Range, Range] = ((1.0, 2.0), (1.5, 2.5))
PANEL_SENSORS: Places = (
    ((1.5, 2.0, 0.01), UP),
    ((1.0, 1.5, 0.01), UP),
    ((3.5, 0.5, 0.01), UP),
    ((3.99, 2.0, 1.5), (-1, 0, 0)),
    ((1.2, 2.2, 2.0), UP),
)

FLUX_ROOM_M, FLUX_CD_M2 = (4.0, 4.0, 3.0), 5000.0
FLUX_WIDTHS_M = (0.5, 1.0, 2.0, 3.0)
FLUX_FLOOR_POINTS, FLUX_WALL_POINTS = 8, (8, 12)
FLUX_INSET_M = 0.001

BEAM_LX = 50_000.0
PANE_ROOM_M = (4.0, 4.0, 3.0)
PANE: tuple[Range, Range] = ((0.5, 3.5), (0.5, 3.5))
PANE_ANGLES_DEG = (0, 30, 45, 60, 70, 80)
PANE_SENSORS: Places = (((2.0, 2.2, 2.9), UP), ((1.5, 2.6, 2.9), UP), ((2.7, 1.8, 2.9), UP))

FLOOR_ROOM_M, FLOOR_REFLECTANCE = (6.0, 4.0, 3.0), 0.6
FLOOR_HOLE: tuple[Range, Range] = ((0.25, 3.0), (0.25, 3.75))
FLOOR_FIELDS: dict[str, tuple[Range, Range]] = {
    "small": ((0.5, 1.5), (1.5, 2.5)),
    "large": ((0.5, 2.5), (0.5, 3.5)),
}
FLOOR_SENSORS: Places = (
    ((5.99, 2.0, 2.0), (-1, 0, 0)),
    ((5.99, 1.0, 2.5), (-1, 0, 0)),
    ((4.5, 2.0, 2.8), DOWN),
    ((5.5, 2.5, 2.9), DOWN),
)
SHEET_PLACE_M, SHEET_HEIGHT_M = 3.5, 1.0


def point_source() -> list[KnownCase]:
    """An isotropic lamp in a black room: E = I cos(theta) / d²."""
    drawing = Drawing("point_source", "Point source in a black room")
    drawing.lamp(LAMP_M, LAMP_CD)
    drawing.room((0, 0, 0), LAMP_ROOM_M)
    points, normals = _split(LAMP_SENSORS)
    offsets = np.array(LAMP_M) - points
    distance2 = (offsets**2).sum(axis=1)
    truth = LAMP_CD * np.einsum("ij,ij->i", offsets, normals) / distance2**1.5

    def answers() -> list[Answer]:
        return [
            point_answer(row, f"point {row + 1}", float(value), "I cos(theta) / d²", group="E")
            for row, value in enumerate(truth)
        ]

    return [KnownCase(drawing.scene(), dark(), sensor_table(points, normals), answers)]


def area_source() -> list[KnownCase]:
    """A diffuse panel of 1 m² in the ceiling of a black room: E = L x the solid-angle integral of cos(theta)."""
    drawing = Drawing("area_source", "Area source in a black room")
    drawing.material("panel", luminance=PANEL_CD_M2)
    drawing.room((0, 0, 0), PANEL_ROOM_M, {"z1": {"panel": PANEL}})
    points, normals = _split(PANEL_SENSORS)

    def answers() -> list[Answer]:
        rows = []
        for row, (point, normal) in enumerate(zip(points, normals, strict=True)):
            known = _field_illuminance(point, normal, PANEL_ROOM_M[2], PANEL, PANEL_CD_M2)
            rows.append(point_answer(row, f"point {row + 1}", known, "L x integral of cos(theta)", group="E"))
        return rows

    return [KnownCase(drawing.scene(), dark(), sensor_table(points, normals), answers)]


def flux_through_opening() -> list[KnownCase]:
    """What enters a black room through a square hole in its roof falls on its floor and walls: sum of E A = Eh A_hole,
    under the traditional overcast sky. Hole and sky have the room's fourfold symmetry."""
    cases = []
    for width in FLUX_WIDTHS_M:
        drawing = Drawing("flux_through_opening", "Flux through a growing opening")
        drawing.opening("hole", glazed=False)
        side: Range = (2.0 - width / 2, 2.0 + width / 2)
        drawing.room((0, 0, 0), FLUX_ROOM_M, {"z1": {"hole": (side, side)}})
        points, normals, weights = _flux_points()
        condition = sky_condition(f"width_{width:g}", 16, zenith_cd_m2=FLUX_CD_M2)
        answers = partial(_flux_answers, width, side, points, normals, weights)
        table = sensor_table(points, normals)
        cases.append(KnownCase(drawing.scene(), condition, table, answers, f"{width:g} m"))
    return cases


def _flux_points() -> tuple[Float64, Float64, Float64]:
    """Gauss points on a quarter of the floor and on half a wall, and the area that each stands for in all [m²]."""
    half, height = FLUX_ROOM_M[0] / 2, FLUX_ROOM_M[2]
    across, share = np.polynomial.legendre.leggauss(FLUX_FLOOR_POINTS)
    across, share = 0.5 * half * (across + 1), 0.5 * half * share
    x, y = (grid.ravel() for grid in np.meshgrid(across, across, indexing="ij"))
    floor = np.stack([x, y, np.full(x.shape, FLUX_INSET_M)], axis=1)
    along, along_share = np.polynomial.legendre.leggauss(FLUX_WALL_POINTS[0])
    up, up_share = np.polynomial.legendre.leggauss(FLUX_WALL_POINTS[1])
    x, z = (grid.ravel() for grid in np.meshgrid(0.5 * half * (along + 1), 0.5 * height * (up + 1), indexing="ij"))
    wall = np.stack([x, np.full(x.shape, FLUX_INSET_M), z], axis=1)
    weights = [4 * np.outer(share, share).ravel(), 2 * half * height * np.outer(along_share, up_share).ravel()]
    normals = np.concatenate([np.tile(UP, (len(floor), 1)), np.tile((0.0, 1.0, 0.0), (len(wall), 1))])
    return np.concatenate([floor, wall]), normals, np.concatenate(weights)


def _flux_answers(width: float, side: Range, points: Float64, normals: Float64, weights: Float64) -> list[Answer]:
    """The flux; its uncertainty is how far the sum over the points is from it with exact illuminances."""
    skies, holes = analytic("analytic_sky"), analytic("analytic_openings")
    sky = skies.KnownSky(16, (0.0, 0.0, 1.0), FLUX_CD_M2)
    opening = holes.Rectangle(2, FLUX_ROOM_M[2], side, side)
    exact = [
        holes.opening_illuminance(point, normal, opening, sky.luminance).value
        for point, normal in zip(points, normals, strict=True)
    ]
    flux = sky.horizontal_illuminance() * opening.area
    return [
        Answer(
            quantity=f"flux, opening {width:g} m",
            unit="lm",
            truth=flux,
            truth_uncertainty=abs(float(weights @ np.array(exact)) - flux),
            source="Eh x area of the opening",
            rows=np.arange(len(points)),
            weights=weights,
        )
    ]


def glass_angles() -> list[KnownCase]:
    """A beam through a pane of n = 1.52 that absorbs nothing, at growing angles: E / (Es cos(theta)) under it."""
    drawing = Drawing("glass_angles", "Directional transmittance of clear glass")
    drawing.opening("pane", glazed=True)
    drawing.room((0, 0, 0), PANE_ROOM_M, {"z1": {"pane": PANE}})
    scene, (points, normals) = drawing.scene(), _split(PANE_SENSORS)
    cases = []
    for angle in PANE_ANGLES_DEG:
        condition = sky_condition(
            f"angle_{angle}",
            5,
            zenith_cd_m2=0.0,
            sun_altitude_rad=math.radians(90 - angle),
            sun_azimuth_rad=math.pi,
            direct_normal_lx=BEAM_LX,
        )
        answers = partial(_glass_answers, angle, len(points))
        cases.append(KnownCase(scene, condition, sensor_table(points, normals), answers, f"{angle} degrees"))
    return cases


def _glass_answers(angle: float, count: int) -> list[Answer]:
    cosine = math.cos(math.radians(angle))
    truth = float(analytic("analytic").clear_slab_transmittance(np.array(cosine)))
    source = "Fresnel's equations, all reflections within the pane"
    weight = np.array([1 / (BEAM_LX * cosine)])
    name = f"T({angle}°)"
    return [
        Answer(f"{name}, point {row + 1}", "1", truth, 0.0, source, np.array([row]), weight, group=name)
        for row in range(count)
    ]


def diffuse_reflection() -> list[KnownCase]:
    """A field of the floor lit evenly by a beam from the zenith: E = (rho Es / pi) x the integral of cos(theta)."""
    return _floor_cases("diffuse_reflection", "Reflection of a lit field of the floor", sheet=False)


def diffuse_obstruction() -> list[KnownCase]:
    """The same behind an upright black sheet, which hides a part of the field from each sensor."""
    return _floor_cases("diffuse_obstruction", "Reflection of a lit field behind an obstruction", sheet=True)


def _floor_cases(name: str, title: str, *, sheet: bool) -> list[KnownCase]:
    cases = []
    for size, field in FLOOR_FIELDS.items():
        drawing = Drawing(name, title)
        drawing.opening("hole", glazed=False)
        drawing.material("field", reflectance=FLOOR_REFLECTANCE)
        drawing.room((0, 0, 0), FLOOR_ROOM_M, {"z1": {"hole": FLOOR_HOLE}, "z0": {"field": field}})
        if sheet:
            drawing.material("sheet")
            drawing.rectangle("sheet", 0, SHEET_PLACE_M, (0.0, FLOOR_ROOM_M[1]), (0.0, SHEET_HEIGHT_M), front_up=True)
        condition = sky_condition(
            f"zenith_{size}", 5, zenith_cd_m2=0.0, sun_altitude_rad=math.pi / 2, direct_normal_lx=BEAM_LX
        )
        points, normals = _split(FLOOR_SENSORS)
        answers = partial(_floor_answers, size, field, sheet)
        cases.append(KnownCase(drawing.scene(), condition, sensor_table(points, normals), answers, size))
    return cases


def _floor_answers(size: str, field: tuple[Range, Range], sheet: bool) -> list[Answer]:
    luminance = FLOOR_REFLECTANCE * BEAM_LX / math.pi
    answers = []
    for row, (place, direction) in enumerate(FLOOR_SENSORS):
        point, normal = np.array(place), np.array(direction)
        end = field[0][1]
        if sheet:
            # The line over the sheet's edge meets the floor here; what lies beyond, towards the sensor, is hidden.
            share = SHEET_HEIGHT_M / (point[2] - SHEET_HEIGHT_M)
            end = min(end, SHEET_PLACE_M - share * (point[0] - SHEET_PLACE_M))
        if end <= field[0][0]:
            continue
        known = _field_illuminance(point, normal, 0.0, ((field[0][0], end), field[1]), luminance)
        source = "rho Es / pi x integral of cos(theta) over what is seen"
        answers.append(point_answer(row, f"{size} field, point {row + 1}", known, source, group=f"{size} field"))
    return answers


def _field_illuminance(
    point: Float64, normal: Float64, height: float, field: tuple[Range, Range], luminance: float
) -> float:
    """Illuminance [lx] by a level rectangle of one luminance [cd/m²]."""
    holes = analytic("analytic_openings")
    rectangle = holes.Rectangle(2, height, *field)
    return float(
        holes.opening_illuminance(
            point, normal, rectangle, lambda directions: np.full(directions.shape[:-1], luminance)
        ).value
    )


def _split(places: Places) -> tuple[Float64, Float64]:
    return np.array([place for place, _ in places], np.float64), np.array([normal for _, normal in places], np.float64)

"""Daylight through roof and facade openings of black rooms: sky component and externally reflected component.

Two equal rooms stand side by side, one with a hole, one with a pane that absorbs nothing. Truth is a product Gauss
quadrature over the opening (transom_reference.analytic_openings), which the closed forms for uniform and traditional
overcast skies confirm. The cases follow the idea of the analytic tests of CIE 171:2006; they are not its cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.known.builder import Drawing, Range, sky_condition
from transom.known.case import Answer, KnownCase, point_answer, sensor_table
from transom.known.truth import analytic

Float64 = NDArray[np.float64]

SKY_TYPES = range(1, 17)
"""CIE general skies 1 to 15, and the traditional overcast sky as 16."""

ZENITH_CD_M2 = 5000.0
SUN_ALTITUDE_RAD, SUN_AZIMUTH_RAD = math.radians(45), math.radians(145)
GROUND_ALBEDO = 0.3

GLAZINGS = ("hole", "pane")
PITCH_M = 5.0
"""From one room to the other, along x."""

ROOF_ROOM_M, ROOF_HOLE = (4.0, 4.0, 3.5), ((1.0, 3.0), (1.0, 2.5))
ROOF_SENSORS = (
    ((2.0, 1.75, 0.5), (0, 0, 1)),
    ((1.0, 1.0, 0.5), (0, 0, 1)),
    ((3.5, 3.5, 0.5), (0, 0, 1)),
    ((0.4, 2.0, 0.5), (0, 0, 1)),
    ((0.5, 2.0, 1.0), (1, 0, 0)),
)

FACADE_ROOM_M, FACADE_HOLE = (4.0, 5.0, 3.0), ((1.0, 3.0), (0.8, 2.3))
FACADE_SENSORS = (
    ((1.0, 3.0, 0.8), (0, 0, 1)),
    ((2.0, 1.0, 0.8), (0, 0, 1)),
    ((3.2, 2.5, 0.8), (0, 0, 1)),
    ((2.0, 2.5, 1.2), (0, -1, 0)),
    ((2.5, 2.0, 2.4), (0, 0, -1)),
)

OVERHANG_HEIGHT_M, OVERHANG_DEPTH_M, OVERHANG_CD_M2 = 2.6, 1.2, 300.0
WALL_DISTANCE_M, WALL_HEIGHT_M, WALL_CD_M2 = 6.0, 5.0, 800.0
CONTINUOUS_M = (-40.0, 49.0)
"""Where continuous screens begin and end along x, far outside of what the sensors see."""

REFLECTING_WALL = ((-8.0, 12.0), (-2.0, 8.0))
REFLECTING_WALL_REFLECTANCE = 0.6
UNIFORM_CD_M2, BEAM_LX = 3000.0, 50_000.0
BEAM_ALTITUDE_RAD = math.radians(40)


def roof() -> list[KnownCase]:
    """Sky component under an opening in a flat roof, for every sky."""
    return _all_skies("roof", "Sky component under roof openings", ROOF_ROOM_M, "z1", ROOF_HOLE, ROOF_SENSORS, "")


def facade() -> list[KnownCase]:
    """Sky component and light of the ground behind a window, for every sky."""
    title = "Sky component and ground behind facade openings"
    return _all_skies("facade", title, FACADE_ROOM_M, "y0", FACADE_HOLE, FACADE_SENSORS, "")


def overhang() -> list[KnownCase]:
    """The same under a continuous level mask of known luminance."""
    title = "Facade openings under a continuous horizontal mask"
    return _all_skies("overhang", title, FACADE_ROOM_M, "y0", FACADE_HOLE, FACADE_SENSORS, "overhang")


def opposite_wall() -> list[KnownCase]:
    """The same opposite a continuous upright mask of known luminance."""
    title = "Facade openings opposite a continuous vertical mask"
    return _all_skies("opposite_wall", title, FACADE_ROOM_M, "y0", FACADE_HOLE, FACADE_SENSORS, "wall")


def _all_skies(
    name: str,
    title: str,
    size: tuple[float, float, float],
    side: str,
    hole: tuple[Range, Range],
    sensors: Sequence[tuple[tuple[float, ...], tuple[int, ...]]],
    mask: str,
) -> list[KnownCase]:
    drawing = Drawing(name, title)
    for index, glazing in enumerate(GLAZINGS):
        shift = index * PITCH_M
        drawing.opening(glazing, glazed=glazing == "pane")
        shifted = ((hole[0][0] + shift, hole[0][1] + shift), hole[1])
        drawing.room((shift, 0, 0), (shift + size[0], size[1], size[2]), {side: {glazing: shifted}})
    if mask == "overhang":
        drawing.material("mask", luminance=OVERHANG_CD_M2)
        drawing.rectangle("mask", 2, OVERHANG_HEIGHT_M, CONTINUOUS_M, (-OVERHANG_DEPTH_M, 0.0), front_up=False)
    if mask == "wall":
        drawing.material("mask", luminance=WALL_CD_M2)
        drawing.rectangle("mask", 1, -WALL_DISTANCE_M, CONTINUOUS_M, (0.0, WALL_HEIGHT_M), front_up=True)
    scene = drawing.scene()
    points = np.array([[x + index * PITCH_M, y, z] for index in range(2) for (x, y, z), _ in sensors])
    normals = np.array([normal for _ in GLAZINGS for _, normal in sensors], np.float64)
    table = sensor_table(points, normals)
    cases = []
    for cie_type in SKY_TYPES:
        condition = sky_condition(
            f"cie_{cie_type}",
            cie_type,
            zenith_cd_m2=ZENITH_CD_M2,
            sun_altitude_rad=SUN_ALTITUDE_RAD,
            sun_azimuth_rad=SUN_AZIMUTH_RAD,
            ground_albedo=GROUND_ALBEDO,
        )
        answers = partial(_sky_answers, cie_type, side, hole, sensors, mask)
        cases.append(KnownCase(scene, condition, table, answers, f"cie {cie_type}"))
    return cases


def _sky_answers(
    cie_type: int,
    side: str,
    hole: tuple[Range, Range],
    sensors: Sequence[tuple[tuple[float, ...], tuple[int, ...]]],
    mask: str,
) -> list[Answer]:
    """Illuminances of both rooms. The sun's direction is worked out here once more, from its angles."""
    skies, holes = analytic("analytic_sky"), analytic("analytic_openings")
    across = math.cos(SUN_ALTITUDE_RAD)
    sun = (across * math.sin(SUN_AZIMUTH_RAD), across * math.cos(SUN_AZIMUTH_RAD), math.sin(SUN_ALTITUDE_RAD))
    sky = skies.KnownSky(cie_type, sun, ZENITH_CD_M2)
    ground = GROUND_ALBEDO * sky.horizontal_illuminance() / math.pi
    slab = analytic("analytic").clear_slab_transmittance
    opening = holes.Rectangle(2, ROOF_ROOM_M[2], *hole) if side == "z1" else holes.Rectangle(1, 0.0, *hole)
    answers = []
    for index, glazing in enumerate(GLAZINGS):
        for number, (place, normal) in enumerate(sensors):
            # Masks are so wide that each room has the same view of them: both are worked out for the first room.
            point = np.array(place)
            known = holes.opening_illuminance(
                point,
                np.array(normal, np.float64),
                opening,
                sky.luminance,
                ground,
                slab if glazing == "pane" else None,
                _masks(holes, mask, point, opening),
                np.array(sun),
            )
            row = index * len(sensors) + number
            name = f"CIE {cie_type}, {glazing}, point {number + 1}"
            group = f"CIE {cie_type}, {glazing}"
            source = "quadrature over the opening, CIE S 011"
            answers.append(point_answer(row, name, known.value, source, known.uncertainty, group))
    return answers


def _masks(holes: Any, mask: str, point: Float64, opening: Any) -> list[Any]:
    if mask == "overhang":
        sheet = holes.Rectangle(2, OVERHANG_HEIGHT_M, CONTINUOUS_M, (-OVERHANG_DEPTH_M, 0.0))
        return [holes.overhang_screen(point, opening, sheet, OVERHANG_CD_M2)]
    if mask == "wall":
        sheet = holes.Rectangle(1, -WALL_DISTANCE_M, CONTINUOUS_M, (0.0, WALL_HEIGHT_M))
        return [holes.parallel_screen(point, opening, sheet, WALL_CD_M2)]
    return []


def reflecting_wall() -> list[KnownCase]:
    """Externally reflected component of a diffuse wall, lit by uniform surroundings that the room hides in part, and
    by the sun from behind the room under a black sky."""
    drawing = Drawing("reflecting_wall", "Daylight reflected by an opposite wall")
    drawing.opening("hole", glazed=False)
    drawing.room((0, 0, 0), FACADE_ROOM_M, {"y0": {"hole": FACADE_HOLE}})
    drawing.material("wall", reflectance=REFLECTING_WALL_REFLECTANCE)
    drawing.rectangle("wall", 1, -WALL_DISTANCE_M, *REFLECTING_WALL, front_up=True)
    scene = drawing.scene()
    table = sensor_table(
        np.array([place for place, _ in FACADE_SENSORS]), np.array([normal for _, normal in FACADE_SENSORS])
    )
    # Under an albedo of 1 the ground is as bright as a uniform sky.
    uniform = sky_condition("uniform", 5, zenith_cd_m2=UNIFORM_CD_M2, ground_albedo=1.0)
    # Azimuth 0: the sun stands behind the room, whose shadow falls short of what is seen of the wall.
    sunny = sky_condition(
        "sunny", 5, zenith_cd_m2=0.0, sun_altitude_rad=BEAM_ALTITUDE_RAD, sun_azimuth_rad=0.0, direct_normal_lx=BEAM_LX
    )
    sunlit = REFLECTING_WALL_REFLECTANCE * BEAM_LX * math.cos(BEAM_ALTITUDE_RAD) / math.pi
    return [
        KnownCase(
            scene, uniform, table, partial(_wall_answers, "uniform light", UNIFORM_CD_M2, _skylit_wall), "uniform"
        ),
        KnownCase(scene, sunny, table, partial(_wall_answers, "sun on the wall", 0.0, lambda _: sunlit), "sunny"),
    ]


def _wall_answers(
    words: str, surroundings: float, wall_luminance: Callable[[Float64], Float64 | float]
) -> list[Answer]:
    """wall_luminance: [cd/m²] of points (..., 3) of the wall."""
    holes = analytic("analytic_openings")
    opening = holes.Rectangle(1, 0.0, *FACADE_HOLE)
    wall = holes.Rectangle(1, -WALL_DISTANCE_M, *REFLECTING_WALL)
    answers = []
    for row, (place, normal) in enumerate(FACADE_SENSORS):
        point = np.array(place)

        def seen(directions: Float64, point: Float64 = point) -> Float64:
            reach = (-WALL_DISTANCE_M - point[1]) / directions[..., 1]
            return np.asarray(wall_luminance(point + reach[..., None] * directions) + 0 * reach)

        screen = holes.parallel_screen(point, opening, wall, seen)
        known = holes.opening_illuminance(
            point,
            np.array(normal, np.float64),
            opening,
            lambda directions: np.full(directions.shape[:-1], surroundings),
            surroundings,
            None,
            [screen],
        )
        if known.value > 0:
            source = "form factors of the room as the wall sees it, quadrature over the opening"
            answers.append(point_answer(row, words, known.value, source, known.uncertainty, words))
    return answers


def _skylit_wall(places: Float64) -> Float64:
    """Luminance [cd/m²] of the wall: it sees UNIFORM_CD_M2 all round but for the sides of the black room.

    Visible sides of a convex body do not hide each other: their form factors add up.
    """
    forms = analytic("analytic")
    x, z = places[..., 0], places[..., 2]
    width, depth, height = FACADE_ROOM_M
    near, far = WALL_DISTANCE_M, WALL_DISTANCE_M + depth
    hidden = forms.parallel_rectangle_factor(x, z, np.asarray(near), (0.0, width, 0.0, height))
    for distance, along, end in ((-x, z, height), (x - width, z, height), (-z, x, width), (z - height, x, width)):
        outside = distance > 0
        side = forms.perpendicular_rectangle_factor(
            along, np.where(outside, distance, 1.0), (0.0, end, np.asarray(near), np.asarray(far))
        )
        hidden = hidden + np.where(outside, side, 0.0)
    return np.asarray(REFLECTING_WALL_REFLECTANCE * UNIFORM_CD_M2 * (1 - hidden))

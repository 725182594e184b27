"""Sizes, places, reflectances and openings at their limits, where the answer is known or must not change."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from transom.colour import luminance
from transom.hard.changes import sunlit
from transom.hard.claims import (
    ROUNDING_SHARE,
    Case,
    Claim,
    Lit,
    close,
    conserving,
    finite,
    refused,
    relit,
    room_claims,
    value,
)
from transom.hard.rooms import ROOM_M, Point, Polygon, Room, as_point, box, quad, shell, windowed_room

GROUP = "limit"
SUN = (0.1, -1.0, 0.6)


def limit_cases() -> list[Case]:
    return [
        _moved("room of 1 mm", 2.5e-4),
        _moved("room of 10 km", 2500.0),
        _moved("room 10 km from the origin", 1.0, (1e4, -1e4, 1e3)),
        _moved("room of 1 mm 10 km from the origin", 2.5e-4, (1e4, -1e4, 1e3)),
        *_reflectances(),
        *_openings(),
    ]


def _sunny(room: Room) -> Lit:
    return Lit(room, lambda condition: sunlit(condition, SUN))


def _moved(name: str, factor: float, by: Point = (0.0, 0.0, 0.0)) -> Case:
    """The usual room, written to its file at another size or place."""
    usual, other = windowed_room(), moved_room(windowed_room(), factor, by)
    lit = _sunny(other)
    claim = Claim(
        "same as at 4 m",
        f"the light of the usual room to rounding, {100 * ROUNDING_SHARE:g} %",
        lambda: close(_sunny(usual), lit, ROUNDING_SHARE),
    )
    return Case(name, GROUP, (claim, *room_claims(lit)))


def moved_room(room: Room, factor: float, by: Point) -> Room:
    def place(point: Point) -> Point:
        return as_point(factor * np.array(point) + np.array(by))

    polygons = tuple(replace(p, corners=tuple(place(corner) for corner in p.corners)) for p in room.polygons)
    sensors = [place(point) for point in room.sensors]
    return replace(room, polygons=polygons, sensors=sensors, camera=place(room.camera), target=place(room.target))


def _reflectances() -> list[Case]:
    cases = []
    for rho in (0.0, 0.99, 0.999):
        lit = _sunny(windowed_room(reflectance=rho))
        claims = room_claims(lit)
        if rho == 0.0:
            indirect = value("no reflected light", "none", partial(_sum_of, lit, "indirect"), 0.0, 1e-3)
            claims = (indirect, *claims)
        cases.append(Case(f"reflectance {rho:g}", GROUP, claims))
    for rho in (0.0, 0.9, 0.99, 0.999):
        lit = Lit(furnace(rho))
        exact = math.pi * 100 / (1 - rho)
        claim = value(
            "furnace",
            f"{exact:.6g} lx within 0.1 %: L / (1 - rho)",
            partial(_mean_lx, lit),
            0.999 * exact,
            1.001 * exact,
        )
        cases.append(Case(f"closed furnace of reflectance {rho:g}", GROUP, (claim, *room_claims(lit))))
    for rho in (1.0, 0.9999, 1.5, -0.1):
        words = ("reflectance", f"{rho:g}", "0..0.999", "scene.toml", "wall")
        cases.append(Case(f"reflectance {rho:g}", GROUP, (refused("refused", partial(_solve_furnace, rho), words),)))
    return cases


def _sum_of(lit: Lit, part: str) -> float:
    return float(lit.sensors[part].sum())


def _mean_lx(lit: Lit) -> float:
    return float(luminance(lit.sensors["total"]).mean())


def _solve_furnace(rho: float) -> object:
    return Lit(furnace(rho)).engine


def furnace(rho: float) -> Room:
    """A closed room whose faces all emit 100 cd/m²."""
    lines = f"reflectance = {rho!r}\nluminance_cd_m2 = 100"
    return Room(tuple(shell(without=())), {"wall": lines}, condition='sky = "none"')


def tiny_opening_room(side: float, transmittance: float | None = None) -> Room:
    """A square opening around the middle of the usual window."""
    half = side / 2
    return windowed_room((2.0 - half, 1.5 - half, 2.0 + half, 1.5 + half), transmittance, reflectance=0.0)


def _openings() -> list[Case]:
    tiny = Lit(replace(tiny_opening_room(1e-3), sensors=((2.0, 2.0, 0.8),)), lambda c: replace(c, sun_direction=None))
    # A sky of 10,000 lx has 10,000 / pi cd/m²; the sensor looks up, the opening stands 0.7 m above and 2 m away.
    distance2 = 2.0**2 + 0.7**2
    exact = 1e4 / math.pi * 1e-6 * (0.7 / math.sqrt(distance2)) * (2.0 / math.sqrt(distance2)) / distance2
    share = value(
        "closed form",
        f"{exact:.4g} lx within 1 %: luminance x projected solid angle",
        lambda: float(luminance(tiny.sensors["sky"])[0]),
        0.99 * exact,
        1.01 * exact,
    )
    bright = Lit(tiny_opening_room(1e-3).with_material("wall", "reflectance = 0.5"))
    closed = Room(tuple(shell(without=())))
    point = '[[point_sources]]\nname = "lamp"\nposition_m = [2.0, 2.5, 2.0]\nintensity_cd = 1000'
    lamp = Lit(replace(closed, extra=point, condition='sky = "none"'))
    on_surface = Lit(replace(closed, extra=point.replace("2.0]", "3.0]"), condition='sky = "none"'))
    opaque_glass = _sunny(windowed_room(transmittance=0.0))
    return [
        Case("opening of 1 mm²", GROUP, (share, finite(tiny), conserving(tiny))),
        Case("opening of 1 mm² in a bright room", GROUP, (finite(bright), conserving(bright), relit(bright))),
        Case("all four walls are openings", GROUP, room_claims(_sunny(glass_room(("z0", "z1"))))),
        Case("all but the floor are openings", GROUP, room_claims(_sunny(glass_room(("z0",))))),
        Case("every side is an opening", GROUP, room_claims(_sunny(glass_room(())))),
        Case("no opening, a lamp", GROUP, room_claims(lamp)),
        Case(
            "lamp in the plane of the ceiling",
            GROUP,
            (refused("refused", lambda: on_surface.engine, ("scene.toml", "lamp", "lies on", "room", "Move it")),),
        ),
        Case(
            "nothing that lights", GROUP, (refused("refused", closed.load, ("scene.toml", "nothing lights it", "Add")),)
        ),
        Case(
            "glass that passes nothing",
            GROUP,
            (
                value("dark", "no light", lambda: float(opaque_glass.sensors["total"].sum()), 0.0, 0.0),
                *room_claims(opaque_glass),
            ),
        ),
        Case("two panes behind each other", GROUP, room_claims(_sunny(double_window()))),
        Case(
            "opening that a sheet divides",
            GROUP,
            room_claims(
                _sunny(
                    windowed_room().with_polygons(
                        quad((2.0, 0.0, 0.0), (2.0, 0.6, 0.0), (2.0, 0.6, 3.0), (2.0, 0.0, 3.0), object="fin")
                    )
                )
            ),
        ),
    ]


def glass_room(opaque: tuple[str, ...]) -> Room:
    """A box of which only these sides are opaque, with a table in it."""
    sides = ("x0", "x1", "y0", "y1", "z0", "z1")
    glass = box((0.0, 0.0, 0.0), ROOM_M, "glass", "glass", without=opaque)
    solid = shell(without=tuple(side for side in sides if side not in opaque))
    table = box((1.5, 2.0, 0.3), (2.5, 3.0, 0.6))
    return Room((*solid, *glass, *table), openings={"glass": 0.8})


def double_window() -> Room:
    """A second pane 1 cm behind the first: light crosses both."""
    room = windowed_room()
    pane = room.polygons[-1]
    reveal = box((1.0, 0.0, 1.0), (3.0, 0.01, 2.5), inward=True, object="reveal", without=("y0", "y1"))
    inner = Polygon(tuple((x, 0.01, z) for x, _, z in pane.corners), "inner", "window")
    outer_wall = [
        replace(p, corners=tuple((x, 0.01 if y == 0.0 else y, z) for x, y, z in p.corners)) for p in room.polygons[:-1]
    ]
    return replace(room, polygons=(*outer_wall, pane, *reveal, inner), openings={"glass": 0.8, "inner": 0.8})

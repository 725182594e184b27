"""The sun where formulas divide by what vanishes: in planes of panes and walls, at the horizon, at the poles."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

from transom.daylight import resolve_condition
from transom.daylight.condition import Condition
from transom.hard.changes import sunlit
from transom.hard.claims import Case, Claim, Lit, refused, room_claims, value
from transom.hard.rooms import ROOM_M, Polygon, Room, box, frame, quad, shell, windowed_room
from transom.scene.model import Scene

GROUP = "sun"


def sun_cases() -> list[Case]:
    return [
        _case("sun in the plane of the window", windowed_room(), (1.0, 0.0, 0.3), dark=True),
        _case("sun a millionth off the plane of the window", windowed_room(), (1.0, -1e-6, 0.3)),
        _case("sun along a wall", wide_window_room(), (0.0, -1.0, 0.5)),
        _case("sun along a wall and a ceiling", wide_window_room(), (0.0, -1.0, 0.0)),
        _case("sun at the horizon", windowed_room(), (0.2, -1.0, 0.0)),
        _case("sun at the zenith above a roof light", roof_light_room(), (0.0, 0.0, 1.0)),
        _case("sun at the zenith beside a window", windowed_room(), (0.0, 0.0, 1.0), dark=True),
        _case("sun due north, window south", windowed_room(), (0.0, 1.0, 0.7), dark=True),
        _case("sun on a silhouette edge", boxed_room(), (0.0, -1.0, 0.5)),
        _case("sun on the edge between two sides", boxed_room(), (1.0, -1.0, 1.0)),
        *_clock_cases(),
    ]


def _case(name: str, room: Room, towards: tuple[float, float, float], *, dark: bool = False) -> Case:
    lit = Lit(room, lambda condition: sunlit(condition, towards))
    claims = room_claims(lit)
    if dark:
        claims += (value("no beam", "no beam enters", lambda: float(lit.engine.audit().in_beams.sum()), 0.0, 0.0),)
    return Case(name, GROUP, claims)


def wide_window_room() -> Room:
    """The usual room with a window from wall to wall and up to the ceiling."""
    x, _, z = ROOM_M
    sill = 1.0
    wall = quad((0.0, 0.0, 0.0), (0.0, 0.0, sill), (x, 0.0, sill), (x, 0.0, 0.0))
    pane = quad((0.0, 0.0, sill), (x, 0.0, sill), (x, 0.0, z), (0.0, 0.0, z), "glass", "window")
    return Room((*shell(), wall, pane), openings={"glass": 0.8})


def roof_light_room(hole_m: tuple[float, float] = (1.0, 3.0)) -> Room:
    """The usual room with an unglazed hole in its ceiling. hole_m: its low and high x."""
    x, y, z = ROOM_M
    low, high = hole_m
    outer = [(0.0, 0.0, z), (0.0, y, z), (x, y, z), (x, 0.0, z)]
    inner = [(low, 1.5, z), (low, 3.5, z), (high, 3.5, z), (high, 1.5, z)]
    hole = Polygon(tuple(inner[::-1]), "hole", "roof_light")
    return Room((*shell(without=("z1",)), *frame(outer, inner), hole), openings={"hole": None})


def boxed_room() -> Room:
    """The usual room with a box on legs of air: its sides lie in planes of x and y."""
    return windowed_room().with_polygons(*box((1.5, 0.8, 0.5), (2.5, 1.5, 1.0)))


def _clock_cases() -> list[Case]:
    sunny = 'sky = "cie:12"'
    cases = []
    places = {
        "north pole at midsummer": (90.0, 0.0, 0.0, "2026-06-21T12:00", 23.4),
        "south pole at midsummer": (-90.0, 0.0, 0.0, "2026-12-21T03:00", 23.4),
        "equator at equinox noon": (0.0, 0.0, 0.0, "2026-03-20T12:08", 90.0),
        "date line": (0.0, 180.0, 12.0, "2026-03-20T12:08", 90.0),
        "polar night": (80.0, 20.0, 1.0, "2026-12-21T12:00", -13.4),
        "tropic, sun due north": (0.0, 0.0, 0.0, "2026-06-21T12:02", 66.6),
    }
    for name, (latitude, longitude, zone, time, altitude_deg) in places.items():
        site = f"latitude_deg = {latitude}\nlongitude_deg = {longitude}\ntime_zone_h = {zone}"
        room = replace(windowed_room(), site=site, condition=f'time = "{time}"\n{sunny}')
        lit = Lit(room)
        altitude = value(
            "altitude",
            f"the sun stands at {altitude_deg:g} degrees",
            partial(_altitude_deg, lit),
            altitude_deg - 0.5,
            altitude_deg + 0.5,
        )
        cases.append(Case(name, GROUP, (altitude, *room_claims(lit))))
    night = replace(windowed_room(), condition=f'time = "2026-03-21T00:00"\n{sunny}')
    cases.append(Case("sun below the horizon, clear sky", GROUP, (_dark(night), *room_claims(Lit(night)))))
    overcast = 'time = "2026-03-21T00:00"\nsky = "overcast"\ndiffuse_horizontal_illuminance_lx = 5000'
    cases.append(Case("sun below the horizon, overcast", GROUP, room_claims(Lit(replace(night, condition=overcast)))))
    impossible = 'time = "2026-03-21T00:00"\nsky = "cie:12"\ndirect_normal_illuminance_lx = 50000'
    cases.append(
        Case(
            "sunlight from below the horizon",
            GROUP,
            (
                refused(
                    "refused",
                    lambda: first_condition(replace(night, condition=impossible).load()),
                    ("direct_normal_illuminance_lx", "50000", "above the horizon", "Choose"),
                ),
            ),
        )
    )
    return cases


def _altitude_deg(lit: Lit) -> float:
    return math.degrees(lit.condition.sun.altitude_rad)


def first_condition(scene: Scene) -> Condition:
    return resolve_condition(scene.conditions[0], scene.site)


def _dark(room: Room) -> Claim:
    lit = Lit(room)
    return value("dark", "no light at all", lambda: float(sum(part.sum() for part in lit.sensors.values())), 0.0, 0.0)

"""Meshes that real models have: faces that coincide, nearly touch, are needles or sheets, or repeat each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from transom.daylight.condition import Condition
from transom.hard.changes import sunlit
from transom.hard.claims import (
    NOISE_SHARE,
    Case,
    Claim,
    Lit,
    Seen,
    close,
    conserving,
    finite,
    methods_agree,
    refused,
    room_claims,
)
from transom.hard.rooms import (
    ROOM_M,
    WINDOW_M,
    Point,
    Polygon,
    Room,
    box,
    quad,
    shell,
    windowed_room,
)

GROUP = "shape"
SUN = (0.3, -1.0, 0.7)


def shape_cases() -> list[Case]:
    room = windowed_room()
    return [
        *(
            _refused_by_engine(f"rug {name} the floor", with_rug(height), ("rug", "room", "in the plane of", "Delete"))
            for name, height in (("in the plane of", 0.0), ("1 micrometre above", 1e-6), ("20 micrometres above", 2e-5))
        ),
        _solved("rug 0.1 mm above the floor", with_rug(1e-4)),
        _solved("rug 1 mm above the floor", with_rug(1e-3)),
        _solved("box standing on the floor", room.with_polygons(*box((1.5, 1.5, 0.0), (2.5, 2.5, 0.7)))),
        _solved("box in a corner", room.with_polygons(*box((0.0, 4.0, 0.0), (1.0, 5.0, 0.7)))),
        _solved("box 1 micrometre off a wall", room.with_polygons(*box((1e-6, 2.0, 0.5), (0.5, 3.0, 1.0)))),
        _solved("box 1 mm off a wall", room.with_polygons(*box((1e-3, 2.0, 0.5), (0.5, 3.0, 1.0)))),
        _solved(
            "two boxes that share a side",
            room.with_polygons(
                *box((1.0, 2.0, 0.0), (1.5, 3.0, 0.7), object="left", without=("x1",)),
                *box((1.5, 2.0, 0.0), (2.0, 3.0, 0.7), object="right"),
            ),
        ),
        _solved(
            "two boxes that touch along an edge",
            room.with_polygons(
                *box((1.0, 2.0, 0.0), (1.5, 2.5, 0.7), object="left"),
                *box((1.5, 2.5, 0.0), (2.0, 3.0, 0.7), object="right"),
            ),
        ),
        _solved(
            "boxes that run through each other",
            room.with_polygons(
                *box((1.0, 2.0, 0.2), (2.0, 3.0, 0.7), object="left"),
                *box((1.5, 1.5, 0.4), (1.8, 3.5, 0.9), object="right"),
            ),
        ),
        _solved("floor of slivers", sliver_floor_room()),
        _solved(
            "needle in the air",
            room.with_polygons(Polygon(((0.5, 2.0, 1.0), (3.5, 2.0, 1.0), (2.0, 2.0001, 1.0)), "wall", "needle")),
        ),
        _solved("T-junctions", t_junction_room()),
        _terrace(),
        _solved("open sheet", room.with_polygons(_sheet(1.0), _sheet(1.8))),
        _solved("box without a lid", room.with_polygons(*box((1.5, 1.5, 0.2), (2.5, 2.5, 0.7), without=("z1",)))),
        _refused_by_engine(
            "box without a lid, its bottom in the floor",
            room.with_polygons(*box((1.5, 1.5, 0.0), (2.5, 2.5, 0.7), without=("z1",))),
            ("box", "room", "in the plane of"),
        ),
        _solved("inside-out box", room.with_polygons(*box((1.5, 1.5, 0.3), (2.5, 2.5, 0.7), inward=True))),
        _louvres(),
        _smooth(),
        *_refused(),
    ]


def _solved(name: str, room: Room) -> Case:
    return Case(name, GROUP, room_claims(Lit(room, lambda condition: sunlit(condition, SUN))))


def with_rug(height: float) -> Room:
    """A sheet just above the floor."""
    z = height
    rug = quad((1.0, 0.5, z), (3.0, 0.5, z), (3.0, 2.0, z), (1.0, 2.0, z), "rug", "rug")
    return windowed_room().with_polygons(rug).with_material("rug", "reflectance = 0.2")


def _sheet(y: float) -> Polygon:
    return quad((1.2, y, 0.5), (2.2, y, 0.5), (2.2, y, 1.4), (1.2, y, 1.4), "wall", "sheet")


def sliver_floor_room() -> Room:
    """The floor as a fan of long triangles, some with a width of a ten-thousandth of their length."""
    x, y, _ = ROOM_M
    room = windowed_room()
    widths = [x * share for share in (0.0, 1e-4, 2e-4, 0.3, 0.3001, 0.9999, 1.0)]
    apex: Point = (0.0, y, 0.0)
    fan = [Polygon(((a, 0.0, 0.0), (b, 0.0, 0.0), apex)) for a, b in pairwise(widths)]
    fan.append(Polygon(((x, 0.0, 0.0), (x, y, 0.0), apex)))
    floorless = [polygon for polygon in room.polygons if any(z > 0 for _, _, z in polygon.corners)]
    return replace(room, polygons=(*floorless, *fan))


def t_junction_room() -> Room:
    """Walls cut at heights that their neighbours do not share."""
    x, y, z = ROOM_M
    kept = shell(without=("y0", "x0", "x1"))
    west = [quad((0.0, 0.0, a), (0.0, y, a), (0.0, y, b), (0.0, 0.0, b)) for a, b in ((0.0, 0.7), (0.7, 1.9), (1.9, z))]
    east = [
        quad((x, a, 0.0), (x, a, z), (x, b, z), (x, b, 0.0)) for a, b in ((0.0, 1.1), (1.1, 3.3333333), (3.3333333, y))
    ]
    usual = windowed_room()
    return replace(usual, polygons=(*kept, *west, *east, *usual.polygons[5:]))


def terrace_room(slab_xs: Sequence[float], slab_ys: Sequence[float]) -> Room:
    """A room on a slab that goes on around it, in faces between the given lines; its walls stand on it in pieces of
    which none is half as long as the slab. Two windows reach almost down to it."""
    x, y, z = ROOM_M
    roof = [polygon for polygon in shell(without=()) if all(corner[2] == z for corner in polygon.corners)]
    slab = [
        quad((x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0), object="slab")
        for x0, x1 in pairwise(slab_xs)
        for y0, y1 in pairwise(slab_ys)
    ]
    lines, sill, head = (0.0, 0.6, 1.8, 2.2, 3.4, x), 0.1, 2.5
    south = [
        quad((a, 0.0, low), (a, 0.0, high), (b, 0.0, high), (b, 0.0, low), "glass" if is_pane else "wall", "facade")
        for k, (a, b) in enumerate(pairwise(lines))
        for low, high, is_pane in ((0.0, sill, False), (sill, head, k % 2 == 1), (head, z, False))
    ]
    panes = [replace(face, corners=face.corners[::-1]) for face in south if face.material == "glass"]
    walls = [face for face in south if face.material == "wall"]
    walls += [quad((b, y, 0.0), (b, y, z), (a, y, z), (a, y, 0.0)) for a, b in pairwise((0.0, 1.3, 2.7, x))]
    for a, b in pairwise((0.0, 1.7, 3.4, y)):
        walls.append(quad((0.0, b, 0.0), (0.0, b, z), (0.0, a, z), (0.0, a, 0.0)))
        walls.append(quad((x, a, 0.0), (x, a, z), (x, b, z), (x, b, 0.0)))
    return replace(windowed_room(), polygons=(*roof, *slab, *walls, *panes))


def _terrace() -> Case:
    x, y, _ = ROOM_M
    xs, ys = (-1.0, x + 1.0), (-2.0, y + 1.0)

    def light(condition: Condition) -> Condition:
        return sunlit(condition, SUN)

    whole = Lit(terrace_room(xs, ys), light)
    by_hand = Lit(terrace_room((xs[0], 0.0, x, xs[1]), (ys[0], 0.0, y, ys[1])), light)

    def check() -> Seen:
        return close(by_hand, whole, NOISE_SHARE)

    claim = Claim("as cut by hand", "the light of a slab in faces that end under the walls, within 3 %", check)
    return Case("slab that goes on outdoors under walls in pieces", GROUP, (*room_claims(whole), claim))


def louvre_room(count: int) -> Room:
    """Thin blades before the window, as many as fit."""
    x0, z0, x1, z1 = WINDOW_M
    pitch = (z1 - z0) / count
    blades = []
    for k in range(count):
        z = z0 + (k + 0.5) * pitch
        near, far = 0.01, 0.01 + 0.7 * pitch
        blades.append(quad((x0, near, z), (x1, near, z), (x1, far, z), (x0, far, z), "blade", "louvres"))
    return windowed_room().with_polygons(*blades).with_material("blade", "reflectance = 0.3")


def _louvres() -> Case:
    lit = Lit(louvre_room(1000), lambda condition: sunlit(condition, SUN))
    return Case("a thousand thin louvres", GROUP, (finite(lit), conserving(lit), methods_agree(lit)))


def column_room(smooth: bool, tilt_deg: float = 0.0, sides: int = 16) -> Room:
    """A round column as facets, with or without shading normals; tilt_deg turns these away from the true ones."""
    centre, radius, low, high = (2.0, 2.0), 0.4, 0.0, 2.0
    polygons = []
    tilt = math.radians(tilt_deg)
    for k in range(sides):
        a, b = 2 * math.pi * k / sides, 2 * math.pi * (k + 1) / sides
        (xa, ya), (xb, yb) = ((centre[0] + radius * math.cos(t), centre[1] + radius * math.sin(t)) for t in (a, b))
        normals: list[Point] = [(math.cos(t + tilt), math.sin(t + tilt), 0.0) for t in (a, b)]
        corners = ((xa, ya, low), (xb, yb, low), (xb, yb, high), (xa, ya, high))
        shading = (normals[0], normals[1], normals[1], normals[0]) if smooth else ()
        polygons.append(Polygon(corners, "column", "column", shading))
    lines = "reflectance = 0.6" + ("\nsmooth = true" if smooth else "")
    return windowed_room().with_polygons(*polygons).with_material("column", lines)


def _smooth() -> Case:
    def light(condition: Condition) -> Condition:
        return sunlit(condition, SUN)

    smooth, facets = Lit(column_room(True), light), Lit(column_room(False), light)
    crooked = Lit(column_room(True, tilt_deg=60.0), light)

    def check() -> Seen:
        return close(facets, smooth, 0.02)

    claim = Claim("smooth is facets on average", "shading normals change the room's light by at most 2 %", check)
    return Case(
        "smooth normals against facets",
        GROUP,
        (claim, *room_claims(smooth), replace(finite(crooked), name="finite with normals 60 degrees off")),
    )


def _refused() -> list[Case]:
    room = windowed_room()
    triangle = Polygon(((1.0, 2.0, 1.0), (2.0, 2.0, 1.0), (1.0, 3.0, 1.0)), "wall", "sail")
    twice = room.with_polygons(triangle, replace(triangle, object="copy"))
    back = room.with_polygons(triangle, replace(triangle, corners=triangle.corners[::-1], object="back"))
    flat = room.with_polygons(Polygon(((1.0, 2.0, 1.0), (2.0, 2.0, 1.0), (3.0, 2.0, 1.0)), "wall", "wire"))
    point = room.with_polygons(Polygon(((1.0, 2.0, 1.0),) * 3, "wall", "dot"))
    a, b, c, d = (1.0, 2.0, 1.0), (2.0, 2.0, 1.0), (2.0, 3.0, 1.0), (1.0, 3.0, 1.0)
    halves = room.with_polygons(quad(a, b, c, d, object="table"), Polygon((a, b, c), "wall", "cloth"))
    unlike = room.with_polygons(
        Polygon((a, b, c), "wall", "table"),
        Polygon((a, c, d), "wall", "table"),
        Polygon((b, c, d), "cloth", "cloth"),
        Polygon((b, d, a), "cloth", "cloth"),
    ).with_material("cloth", "reflectance = 0.2")
    open_wall = replace(room, polygons=room.polygons[:1] + room.polygons[2:])
    covered = replace(room, polygons=(*shell(without=()), *room.polygons[5:]))
    return [
        _error("duplicated triangle", twice, ("mesh.obj", "copy", "lies exactly on", "sail", "Delete")),
        _error("triangle and its back", back, ("mesh.obj", "back", "lies exactly on", "sail", "Delete")),
        _refused_by_engine("triangle on half of a quad", halves, ("cloth", "table", "in the plane of", "Delete")),
        _refused_by_engine(
            "square of two triangles on one cut the other way", unlike, ("cloth", "table", "in the plane of", "Delete")
        ),
        _error("triangle without area", flat, ("mesh.obj", "wire", "no area", "Delete")),
        _error("triangle that is a point", point, ("mesh.obj", "dot", "no area", "Delete")),
        _error("missing wall", open_wall, ("mesh.obj", "open wall", "Close the wall")),
        _error("wall across a window", covered, ("mesh.obj", "covered", "Cut the hole")),
        _solved(
            "quad with a repeated corner",
            room.with_polygons(Polygon((a, b, c, c), "wall", "sail")),
        ),
    ]


def _error(name: str, room: Room, words: Sequence[str]) -> Case:
    return Case(name, GROUP, (refused("refused", room.load, words),))


def _refused_by_engine(name: str, room: Room, words: Sequence[str]) -> Case:
    return Case(name, GROUP, (refused("refused", lambda: Lit(room).engine, ("scene.toml", *words)),))

"""Furniture: small solids of a few boxes, standing on z = 0 around the origin, each returned as its own mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mesh import Mesh, Point, horizontal

SINK_M = 0.002  # parts reach into what they touch by this much: no gap and no coplanar faces


def regular_polygon(count: int, radius_m: float, phase_deg: float = 0.0) -> list[tuple[float, float]]:
    """Corners of a regular polygon around the origin, counter-clockwise."""
    angles = np.radians(phase_deg) + 2 * np.pi * np.arange(count) / count
    return [(radius_m * float(np.cos(a)), radius_m * float(np.sin(a))) for a in angles]


def legs(mesh: Mesh, places: Sequence[tuple[float, float]], top_m: float, material: str, width_m: float = 0.04) -> None:
    """Square legs from just inside the floor to just inside the underside at top_m."""
    for x, y in places:
        half = width_m / 2
        mesh.box((x - half, y - half, -SINK_M), (x + half, y + half, top_m + SINK_M), material, "legs")


def desk(
    width_m: float,
    depth_m: float,
    height_m: float = 0.73,
    top: str = "desk_top",
    leg: str = "metal",
    screen: bool = True,
) -> Mesh:
    """Rectangular desk: top, four legs, and a modesty panel at the back (+y). The user sits at -y."""
    mesh, thick = Mesh(), 0.03
    x, y = width_m / 2, depth_m / 2
    mesh.box((-x, -y, height_m - thick), (x, y, height_m), top, "desk")
    legs(mesh, [(sx * (x - 0.06), sy * (y - 0.06)) for sx in (-1, 1) for sy in (-1, 1)], height_m - thick, leg)
    if screen:
        mesh.box((-x + 0.07, y - 0.07, 0.32), (x - 0.07, y - 0.05, height_m - thick + SINK_M), top, "panel")
    return mesh


def corner_desk(
    width_m: float, depth_m: float, wing_m: float, wing_width_m: float, top: str = "desk_top", leg: str = "desk_side"
) -> Mesh:
    """L-shaped desk: a main top (width x depth) and a wing of length wing_m towards -y on its left (-x) end."""
    mesh, height, thick = Mesh(), 0.73, 0.03
    x, y = width_m / 2, depth_m / 2
    us, vs = [-x, -x + wing_width_m, x], [-y - wing_m, -y, y]
    mesh.plate(us, vs, height - thick, height, horizontal, top, "desk", frozenset({(1, 0)}))
    under = height - thick + SINK_M
    mesh.box((x - 0.06, -y + 0.04, -SINK_M), (x - 0.03, y - 0.04, under), leg, "side")
    mesh.box(
        (-x + 0.04, -y - wing_m + 0.03, -SINK_M), (-x + wing_width_m - 0.04, -y - wing_m + 0.06, under), leg, "side"
    )
    mesh.box((-x + 0.04, y - 0.12, -SINK_M), (x - 0.058, y - 0.1, under), leg, "panel")
    return mesh


def slab_desk(
    width_m: float,
    depth_m: float,
    height_m: float = 0.73,
    top: str = "desk_top",
    leg: str = "desk_side",
    panel: bool = True,
) -> Mesh:
    """Desk of a top between two slab sides, with a modesty panel at the back (+y) if asked for."""
    mesh, thick = Mesh(), 0.03
    x, y = width_m / 2, depth_m / 2
    mesh.box((-x, -y, height_m - thick), (x, y, height_m), top, "desk")
    for sx in (-1, 1):
        low, high = sorted((sx * (x - 0.03), sx * (x - 0.06)))
        mesh.box((low, -y + 0.04, -SINK_M), (high, y - 0.04, height_m - thick + SINK_M), leg, "side")
    if panel:
        mesh.box((-x + 0.058, y - 0.12, 0.3), (x - 0.058, y - 0.1, height_m - thick + SINK_M), leg, "panel")
    return mesh


def cabinet(width_m: float, height_m: float, depth_m: float, door_count: int, material: str) -> Mesh:
    """Low cabinet: a body and doors that stand proud of it, facing -y."""
    mesh, x, y = Mesh(), width_m / 2, depth_m / 2
    mesh.box((-x, -y, -SINK_M), (x, y, height_m), material, "cabinet")
    step = width_m / door_count
    for n in range(door_count):
        left = -x + n * step
        mesh.box(
            (left + 0.008, -y - 0.018, 0.06), (left + step - 0.008, -y + SINK_M, height_m - 0.02), material, "cabinet"
        )
    return mesh


def drawers(width_m: float = 0.42, depth_m: float = 0.55, height_m: float = 0.58, material: str = "cabinet") -> Mesh:
    """Drawer unit: a body and two fronts that stand proud of it, facing -y."""
    mesh = Mesh()
    x, y = width_m / 2, depth_m / 2
    mesh.box((-x, -y, -SINK_M), (x, y, height_m), material, "drawers")
    for low, high in ((0.03, 0.36 * height_m), (0.36 * height_m + 0.015, height_m - 0.02)):
        mesh.box((-x + 0.01, -y - 0.015, low), (x - 0.01, -y + SINK_M, high), material, "drawers")
    return mesh


def table(outline: list[tuple[float, float]], height_m: float, top: str, leg: str, foot_m: float) -> Mesh:
    """Table with a prism top on a central column and a square foot (round and octagonal tables)."""
    mesh, thick, half = Mesh(), 0.035, foot_m / 2
    mesh.prism(outline, height_m - thick, height_m, top, "table")
    mesh.box((-0.045, -0.045, 0.02 - SINK_M), (0.045, 0.045, height_m - thick + SINK_M), leg, "table")
    mesh.box((-half, -half, -SINK_M), (half, half, 0.02), leg, "table")
    return mesh


def chair(seat: str = "fabric", leg: str = "metal") -> Mesh:
    """Chair with four legs, a seat and a leaning back; the sitter looks towards +y."""
    mesh = Mesh()
    mesh.box((-0.22, -0.22, 0.42), (0.22, 0.22, 0.47), seat, "chair")
    legs(mesh, [(-0.19, -0.19), (0.19, -0.19), (-0.19, 0.19), (0.19, 0.19)], 0.42, leg, 0.03)
    for x in (-0.16, 0.16):
        _leaning(mesh, x - 0.015, x + 0.015, 0.44, 0.86, 0.018, leg)
    _leaning(mesh, -0.21, 0.21, 0.56, 0.90, 0.034, seat)
    return mesh


def pedestal_chair(seat: str = "fabric", leg: str = "metal") -> Mesh:
    """Chair of four solids: seat, leaning back, column and square foot; the sitter looks towards +y."""
    mesh = Mesh()
    mesh.box((-0.23, -0.23, 0.41), (0.23, 0.23, 0.47), seat, "chair")
    _leaning(mesh, -0.21, 0.21, 0.45, 0.88, 0.045, seat)
    mesh.box((-0.035, -0.035, 0.03 - SINK_M), (0.035, 0.035, 0.41 + SINK_M), leg, "chair")
    mesh.box((-0.2, -0.2, -SINK_M), (0.2, 0.2, 0.03), leg, "chair")
    return mesh


def _leaning(mesh: Mesh, x0: float, x1: float, z0: float, z1: float, thick: float, material: str) -> None:
    """A slab of a chair back: leans 12 degrees backwards (-y) about the rear edge of the seat."""
    lean = float(np.tan(np.radians(12)))

    def place(u: float, v: float, w: float) -> Point:
        return (u, -0.2 - lean * (v - 0.44) + w, v)

    mesh.plate([x0, x1], [z0, z1], -thick / 2, thick / 2, place, material, "chair")


def monitor(stand: str = "metal", screen: str = "screen") -> Mesh:
    """Flat monitor on a slab stand, its screen towards -y; placed at desk-top height."""
    mesh = Mesh()
    mesh.box((-0.09, -0.02, -SINK_M), (0.09, 0.06, 0.3), stand, "monitor")
    mesh.box((-0.27, -0.045, 0.1), (0.27, -0.02 + SINK_M, 0.43), screen, "monitor")
    return mesh


def shelf(
    width_m: float, height_m: float, depth_m: float, level_count: int, material: str, books: Sequence[str], seed: int
) -> Mesh:
    """Bookshelf open towards -y: a frame of cells, a back, and blocks of books of varied width and height."""
    mesh, board = Mesh(), 0.025
    rng = np.random.default_rng(seed)
    x = width_m / 2

    def upright(u: float, v: float, w: float) -> Point:
        return (u, w, v)

    step = (height_m - board) / level_count
    zs = [-SINK_M, board]
    for level in range(1, level_count + 1):
        zs += [level * step, level * step + board]
    us = [-x, -x + board, -board / 2, board / 2, x - board, x]
    cells = frozenset((c, 2 * level + 1) for c in (1, 3) for level in range(level_count))
    mesh.plate(us, zs, -depth_m / 2, depth_m / 2, upright, material, "shelf", cells)
    mesh.box(
        (-x + SINK_M, depth_m / 2 - 0.012, SINK_M),
        (x - SINK_M, depth_m / 2 - 0.003, height_m - SINK_M),
        material,
        "shelf",
    )
    for c, level in sorted(cells):
        if rng.random() < 0.2:
            continue
        left, right, z = us[c] + 0.01, us[c + 1] - 0.01, zs[level]
        for _ in range(3):
            width = float(rng.uniform(0.08, 0.2))
            if left + width > right:
                break
            tall = float(rng.uniform(0.6, 0.86)) * step
            colour = books[int(rng.integers(len(books)))]
            mesh.box((left, -0.07, z - SINK_M), (left + width, depth_m / 2 - 0.05, z + tall), colour, "books")
            left += width + 0.004
    return mesh


def partition(length_m: float, height_m: float, cloth: str = "partition", thick_m: float = 0.06) -> Mesh:
    """Low partition along x from 0 to length_m; it reaches into the floor."""
    mesh, half = Mesh(), thick_m / 2
    mesh.box((0, -half, -2 * SINK_M), (length_m, half, height_m), cloth, "partition")
    return mesh


def door(width_m: float = 0.95, height_m: float = 2.1, leaf: str = "door", frame: str = "frame") -> Mesh:
    """Closed door on a wall whose face is y = 0 (room towards -y): casing and leaf stand proud, set into the wall."""
    mesh, x = Mesh(), width_m / 2

    def upright(u: float, v: float, w: float) -> Point:
        return (u, w, v)

    casing = [-x - 0.08, -x, x, x + 0.08]
    mesh.plate(casing, [-SINK_M, height_m, height_m + 0.08], -0.03, SINK_M, upright, frame, "door", frozenset({(1, 0)}))
    mesh.box((-x - SINK_M, -0.015, 0.004), (x + SINK_M, SINK_M, height_m + SINK_M), leaf, "door")
    mesh.box((x - 0.16, -0.06, 1.0), (x - 0.04, -0.013, 1.03), "metal", "door")
    return mesh


def picture(width_m: float, height_m: float, frame: str, canvas: str) -> Mesh:
    """Framed picture on a wall whose face is y = 0 (room towards -y), centred at the origin."""
    mesh, x, z = Mesh(), width_m / 2, height_m / 2

    def upright(u: float, v: float, w: float) -> Point:
        return (u, w, v)

    mesh.plate(
        [-x, -x + 0.04, x - 0.04, x],
        [-z, -z + 0.04, z - 0.04, z],
        -0.035,
        SINK_M,
        upright,
        frame,
        "picture",
        frozenset({(1, 1)}),
    )
    mesh.box((-x + 0.038, -0.02, -z + 0.038), (x - 0.038, SINK_M, z - 0.038), canvas, "picture")
    return mesh

"""deflector_house: a living space with a long curved wall, skylights over a curved blue deflector, a west window."""

from itertools import pairwise

import numpy as np
from furniture import SINK_M, chair, regular_polygon, shelf, table
from mesh import Mesh, Point
from numpy.typing import NDArray
from room import Shell, glaze, on_roof, on_west_wall

HEIGHT_M = 3.4
RADIUS_X_M, RADIUS_Y_M, SPRING_Y_M = 10.0, 4.4, 2.4  # the north wall: a quarter of an ellipse about (0, SPRING_Y_M)
ROWS_Y_M = (0.0, 0.9, 3.6, 4.6)  # west window between the 2nd and the 3rd line, skylights between the 3rd and the 4th
SKYLIGHT_XS = ((0.9, 2.1), (2.7, 3.9), (4.5, 5.7))
STRAIGHT_XS = (0.0, 0.9, 2.1, 2.7, 3.9, 4.5, 5.7, 6.4)  # columns of the plan that run due north
SILL_M, HEAD_M = 0.4, 2.9


def build() -> Mesh:
    """The mesh of the scene."""
    mesh = Mesh()
    plan, north_normals = _plan()
    shell = Shell(plan, [0, SILL_M, HEAD_M, HEIGHT_M], roof_thickness_m=0.35)
    shell.smooth_sides = {"north": north_normals}
    shell.materials = {"floor": "floor", "ceiling": "ceiling", "exterior": "exterior", "wall_north": "wall_curved"}
    shell.cut("west", range(1, 2), range(1, 2))
    window = (ROWS_Y_M[1], SILL_M, ROWS_Y_M[2], HEAD_M)
    glaze(mesh, on_west_wall, shell.wall_thickness_m, window, 3, [("glass_window", 1.0)], "west", 0.07)
    for n, (x0, x1) in enumerate(SKYLIGHT_XS):
        shell.cut("roof", range(2 * n + 1, 2 * n + 2), range(2, 3))
        hole = (x0, ROWS_Y_M[2], x1, ROWS_Y_M[3])
        glaze(mesh, on_roof(shell), shell.roof_thickness_m, hole, 1, [("glass_skylight", 1.0)], f"skylight_{n + 1}")
    shell.build(mesh)
    _deflector(mesh)
    _furniture(mesh)
    return mesh


def _plan() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Plan grid (columns, rows + 1, 2) and the inward normals of the north wall, one a column.

    Columns run due north as far as the skylights reach; beyond, they fan out from evenly spaced points of the south
    wall to points of the ellipse that turn by equal angles.
    """
    turn = np.radians(np.arange(25.0, 81.0, 5.0))  # slope angle of the ellipse
    angle = np.concatenate(
        [np.arcsin(np.asarray(STRAIGHT_XS) / RADIUS_X_M), np.arctan(np.tan(turn) * RADIUS_X_M / RADIUS_Y_M)]
    )
    top = np.stack([RADIUS_X_M * np.sin(angle), SPRING_Y_M + RADIUS_Y_M * np.cos(angle)], axis=-1)
    fan = np.linspace(STRAIGHT_XS[-1], top[-1, 0], len(turn) + 1)[1:]
    bottom_x = np.concatenate([STRAIGHT_XS, fan])
    plan = np.zeros((len(angle), len(ROWS_Y_M) + 1, 2))
    reach = top[len(STRAIGHT_XS) - 1, 1]
    for row, y in enumerate(ROWS_Y_M):
        share = np.where(np.arange(len(angle)) < len(STRAIGHT_XS), y / top[:, 1], y / reach)
        plan[:, row, 0] = bottom_x + share * (top[:, 0] - bottom_x)
        plan[:, row, 1] = share * top[:, 1]
    plan[:, -1] = top
    normals = -np.stack([np.sin(angle) / RADIUS_X_M, np.cos(angle) / RADIUS_Y_M], axis=-1)
    return plan, normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def _deflector(mesh: Mesh) -> None:
    """A single curved sheet under the skylights, low in the south and steep in the north, on four rods."""
    arc = np.radians(np.linspace(4, 84, 11))
    ys, zs = 3.45 + 1.9 * np.sin(arc), 2.2 + 1.0 * (1 - np.cos(arc))
    normals = np.stack([-1.0 * np.sin(arc), 1.9 * np.cos(arc)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    xs = np.linspace(0.6, 6.0, 7)
    for x0, x1 in pairwise(xs):
        for k in range(len(arc) - 1):
            corners: list[Point] = [
                (x0, ys[k], zs[k]),
                (x1, ys[k], zs[k]),
                (x1, ys[k + 1], zs[k + 1]),
                (x0, ys[k + 1], zs[k + 1]),
            ]
            shading: list[Point] = [(0.0, *normals[n]) for n in (k, k, k + 1, k + 1)]
            mesh.quad(corners, (0, -0.5, 1), "deflector", "deflector", None, shading)
    for n, x in enumerate((2.4, 4.2)):
        for y, z in ((3.9, 2.22), (5.0, 2.6)):
            mesh.box((x - 0.012, y - 0.012, z), (x + 0.012, y + 0.012, HEIGHT_M + SINK_M), "metal", f"rod_{n + 1}")


def _furniture(mesh: Mesh) -> None:
    _sofa(mesh, "sofa_1", (5.2, 1.25, 0), 0, 2.3)
    _sofa(mesh, "sofa_2", (7.9, 2.6, 0), 100, 1.0)
    mesh.box((4.0, 1.3, -SINK_M), (7.2, 4.1, 0.012), "rug", "rug")
    mesh.add(table(regular_polygon(12, 0.55), 0.38, "oak", "metal", 0.45), (5.6, 2.75, 0.01), object_name="table_low")
    mesh.add(table(regular_polygon(16, 0.65), 0.74, "oak", "metal", 0.5), (2.2, 5.35, 0), object_name="table_dining")
    for n, angle in enumerate((15, 130, 250), 1):
        x, y = regular_polygon(1, 0.88, angle)[0]
        mesh.add(chair("oak", "oak"), (2.2 + x, 5.35 + y, 0), angle + 90, f"chair_{n}")
    books = ["book_red", "book_blue", "book_cream"]
    mesh.add(shelf(2.6, 0.85, 0.34, 2, "oak", books, 7), (2.6, 0.175, 0), 180, "shelf")


def _sofa(mesh: Mesh, name: str, at: Point, turn_deg: float, width_m: float) -> None:
    """Sofa facing +y: base, seat cushions, back, arms."""
    piece, x = Mesh(), width_m / 2
    piece.box((-x, -0.42, 0.08), (x, 0.42, 0.28), "sofa", name)
    for sx in (-1, 1):
        for y in (-0.36, 0.36):
            piece.box(
                (sx * (x - 0.08) - 0.03, y - 0.03, -SINK_M),
                (sx * (x - 0.08) + 0.03, y + 0.03, 0.08 + SINK_M),
                "oak",
                name,
            )
        low, high = sorted((sx * x, sx * (x - 0.16)))
        piece.box((low - 0.004, -0.424, 0.08 - 0.004), (high + 0.004, 0.424, 0.58), "sofa", name)
    count = max(1, round((width_m - 0.32) / 0.7))
    seat = (width_m - 0.32) / count
    for n in range(count):
        left = -x + 0.16 + n * seat
        piece.box((left + 0.012, -0.25, 0.28 - SINK_M), (left + seat - 0.012, 0.43, 0.43), "cushion", name)
        piece.box((left + 0.016, -0.28, 0.42), (left + seat - 0.016, -0.12, 0.8), "cushion", name)
    piece.box((-x, -0.416, 0.28 - SINK_M), (x, -0.26, 0.74), "sofa", name)
    mesh.add(piece, (at[0], at[1], at[2]), turn_deg, name)

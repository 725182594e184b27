"""Room shells with thickness, and the frames and panes that fill their holes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from mesh import Mesh, Place, Point
from numpy.typing import NDArray

FRAME_DEPTH_M = 0.06
FRAME_INSET_M = 0.01  # outer face of the frame behind the outer face of the wall
PANE_INSET_M = 0.03  # pane behind the outer face of the wall
FRAME_PENETRATION_M = 0.002  # the frame reaches into the wall by this much: no gap, no coplanar faces


@dataclass
class Shell:
    """One closed solid around a room: floor slab, roof slab and walls, with holes through them.

    plan: (columns, rows, 2) inner corner points of a grid that fills the floor; the four borders of the grid are the
    walls (row 0 south, last row north, column 0 west, last column east), straight or curved. heights: z lines of the
    walls, from floor to ceiling. All inner faces follow this grid, so that floor, walls and ceiling share vertices.
    smooth_sides: for a curved wall, the inward unit normals (columns, 2) at its corner points.
    materials: material by object name (floor, ceiling, wall_<side>, reveal, exterior); "wall" where none is given.
    holes: (side, cell): side "south", "north", "west" or "east" with cell (along, height), or "roof" (column, row).
    """

    plan: NDArray[np.float64]
    heights: Sequence[float]
    wall_thickness_m: float = 0.3
    slab_thickness_m: float = 0.3
    roof_thickness_m: float = 0.35
    holes: set[tuple[str, tuple[int, int]]] = field(default_factory=set)
    smooth_sides: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    materials: dict[str, str] = field(default_factory=dict)

    def cut(self, side: str, along: range, across: range) -> None:
        """Cut a hole through the cells along x across of a wall (across: height cells) or of the roof (rows)."""
        self.holes |= {(side, (a, b)) for a in along for b in across}

    def build(self, mesh: Mesh) -> None:
        """Add the shell. Objects: floor, ceiling, wall_<side>, exterior; materials: by the same names, else "wall"."""
        solid = mesh.new_solid()
        columns, rows = self.plan.shape[:2]
        outer_plan = self._outer_plan()
        top, last = self.heights[-1], len(self.heights) - 1
        outer_z = [-self.slab_thickness_m, *self.heights[1:-1], top + self.roof_thickness_m]

        def inner(i: int, j: int, k: int) -> Point:
            return (float(self.plan[i, j, 0]), float(self.plan[i, j, 1]), float(self.heights[k]))

        def outer(i: int, j: int, k: int) -> Point:
            return (float(outer_plan[i, j, 0]), float(outer_plan[i, j, 1]), float(outer_z[k]))

        grids: dict[str, tuple[int, int, Callable[[int, int], tuple[int, int, int]]]] = {
            "floor": (columns - 1, rows - 1, lambda a, b: (a, b, 0)),
            "roof": (columns - 1, rows - 1, lambda a, b: (a, b, last)),
            "south": (columns - 1, last, lambda a, b: (a, 0, b)),
            "north": (columns - 1, last, lambda a, b: (a, rows - 1, b)),
            "west": (rows - 1, last, lambda a, b: (0, a, b)),
            "east": (rows - 1, last, lambda a, b: (columns - 1, a, b)),
        }
        thickness = {"floor": self.slab_thickness_m, "roof": self.roof_thickness_m}
        for side, (count_a, count_b, index) in grids.items():
            name = {"floor": "floor", "roof": "ceiling"}.get(side, f"wall_{side}")
            material = self.materials.get(name, "wall")
            seat = 1 - (FRAME_DEPTH_M + FRAME_INSET_M) / thickness.get(side, self.wall_thickness_m)
            for a in range(count_a):
                for b in range(count_b):
                    ring = [index(*c) for c in ((a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1))]
                    inside, outside = [inner(*c) for c in ring], [outer(*c) for c in ring]
                    outwards = np.mean(outside, axis=0) - np.mean(inside, axis=0)
                    if (side, (a, b)) not in self.holes:
                        normals: tuple[Point, ...] = ()
                        if side in self.smooth_sides:
                            normals = tuple((*self.smooth_sides[side][c], 0.0) for c in (a, a + 1, a + 1, a))
                        mesh.quad(inside, -outwards, material, name, solid, normals)
                        mesh.quad(outside, outwards, self.materials.get("exterior", "wall"), "exterior", solid)
                        continue
                    centre = np.mean(inside, axis=0)
                    for n, (da, db) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
                        if (side, (a + da, b + db)) in self.holes:
                            continue
                        p, q, po, qo = inside[n], inside[(n + 1) % 4], outside[n], outside[(n + 1) % 4]
                        ps, qs = _between(p, po, seat), _between(q, qo, seat)
                        towards = centre - np.mean([p, q], axis=0)
                        reveal = self.materials.get("reveal", material)
                        mesh.quad([p, q, qs, ps], towards, reveal, f"reveal_{side}", solid)
                        mesh.quad([ps, qs, qo, po], towards, reveal, f"reveal_{side}", solid)

    def _outer_plan(self) -> NDArray[np.float64]:
        """Plan of the outer faces: border points moved outwards by the wall thickness (mitred), inner points kept."""
        result = self.plan.copy()
        columns, rows = self.plan.shape[:2]
        border = (
            [(i, 0) for i in range(columns - 1)]
            + [(columns - 1, j) for j in range(rows - 1)]
            + [(i, rows - 1) for i in range(columns - 1, 0, -1)]
            + [(0, j) for j in range(rows - 1, 0, -1)]
        )
        for n, here in enumerate(border):
            before, after = self.plan[border[n - 1]], self.plan[border[(n + 1) % len(border)]]
            normals = [_right_normal(self.plan[here] - before), _right_normal(after - self.plan[here])]
            mitre = (normals[0] + normals[1]) / (1 + float(np.dot(*normals)))
            result[here] = self.plan[here] + self.wall_thickness_m * mitre
        return result


def box_plan(xs: Sequence[float], ys: Sequence[float]) -> NDArray[np.float64]:
    """Plan grid of a rectangular room from its x and y lines."""
    return np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).astype(float)


def on_south_wall(u: float, v: float, w: float) -> Point:
    """Window coordinates on a south wall at y = 0: u east, v up, w outwards from the inner face."""
    return (u, -w, v)


def on_west_wall(u: float, v: float, w: float) -> Point:
    """Window coordinates on a west wall at x = 0: u north, v up, w outwards from the inner face."""
    return (-w, u, v)


def on_roof(shell: Shell) -> Place:
    """Skylight coordinates on the roof: u east, v north, w upwards from the ceiling."""
    return lambda u, v, w: (u, v, shell.heights[-1] + w)


def glaze(
    mesh: Mesh,
    place: Place,
    thickness_m: float,
    hole: tuple[float, float, float, float],
    column_count: int,
    row_glasses: Sequence[tuple[str, float]],
    object_name: str,
    bar_m: float = 0.06,
    frame_material: str = "frame",
) -> None:
    """Fill a hole (u0, v0, u1, v1) with a frame of bars and one pane a cell, panes' fronts outdoors.

    row_glasses: (glass material, share of the glazed height) for every row of panes, from the bottom.
    """
    u0, v0, u1, v1 = hole
    pane_width = (u1 - u0 - bar_m * (column_count + 1)) / column_count
    glazed_height = v1 - v0 - bar_m * (len(row_glasses) + 1)
    us, vs = [u0 - FRAME_PENETRATION_M], [v0 - FRAME_PENETRATION_M]
    for c in range(column_count):
        left = u0 + bar_m + c * (pane_width + bar_m)
        us += [left, left + pane_width]
    bottom = v0 + bar_m
    for _, share in row_glasses:
        vs += [bottom, bottom + share * glazed_height]
        bottom = vs[-1] + bar_m
    us.append(u1 + FRAME_PENETRATION_M)
    vs.append(v1 + FRAME_PENETRATION_M)
    cells = frozenset((2 * c + 1, 2 * r + 1) for c in range(column_count) for r in range(len(row_glasses)))
    w1 = thickness_m - FRAME_INSET_M
    mesh.plate(us, vs, w1 - FRAME_DEPTH_M, w1, place, frame_material, f"frame_{object_name}", cells)
    outwards = np.subtract(place(0, 0, 1), place(0, 0, 0))
    w = thickness_m - PANE_INSET_M
    for i, j in sorted(cells):
        corners = [
            place(u, v, w) for u, v in ((us[i], vs[j]), (us[i + 1], vs[j]), (us[i + 1], vs[j + 1]), (us[i], vs[j + 1]))
        ]
        glass = row_glasses[j // 2][0]
        mesh.quad(corners, outwards, glass, f"pane_{object_name}_{i // 2 + 1}_{j // 2 + 1}", None)


def _between(p: Point, q: Point, share: float) -> Point:
    x, y, z = (a + share * (b - a) for a, b in zip(p, q, strict=True))
    return (x, y, z)


def _right_normal(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([direction[1], -direction[0]]) / float(np.linalg.norm(direction))

"""partition_office: low partitions and a dozen varied desks and tables, west windows in two rows, four skylights."""

from furniture import (
    SINK_M,
    cabinet,
    corner_desk,
    door,
    drawers,
    monitor,
    partition,
    pedestal_chair,
    regular_polygon,
    slab_desk,
    table,
)
from mesh import Mesh
from room import Shell, box_plan, glaze, on_roof, on_west_wall

WIDTH_M, DEPTH_M, HEIGHT_M = 12.0, 9.0, 3.0
WINDOW_YS = ((0.9, 2.9), (3.5, 5.5), (6.1, 8.1))
SILL_M, HEAD_M = 0.8, 2.6
SKYLIGHT_XS = ((4.3, 5.7), (8.4, 9.8))


def build() -> Mesh:
    """The mesh of the scene."""
    mesh = Mesh()
    xs = [0.0, *(x for pair in SKYLIGHT_XS for x in pair), WIDTH_M]
    ys = [0.0, *(y for pair in WINDOW_YS for y in pair), DEPTH_M]
    shell = Shell(box_plan(xs, ys), [0, SILL_M, HEAD_M, HEIGHT_M], roof_thickness_m=0.4)
    shell.materials = {"floor": "carpet", "ceiling": "ceiling", "exterior": "exterior"}
    glasses = [("glass_lower", 0.6), ("glass_upper", 0.4)]
    for n, (y0, y1) in enumerate(WINDOW_YS):
        shell.cut("west", range(2 * n + 1, 2 * n + 2), range(1, 2))
        hole = (y0, SILL_M, y1, HEAD_M)
        glaze(mesh, on_west_wall, shell.wall_thickness_m, hole, 1, glasses, f"west_{n + 1}")
    for m, (x0, x1) in enumerate(SKYLIGHT_XS):
        for n in (0, 2):
            y0, y1 = WINDOW_YS[n]
            shell.cut("roof", range(2 * m + 1, 2 * m + 2), range(2 * n + 1, 2 * n + 2))
            name = f"skylight_{2 * m + n // 2 + 1}"
            glaze(mesh, on_roof(shell), shell.roof_thickness_m, (x0, y0, x1, y1), 1, [("glass_skylight", 1.0)], name)
    shell.build(mesh)
    _cubicles(mesh)
    _tables(mesh)
    mesh.add(door(), (WIDTH_M, 4.6, 0), -90, "door")
    return mesh


def _cubicles(mesh: Mesh) -> None:
    """Two clusters of workplaces around crossed partitions in the southern half."""
    for name, x, y, length in (("a", 3.5, 2.55, 4.2), ("b", 8.6, 2.35, 4.4)):
        mesh.add(partition(length, 1.32), (x - length / 2, y, 0), 0, f"partition_{name}_1")
        mesh.add(partition(1.75, 1.3), (x, y + 0.025, 0), 90, f"partition_{name}_2")
        mesh.add(partition(1.75, 1.3), (x, y - 0.025, 0), -90, f"partition_{name}_3")
    desks = [  # piece, position of its centre, turn, chair position and turn (no chair: None)
        (corner_desk(1.7, 0.75, 0.75, 0.6), (2.5, 2.05), 0, (2.65, 1.35, 12)),
        (corner_desk(1.7, 0.75, 0.7, 0.6, "desk_top_dark"), (4.55, 3.05), 180, (4.35, 3.75, 190)),
        (slab_desk(1.5, 0.75), (4.5, 2.05), 0, (4.45, 1.45, -14)),
        (slab_desk(1.4, 0.7, top="desk_top_dark"), (2.5, 3.05), 180, (2.35, 3.65, 170)),
        (corner_desk(1.8, 0.8, 0.8, 0.65), (7.55, 1.85), 0, (7.7, 1.1, 8)),
        (corner_desk(1.6, 0.7, 0.7, 0.6), (9.55, 2.8), 180, (9.4, 3.45, 165)),
        (slab_desk(1.6, 0.8, top="desk_top_dark"), (9.7, 1.85), 0, None),
        (slab_desk(1.5, 0.7), (7.5, 2.8), 180, None),
    ]
    for n, (piece, (x, y), turn, seat) in enumerate(desks, 1):
        mesh.add(piece, (x, y, 0), turn, f"desk_{n}")
        side = 1 if turn == 180 else -1
        if seat:
            mesh.add(pedestal_chair("fabric" if n % 3 else "fabric_warm"), (seat[0], seat[1], 0), seat[2], f"chair_{n}")
            at = (x + 0.25 * side, y - 0.16 * side, 0.73)
            mesh.add(monitor(), at, turn + (8 if n % 2 else -6), f"monitor_{n}")
    for n, (x, y, turn) in enumerate(((4.94, 2.1, 0),), 1):
        mesh.add(drawers(), (x, y, 0), turn, f"drawers_{n}")


def _tables(mesh: Mesh) -> None:
    """Meeting tables, a long bench table, side tables, a standing table and cabinets in the northern half."""
    mesh.add(
        table(regular_polygon(12, 0.75), 0.74, "desk_top", "metal", 0.55), (2.0, 6.6, 0), object_name="table_round"
    )
    for n, angle in enumerate((20, 140, 260), 1):
        x, y = regular_polygon(1, 1.0, angle)[0]
        mesh.add(pedestal_chair("fabric_warm"), (2.0 + x, 6.6 + y, 0), angle + 90, f"chair_round_{n}")
    mesh.add(slab_desk(3.0, 1.1, 0.74, panel=False), (6.3, 6.7, 0), 0, "table_long")
    for n, (x, y, turn) in enumerate(((5.6, 5.95, 4), (6.9, 5.9, -6), (6.3, 7.5, 176)), 1):
        mesh.add(pedestal_chair(), (x, y, 0), turn, f"chair_long_{n}")
    octagon = table(regular_polygon(8, 0.65, 22.5), 0.74, "desk_top_dark", "metal", 0.5)
    mesh.add(octagon, (10.2, 6.9, 0), object_name="table_octagon")
    mesh.add(pedestal_chair("fabric_warm"), (9.35, 6.75, 0), -80, "chair_octagon_1")
    mesh.add(
        table(regular_polygon(10, 0.35), 1.05, "desk_top", "metal", 0.4), (5.9, 4.5, 0), object_name="table_standing"
    )
    mesh.add(slab_desk(0.6, 0.6, 0.5, "desk_top_dark", panel=False), (11.4, 3.1, 0), 0, "table_side_1")
    mesh.add(slab_desk(0.9, 0.5, 0.45, panel=False), (3.9, 8.3, 0), 0, "table_side_2")
    mesh.add(cabinet(2.4, 1.1, 0.4, 3, "cabinet"), (6.6, DEPTH_M - 0.2 + SINK_M, 0), 0, "cabinet_1")
    mesh.add(cabinet(1.6, 1.1, 0.4, 2, "cabinet"), (9.9, DEPTH_M - 0.2 + SINK_M, 0), 0, "cabinet_2")

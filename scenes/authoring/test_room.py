"""test_room: a small room, six panes in two rows of three in the south facade, a dark far corner."""

from furniture import SINK_M, chair, desk, door, picture, regular_polygon, table
from mesh import Mesh
from room import Shell, box_plan, glaze, on_south_wall

WIDTH_M, DEPTH_M, HEIGHT_M = 5.0, 6.0, 3.0
WINDOW = (1.5, 0.9, 4.3, 2.6)  # x0, z0, x1, z1 of the hole


def build() -> Mesh:
    """The mesh of the scene."""
    mesh = Mesh()
    x0, z0, x1, z1 = WINDOW
    shell = Shell(box_plan([0, x0, x1, WIDTH_M], [0, DEPTH_M]), [0, z0, z1, HEIGHT_M])
    shell.materials = {"floor": "floor", "ceiling": "ceiling", "exterior": "exterior"}
    shell.cut("south", range(1, 2), range(1, 2))
    shell.build(mesh)
    glasses = [("glass_lower", 0.54), ("glass_upper", 0.46)]
    glaze(mesh, on_south_wall, shell.wall_thickness_m, WINDOW, 3, glasses, "south")

    mesh.add(door(), (3.9, DEPTH_M, 0), object_name="door")
    mesh.add(picture(1.2, 0.8, "metal", "canvas"), (0, 3.4, 1.55), 90, "picture")
    mesh.add(desk(1.5, 0.75, screen=False), (4.4, 2.6, 0), -90, "table_desk")
    mesh.add(chair(), (3.75, 2.65, 0), -78, "chair_1")
    mesh.add(table(regular_polygon(12, 0.32), 0.5, "desk_top", "metal", 0.3), (0.75, 4.9, 0), object_name="table_round")
    mesh.add(chair(), (2.3, 5.65, 0), 180, "chair_2")
    mesh.box((0.0 - SINK_M, 1.0, -SINK_M), (0.42, 2.8, 0.44), "cabinet", "bench")
    return mesh

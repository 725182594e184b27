"""desk_office: one south window whose upper third is a separate pane, and three desks in a row away from it."""

from furniture import chair, desk, door, drawers, monitor, picture, shelf
from mesh import Mesh
from room import Shell, box_plan, glaze, on_south_wall

WIDTH_M, DEPTH_M, HEIGHT_M = 4.4, 8.0, 3.0
WINDOW = (0.8, 0.85, 3.6, 2.71)
DESK_Y_M = (1.35, 3.75, 6.15)
BOOKS = ["book_red", "book_green", "book_blue", "book_cream"]


def build() -> Mesh:
    """The mesh of the scene."""
    mesh = Mesh()
    x0, z0, x1, z1 = WINDOW
    shell = Shell(box_plan([0, x0, x1, WIDTH_M], [0, DEPTH_M]), [0, z0, z1, HEIGHT_M])
    shell.materials = {"floor": "floor", "ceiling": "ceiling", "exterior": "exterior"}
    shell.cut("south", range(1, 2), range(1, 2))
    shell.build(mesh)
    glasses = [("glass_view", 2 / 3), ("glass_transom", 1 / 3)]
    glaze(mesh, on_south_wall, shell.wall_thickness_m, WINDOW, 2, glasses, "south")

    for number, y in enumerate(DESK_Y_M, 1):  # desks along the west wall; the sitter faces west, light from the side
        mesh.add(desk(1.7, 0.8), (0.95, y, 0), 90, f"desk_{number}")
        mesh.add(drawers(), (0.85, y + 0.55, 0), 90, f"drawers_{number}")
        mesh.add(chair(), (1.72, y - 0.05 * number, 0), 82 + 9 * number, f"chair_{number}")
        mesh.add(monitor(), (0.74, y - 0.42, 0.73), 90, f"monitor_{number}")
    for number, y in enumerate((2.55, 4.95), 1):
        mesh.add(shelf(1.6, 2.0, 0.34, 5, "shelf", BOOKS, number), (WIDTH_M - 0.175, y, 0), -90, f"shelf_{number}")
    mesh.add(door(), (3.3, DEPTH_M, 0), object_name="door")
    mesh.add(picture(1.4, 0.9, "metal", "canvas"), (0, 4.95, 1.7), 90, "picture")
    return mesh

"""cube, furnace and three_tone: closed single-sheet boxes whose fronts look into the room; answers are known."""

from mesh import Mesh, Point


def build_cube() -> Mesh:
    """CUBE: a 10 m cube about the origin."""
    return _box((-5, -5, -5), (5, 5, 5), dict.fromkeys(SIDES, "grey"))


def build_furnace() -> Mesh:
    """A closed box that glows uniformly."""
    return _box((0, 0, 0), (4, 3, 2.5), dict.fromkeys(SIDES, "glowing"))


def build_three_tone() -> Mesh:
    """A closed box of unequal reflectances under a luminous ceiling."""
    return _box((0, 0, 0), (4, 3, 2.5), dict.fromkeys(SIDES, "wall") | {"floor": "floor", "ceiling": "ceiling"})


SIDES = {  # side: corner choices (0 low, 1 high) and the direction its front faces
    "floor": (((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), (0, 0, 1)),
    "ceiling": (((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)), (0, 0, -1)),
    "wall_south": (((0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)), (0, 1, 0)),
    "wall_north": (((0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)), (0, -1, 0)),
    "wall_west": (((0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)), (1, 0, 0)),
    "wall_east": (((1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)), (-1, 0, 0)),
}


def _box(low: Point, high: Point, materials: dict[str, str]) -> Mesh:
    mesh = Mesh()
    for side, (choices, facing) in SIDES.items():
        ends = (low, high)
        corners = [(ends[x][0], ends[y][1], ends[z][2]) for x, y, z in choices]
        mesh.quad(corners, facing, materials[side], side, None)
    return mesh

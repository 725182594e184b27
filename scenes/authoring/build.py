"""Write scenes/*/mesh.obj from the authoring scripts: `python scenes/authoring/build.py [SCENE ...]` (all by default).

The meshes are data in the repository: run this only to change a room, which outdates its stored references.
"""

import sys
from pathlib import Path

import boxes
import deflector_house
import desk_office
import partition_office
import test_room

SCENES = Path(__file__).resolve().parent.parent
BUILDERS = {
    "test_room": test_room.build,
    "desk_office": desk_office.build,
    "partition_office": partition_office.build,
    "deflector_house": deflector_house.build,
    "cube": boxes.build_cube,
    "furnace": boxes.build_furnace,
    "three_tone": boxes.build_three_tone,
}


def main(names: list[str]) -> None:
    """Build the named scenes and print their sizes."""
    for name in names or list(BUILDERS):
        if name not in BUILDERS:
            raise SystemExit(f"build.py: no scene {name!r}; choose from {', '.join(BUILDERS)}")
        mesh = BUILDERS[name]()
        mesh.write(SCENES / name / "mesh.obj", f"{name} of Transom")
        print(f"{name:18} {len(mesh.faces):5} faces {mesh.triangle_count:5} triangles {mesh.solid_count:4} solids")


if __name__ == "__main__":
    main(sys.argv[1:])

"""Writes small scene folders for tests: a closed 4 x 5 x 3 m room whose south wall (or all of it) is an opening."""

from __future__ import annotations

from pathlib import Path

ROOM_OBJ = """\
o room
v 0 0 0
v 4 0 0
v 4 5 0
v 0 5 0
v 0 0 3
v 4 0 3
v 4 5 3
v 0 5 3
usemtl floor
f 1 2 3 4
usemtl wall
f 5 8 7 6
f 2 6 7 3
f 3 7 8 4
f 4 8 5 1
o window
usemtl glass
f 1 2 6 5
"""

ROOM_TOML = """\
format = 1
title = "A test room"
description = "Closed but for its south side"

[mesh]
file = "mesh.obj"
unit = "m"
up = "z"

[site]
name = "Boston"
latitude_deg = 42.4
longitude_deg = -71.0
time_zone_h = -5

[materials.floor]
reflectance = [0.3, 0.2, 0.1]

[materials.wall]
reflectance = 0.5

[[openings]]
name = "south"
material = "glass"
glazing = "clear"
visible_transmittance = 0.78

[[views]]
name = "inside"
position_m = [2, 4, 1.5]
target_m = [2, 0, 1.5]
vertical_fov_deg = 60
display_white_cd_m2 = 1000

[[conditions]]
name = "morning"
time = "2026-03-21T10:00"
sky = "cie:12"

[[regions]]
name = "window"
objects = ["win*"]
box_m = [[0, -1, 0], [4, 1, 3]]

[[sensors]]
name = "desk"
corner_m = [0, 0, 0.8]
edge_u_m = [4, 0, 0]
edge_v_m = [0, 5, 0]
count = [2, 3]
normal = [0, 0, 2]
"""


def write_scene(folder: Path, toml: str = ROOM_TOML, obj: str | None = ROOM_OBJ, mesh_name: str = "mesh.obj") -> Path:
    """Writes scene.toml and the mesh (none for None) into `folder`, and returns it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.toml").write_text(toml, encoding="utf-8")
    if obj is not None:
        (folder / mesh_name).write_text(obj, encoding="utf-8")
    return folder

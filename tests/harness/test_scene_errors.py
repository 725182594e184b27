"""Claims about the one line that a wrong scene gets: file, field, value, what is allowed, remedy."""

# One mistake a line reads as a table.
# ruff: noqa: E501

from __future__ import annotations

import re
from pathlib import Path

import pytest
from scene_writing import ROOM_OBJ, ROOM_TOML, write_scene

from transom.errors import InputError
from transom.scene import load_scene

VIEW_TARGET = "target_m = [2, 0, 1.5]"
SECOND_VIEW = '[[views]]\nname = "inside"\nposition_m = [0,1,1]\ntarget_m = [1,1,1]\nvertical_fov_deg = 9\ndisplay_white_cd_m2 = 1\n'
TOML_MISTAKES = {
    "unknown key": ("reflectance = 0.5", "reflectence = 0.5", r"materials\.wall\.reflectence is an unknown key\. Did you mean reflectance\?"),
    "unknown table": ("[[openings]]", "[[opening]]", r"toml: opening is an unknown key\. Did you mean openings\?"),
    "wrong range": ("= 0.78", "= 1.4", r"openings\[0\]\.visible_transmittance = 1\.4 is outside 0\.\.1 \(visible, normal incidence\)\. Did you mean 0\.14\?"),
    "percentage": ("= 0.78", "= 78", r"visible_transmittance = 78 is outside 0\.\.1 .* Did you mean 0\.78\?"),
    "negative share": ("= 0.78", "= -0.2", r"visible_transmittance = -0\.2 is outside 0\.\.1 \(visible, normal incidence\)\.$"),
    "too clear": ("= 0.78", "= 0.95", r"openings\[0\]\.visible_transmittance = 0\.95 is more than the 0\.9183 .*Use at most 0\.918"),
    "missing transmittance": ("visible_transmittance = 0.78\n", "", r"openings\[0\]\.visible_transmittance is missing\. Add"),
    "wrong type": ("= 0.78", '= "0.78"', r"visible_transmittance = '0\.78' is not a number .*without quotes"),
    "number that is not finite": ("= 0.78", "= nan", r"visible_transmittance = nan is not a finite number"),
    "switch": ("reflectance = 0.5", "reflectance = 0.5\nsmooth = 1", r"smooth = 1 is neither true nor false"),
    "unit": ('unit = "m"', 'unit = "yd"', r"mesh\.unit = 'yd' is not a unit of length .*\"m\", \"cm\", \"mm\", \"ft\", \"in\""),
    "axis": ('up = "z"', 'up = "x"', r"mesh\.up = 'x' is not an axis that can point up"),
    "reflectance of 1": ("reflectance = 0.5", "reflectance = 1.0", r"reflectance = 1\.0 is outside 0\.\.0\.999 \(diffuse"),
    "colour of two numbers": ("[0.3, 0.2, 0.1]", "[0.3, 0.2]", r"materials\.floor\.reflectance = \[0\.3, 0\.2\] is neither a number nor"),
    "material without reflectance": ("reflectance = 0.5", "smooth = true", r"materials\.wall\.reflectance is missing"),
    "glazing": ('glazing = "clear"', 'glazing = "double"', r"glazing = 'double' is not a kind of glazing\. Allowed: \"clear\", \"none\""),
    "transmittance of a hole": ('glazing = "clear"', 'glazing = "none"', r"visible_transmittance = 0\.78 has no meaning beside glazing"),
    "field of view": ("vertical_fov_deg = 60", "vertical_fov_deg = 190", r"views\[0\]\.vertical_fov_deg = 190 is outside 1\.\.170"),
    "view to itself": (VIEW_TARGET, "target_m = [2, 4, 1.5]", r"views\[0\]\.target_m = \[2\.0, 4\.0, 1\.5\] equals position_m"),
    "view along up": (VIEW_TARGET, "target_m = [2, 4, 0]", r"views\[0\]\.up = \[0\.0, 0\.0, 1\.0\] is the direction of the view"),
    "vector of two": (VIEW_TARGET, "target_m = [2, 4]", r"views\[0\]\.target_m = \[2, 4\] is not a list of three numbers"),
    "image size": ("vertical_fov_deg = 60", "vertical_fov_deg = 60\nwidth = 0", r"views\[0\]\.width = 0 is outside 1\.\.16384"),
    "normal": ("normal = [0, 0, 2]", "normal = [0, 0, 0]", r"sensors\[0\]\.normal = \[0, 0, 0\] has no direction"),
    "grid on a line": ("edge_v_m = [0, 5, 0]", "edge_v_m = [2, 0, 0]", r"sensors\[0\]\.edge_u_m = .* spans no area with edge_v_m"),
    "grid without count": ("count = [2, 3]\n", "", r"sensors\[0\] has no points"),
    "sky number": ('"cie:12"', '"cie:17"', r"conditions\[0\]\.sky = 'cie:17' is not a CIE sky type 1 to 16\. Use"),
    "sky name": ('"cie:12"', '"cloudy"', r"sky = 'cloudy' is not a sky\. Use \"cie:1\""),
    "perez levels": ('"cie:12"', '"perez:600"', r"sky = 'perez:600' needs two irradiances"),
    "time form": ("2026-03-21T10:00", "21.3.2026 10:00", r"conditions\[0\]\.time = '21\.3\.2026 10:00' is not a time"),
    "time that does not exist": ("2026-03-21T10:00", "2026-02-30T10:00", r"time = '2026-02-30T10:00' is not a time \("),
    "two sky levels": ('sky = "cie:12"', "zenith_luminance_cd_m2 = 4000\ndiffuse_horizontal_illuminance_lx = 9000", r"conditions\[0\]\.diffuse_horizontal_illuminance_lx = 9000\.0 cannot stand beside"),
    "latitude": ("latitude_deg = 42.4", "latitude_deg = 142.4", r"site\.latitude_deg = 142\.4 is outside -90\.\.90"),
    "site": ("[site]", "[sites]", r"sites is an unknown key\. Did you mean site\?"),
    "format": ("format = 1", "format = 2", r"format = 2 is outside 1\.\.1"),
    "missing up": ('up = "z"\n', "", r"mesh\.up is missing\. Say which axis"),
    "table instead of a list": ("[[views]]", "[views]", r"views is not a list of tables\. Write \[\[views\]\]"),
    "list instead of a table": ("[site]", "[[site]]", r"site = .* is not a table"),
    "malformed file": ("unit = \"m\"", "unit = m", r"is not valid TOML: .*line 7"),
    "name with spaces": ('name = "morning"', 'name = "one morning"', r"conditions\[0\]\.name = 'one morning' is not a name"),
    "two views of one name": ("[[conditions]]", SECOND_VIEW + "[[conditions]]", r"views\[1\]\.name = 'inside' is the name of views\[0\] too"),
    "material that is never used": ("[materials.wall]", "[materials.ceiling]\nreflectance = 0.8\n[materials.wall]", r"materials\.ceiling is used by no face"),
    "opening without a face": ('material = "glass"', 'material = "glas"', r"openings\[0\]\.material = 'glas' has no face in .*mesh\.obj\. Did you mean glass\?"),
    "opening that is a material too": ("[materials.wall]", "[materials.glass]\nreflectance = 0.1\n[materials.wall]", r"openings\[0\]\.material = 'glass' is described in \[materials\.glass\] too"),
    "region of nothing": ('["win*"]', '["desk_*"]', r"regions\[0\]\.objects = 'desk_\*' matches no object of the mesh\. Its objects: room, window"),
    "box upside down": ("[[0, -1, 0], [4, 1, 3]]", "[[0, -1, 5], [4, 1, 3]]", r"regions\[0\] has a box_m whose first corner"),
    "missing mesh": ('"mesh.obj"', '"mash.obj"', r"mesh\.file = 'mash\.obj' does not exist in .*\. Did you mean mesh\.obj\?"),
    "no site": (ROOM_TOML[ROOM_TOML.index("[site]") : ROOM_TOML.index("[materials.floor]")], "", r"site is missing, but condition 'morning' has a sky"),
}  # fmt: skip
OBJ_MISTAKES = {
    "undescribed material": ("usemtl floor", "usemtl carpet", r"materials\.floor is used by no face of .*Did you mean|used by no face"),
    "face without a material": ("usemtl floor\n", "", r"mesh\.obj, line 10: face has no material"),
    "vertex that is not a number": ("v 4 0 0", "v 4 zero 0", r"mesh\.obj, line 3: vertex 2 is not three numbers"),
    "nan": ("v 4 0 0", "v 4 nan 0", r"mesh\.obj, line 3: vertex 2 = \(4\.0, nan, 0\.0\) is not finite"),
    "inf": ("v 4 0 0", "v 4 inf 0", r"mesh\.obj, line 3: vertex 2 = \(4\.0, inf, 0\.0\) is not finite"),
    "index out of range": ("f 1 2 3 4", "f 1 2 3 9", r"mesh\.obj, line 11: face names vertex 9, but 8 are defined"),
    "index zero": ("f 1 2 3 4", "f 0 2 3 4", r"line 11: face names vertex 0"),
    "face without area": ("f 1 2 3 4", "f 1 2 3 4\nf 1 2 1", r"line 12: face \(object 'room', material 'floor'\) has no area, near \("),
    "doubled face": ("f 1 2 3 4", "f 1 2 3 4\nf 4 3 2 1", r"mesh\.obj: face of object 'room' .* lies exactly on one of object 'room'"),
    "open wall": ("f 2 6 7 3\n", "", r"mesh\.obj: opening 'south' \(material 'glass'\) lights a room with an open wall: .*glazing = \"none\""),
    "opening that looks indoors": ("f 1 2 6 5", "f 5 6 2 1", r"opening 'south' .* has its front towards the room.*Reverse these faces"),
    "far away": ("v 4 5 0", "v 4 500000 0", r"mesh\.obj: vertex = 500000\.0 is further than 100 km"),
    "no faces": (ROOM_OBJ, "v 0 0 0\n", r"mesh\.obj has no faces|mesh\.obj: has no faces"),
}  # fmt: skip


def line_of(folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        load_scene(folder)
    line = str(caught.value)
    assert "\n" not in line
    return line


@pytest.mark.parametrize("mistake", TOML_MISTAKES)
def test_mistake_in_scene_toml_is_named_in_one_line(tmp_path: Path, mistake: str) -> None:
    old, new, expected = TOML_MISTAKES[mistake]
    assert old in ROOM_TOML
    line = line_of(write_scene(tmp_path / "room", ROOM_TOML.replace(old, new, 1)))
    assert re.search(expected, line), line
    assert "scene.toml" in line


@pytest.mark.parametrize("mistake", OBJ_MISTAKES)
def test_mistake_in_the_mesh_is_named_in_one_line(tmp_path: Path, mistake: str) -> None:
    old, new, expected = OBJ_MISTAKES[mistake]
    assert old in ROOM_OBJ
    line = line_of(write_scene(tmp_path / "room", obj=ROOM_OBJ.replace(old, new, 1)))
    assert re.search(expected, line), line


def test_material_of_the_mesh_without_a_table_is_named_with_its_line(tmp_path: Path) -> None:
    line = line_of(write_scene(tmp_path / "room", obj=ROOM_OBJ.replace("o window", "usemtl wal\nf 1 3 7 5\no window")))
    assert re.search(r"mesh\.obj, line 18: material = 'wal' is not described in .*\. Did you mean wall\?", line), line


def test_unknown_scene_gets_near_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_scene(tmp_path / "test_room")
    monkeypatch.setenv("TRANSOM_SCENES", str(tmp_path))
    with pytest.raises(InputError, match=r"scene = 'testroom' is neither .* Did you mean test_room\?"):
        load_scene("testroom")


def test_folder_without_scene_toml_is_named(tmp_path: Path) -> None:
    assert re.search(r"has no scene\.toml", line_of(tmp_path))


def test_wrong_mesh_extension_is_named(tmp_path: Path) -> None:
    toml = ROOM_TOML.replace("mesh.obj", "mesh.stl")
    line = line_of(write_scene(tmp_path / "room", toml, mesh_name="mesh.stl"))
    assert re.search(r"mesh\.stl: has the extension '\.stl', .*\.obj, \.glb, \.gltf", line), line


def test_broken_glb_is_named(tmp_path: Path) -> None:
    toml = ROOM_TOML.replace("mesh.obj", "mesh.glb")
    line = line_of(write_scene(tmp_path / "room", toml, obj="not glTF", mesh_name="mesh.glb"))
    assert re.search(r"mesh\.glb: cannot be read as glTF", line), line


def test_shading_normal_behind_its_face_is_refused(tmp_path: Path) -> None:
    toml = ROOM_TOML.replace("reflectance = 0.5", "reflectance = 0.5\nsmooth = true")
    obj = ROOM_OBJ.replace("f 2 6 7 3", "vn 1 0 0\nf 2//1 6//1 7//1 3//1")
    line = line_of(write_scene(tmp_path / "room", toml, obj))
    assert re.search(r"line 15: face has a vertex normal that is zero or points behind", line), line


def test_scene_without_any_light_is_refused(tmp_path: Path) -> None:
    start, end = ROOM_TOML.index("[[openings]]"), ROOM_TOML.index("[[views]]")
    toml = ROOM_TOML[:start] + "[materials.glass]\nreflectance = 0.1\n" + ROOM_TOML[end:]
    assert re.search(r"neither openings nor emitters", line_of(write_scene(tmp_path / "room", toml)))


def test_opening_in_front_of_an_uncut_wall_is_refused(tmp_path: Path) -> None:
    # The whole south side is a wall, and the pane lies in its plane.
    wall_and_pane = "usemtl wall\nf 1 2 6 5\nv 1 0 1\nv 3 0 1\nv 3 0 2\nv 1 0 2\nusemtl glass\nf 9 10 11 12"
    obj = ROOM_OBJ.replace("usemtl glass\nf 1 2 6 5", wall_and_pane)
    line = line_of(write_scene(tmp_path / "room", obj=obj))
    assert re.search(r"opening 'south' .* is covered by another surface at most 1 cm away\. Cut the hole", line), line


def test_small_seam_between_walls_is_not_an_open_wall(tmp_path: Path) -> None:
    # The west wall ends 1 mm below the ceiling.
    obj = ROOM_OBJ.replace("f 4 8 5 1", "v 0 5 2.999\nv 0 0 2.999\nf 4 9 10 1")
    assert load_scene(write_scene(tmp_path / "room", obj=obj)).openings

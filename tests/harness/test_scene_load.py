"""Claims about what load_scene returns for good scenes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scene_writing import ROOM_OBJ, ROOM_TOML, write_scene

from transom.errors import InputError
from transom.scene import content_key, list_scenes, load_scene, region_mask, scene_root
from transom.scene.geometry import build_mesh, frame_rotation
from transom.scene.mesh import read_obj
from transom.scene.model import Mesh, Region


def room_as(folder: Path, edit: dict[str, str], obj: str = ROOM_OBJ) -> Path:
    toml = ROOM_TOML
    for old, new in edit.items():
        assert old in toml
        toml = toml.replace(old, new)
    return write_scene(folder, toml, obj)


def mesh_area(mesh: Mesh) -> float:
    corners = mesh.vertices[mesh.triangles()[0]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(0.5 * np.linalg.norm(cross, axis=1).sum())


def obj_mesh(path: Path, text: str, smooth: bool = False, up: str = "z") -> Mesh:
    path.write_text(text)
    raw = read_obj(path)
    names = {polygon.material: 0 for polygon in raw.polygons}
    return build_mesh(raw, "m", up, 0.0, names, frozenset(names) if smooth else frozenset())


def test_room_arrives_with_every_field_in_si_units(tmp_path: Path) -> None:
    scene = load_scene(write_scene(tmp_path / "room"))
    assert (scene.name, scene.title) == ("room", "A test room")
    assert scene.mesh.faces.shape == (6, 4)
    assert scene.mesh.objects == ("room", "window")
    assert [material.name for material in scene.materials] == ["floor", "wall", "glass"]
    assert scene.materials[0].reflectance == (0.3, 0.2, 0.1)
    assert scene.materials[1].reflectance == (0.5, 0.5, 0.5)
    assert scene.materials[2].opening == 0
    assert scene.openings[0].visible_transmittance == 0.78
    assert scene.site.latitude_rad == pytest.approx(math.radians(42.4), abs=1e-15)
    assert scene.views[0].vertical_fov_rad == pytest.approx(math.pi / 3, abs=1e-15)
    assert (scene.views[0].width, scene.views[0].height) == (640, 480)
    assert scene.conditions[0].ground_albedo == 0.2
    assert mesh_area(scene.mesh) == pytest.approx(94.0, rel=1e-12)


def test_sensor_grid_has_points_at_cell_centres_along_u_first(tmp_path: Path) -> None:
    sensors = load_scene(write_scene(tmp_path / "room")).sensors[0]
    np.testing.assert_allclose(sensors.points[:3], [[1, 5 / 6, 0.8], [3, 5 / 6, 0.8], [1, 2.5, 0.8]], atol=1e-12)
    np.testing.assert_allclose(sensors.normals, np.tile([0, 0, 1], (6, 1)))


def test_scene_is_found_by_name_folder_and_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_scene(tmp_path / "room")
    monkeypatch.setenv("TRANSOM_SCENES", str(tmp_path))
    assert scene_root() == tmp_path
    assert list_scenes() == ["room"]
    keys = {content_key(load_scene(place)) for place in ("room", folder, str(folder), folder / "scene.toml")}
    assert len(keys) == 1


def test_relative_folder_without_slash_is_a_path_when_no_scene_has_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_scene(tmp_path / "mine")
    monkeypatch.chdir(tmp_path)
    assert load_scene("mine").name == "mine"


def test_y_up_mesh_is_converted_to_z_up_with_z_towards_south(tmp_path: Path) -> None:
    swapped = []
    for line in ROOM_OBJ.splitlines():
        words = line.split()
        swapped.append(f"v {words[1]} {words[3]} {-float(words[2])}" if words[0] == "v" else line)
    upright = load_scene(write_scene(tmp_path / "z"))
    converted = load_scene(room_as(tmp_path / "y", {'up = "z"': 'up = "y"'}, "\n".join(swapped)))
    np.testing.assert_allclose(converted.mesh.vertices, upright.mesh.vertices, atol=1e-12)
    assert content_key(converted) == content_key(upright)


def test_north_90_turns_the_northern_side_of_the_model_to_the_east() -> None:
    np.testing.assert_allclose(frame_rotation("z", 90.0) @ [0, 1, 0], [1, 0, 0], atol=1e-15)


@settings(max_examples=40, deadline=None)
@given(st.floats(-360, 360), st.sampled_from(["y", "z"]))
def test_axes_are_converted_by_a_proper_rotation(north_deg: float, up: str) -> None:
    rotation = frame_rotation(up, north_deg)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(("unit", "metres"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("ft", 0.3048), ("in", 0.0254)])
def test_units_scale_areas_by_the_square(tmp_path: Path, unit: str, metres: float) -> None:
    scene = load_scene(room_as(tmp_path / "room", {'unit = "m"': f'unit = "{unit}"'}))
    assert mesh_area(scene.mesh) == pytest.approx(94.0 * metres**2, rel=1e-12)


def test_negative_obj_indices_count_back_from_the_last_vertex(tmp_path: Path) -> None:
    mesh = obj_mesh(tmp_path / "m.obj", "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf -3 -2 -1\n")
    np.testing.assert_allclose(mesh.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert mesh.faces.tolist() == [[0, 1, 2, -1]]


def test_separate_copies_of_a_vertex_become_one(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.00000001\nusemtl a\nf 1 2 3\nf 4 5 6\n"
    assert len(obj_mesh(tmp_path / "m.obj", text).vertices) == 4


def test_bent_quad_is_split_into_triangles(tmp_path: Path) -> None:
    mesh = obj_mesh(tmp_path / "m.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0.1\nv 0 1 0\nusemtl a\nf 1 2 3 4\n")
    assert mesh.faces[:, 3].tolist() == [-1, -1]


def test_concave_quad_is_split_at_its_reflex_corner(tmp_path: Path) -> None:
    # An arrow head whose notch is the second corner: the diagonal 1-3 would run outside.
    mesh = obj_mesh(tmp_path / "m.obj", "v 0 0 0\nv 1 0.5 0\nv 2 0 0\nv 1 2 0\nusemtl a\nf 1 2 3 4\n")
    assert mesh.faces[:, 3].tolist() == [-1, -1]
    assert mesh_area(mesh) == pytest.approx(1.5, rel=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0.3, 2.0), min_size=5, max_size=12))
def test_cutting_a_star_shaped_polygon_keeps_its_area(
    tmp_path_factory: pytest.TempPathFactory, radii: list[float]
) -> None:
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    x, y = np.array(radii) * np.cos(angle), np.array(radii) * np.sin(angle)
    expected = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    lines = [f"v {a!r} {b!r} 0" for a, b in zip(x.tolist(), y.tolist(), strict=True)]
    text = "\n".join([*lines, "usemtl a", "f " + " ".join(str(i + 1) for i in range(len(radii)))])
    mesh = obj_mesh(tmp_path_factory.mktemp("star") / "m.obj", text)
    assert mesh_area(mesh) == pytest.approx(expected, rel=1e-9)


def test_computed_smooth_normals_of_a_cylinder_point_along_the_radius(tmp_path: Path) -> None:
    count = 24
    angle = 2 * np.pi * np.arange(count) / count
    lines = [f"v {math.cos(a)} {math.sin(a)} {z}" for z in (0, 1) for a in angle]
    faces = [f"f {i + 1} {(i + 1) % count + 1} {(i + 1) % count + 1 + count} {i + 1 + count}" for i in range(count)]
    mesh = obj_mesh(tmp_path / "m.obj", "\n".join([*lines, "usemtl a", *faces]), smooth=True)
    assert mesh.corner_normals is not None
    radial = mesh.vertices[mesh.faces] * [1, 1, 0]
    np.testing.assert_allclose(mesh.corner_normals, radial, atol=1e-6)


def test_faces_bent_by_90_degrees_keep_their_crease(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nusemtl a\nf 1 2 3 4\nf 1 5 6 2\n"
    mesh = obj_mesh(tmp_path / "m.obj", text, smooth=True)
    assert mesh.corner_normals is not None
    np.testing.assert_allclose(mesh.corner_normals[0], np.tile([0, 0, 1], (4, 1)), atol=1e-12)


def test_normals_of_the_file_are_used_for_smooth_materials_and_rotated(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 1 0 -1\nvn 0 3 1\nusemtl a\nf 1//1 2//1 3//1\n"
    mesh = obj_mesh(tmp_path / "m.obj", text, smooth=True, up="y")
    assert mesh.corner_normals is not None
    np.testing.assert_allclose(mesh.corner_normals[0, 0], np.array([0, -1, 3]) / math.sqrt(10), atol=1e-12)


def test_glb_gives_the_same_surfaces_as_obj(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    from trimesh.visual.material import PBRMaterial

    room = load_scene(write_scene(tmp_path / "obj"))
    built = trimesh.Scene()
    for index, material in enumerate(room.materials):
        triangles, source = room.mesh.triangles()
        own = triangles[room.mesh.face_material[source] == index]
        # glTF has y up: x, z, -y.
        part = trimesh.Trimesh(room.mesh.vertices[:, [0, 2, 1]] * [1, 1, -1], own, process=False)
        part.visual = trimesh.visual.TextureVisuals(material=PBRMaterial(name=material.name))
        built.add_geometry(part, node_name=f"part_{material.name}", geom_name=f"part_{material.name}")
    folder = room_as(
        tmp_path / "glb",
        {'up = "z"': 'up = "y"', "mesh.obj": "mesh.glb", 'objects = ["win*"]': 'objects = ["part_glass"]'},
    )
    (folder / "mesh.glb").write_bytes(built.export(file_type="glb"))
    scene = load_scene(folder)
    assert mesh_area(scene.mesh) == pytest.approx(94.0, rel=1e-6)
    assert sorted(scene.mesh.objects) == ["part_floor", "part_glass", "part_wall"]
    for index in range(3):
        corners = scene.mesh.vertices[scene.mesh.faces[scene.mesh.face_material == index][:, :3]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        expected = {0: [0, 0, 40], 2: [0, -24, 0]}.get(index)
        if expected is not None:
            np.testing.assert_allclose(normal, expected, atol=1e-5)


def test_content_key_ignores_texts_and_views_but_not_light(tmp_path: Path) -> None:
    key = content_key(load_scene(write_scene(tmp_path / "a")))
    same = room_as(tmp_path / "b", {"A test room": "Renamed", "vertical_fov_deg = 60": "vertical_fov_deg = 50"})
    assert content_key(load_scene(same)) == key
    for number, edit in enumerate(({"= 0.78": "= 0.77"}, {"reflectance = 0.5": "reflectance = 0.51"})):
        assert content_key(load_scene(room_as(tmp_path / f"c{number}", edit))) != key
    taller = write_scene(
        tmp_path / "d",
        obj="\n".join(
            f"{line}.001" if line.startswith("v") and line.endswith(" 3") else line for line in ROOM_OBJ.splitlines()
        ),
    )
    assert content_key(load_scene(taller)) != key
    scene = load_scene(tmp_path / "a")
    assert (
        content_key(
            replace(
                scene, mesh=replace(scene.mesh, vertices=np.where(scene.mesh.vertices == 0, -0.0, scene.mesh.vertices))
            )
        )
        == key
    )


def test_region_is_the_pixels_of_its_objects_in_its_box() -> None:
    region = Region("r", ("desk_*",), ((0, 0, 0), (1, 1, 1)))
    objects = np.array([[0, 1, 2, -1]])
    positions = np.array([[[0.5, 0.5, 1.0], [0.5, 0.5, 0.5], [0.5, 2.0, 0.5], [0, 0, 0]]], dtype=np.float32)
    assert region_mask(region, ("desk_1", "wall", "desk_2"), objects, positions).tolist() == [
        [True, False, False, False]
    ]
    whole = region_mask(Region("all", box=region.box), ("desk_1", "wall", "desk_2"), objects, positions)
    assert whole.tolist() == [[True, True, False, False]]


def test_every_scene_of_the_project_loads() -> None:
    names = list_scenes()
    assert names
    for name in names:
        scene = load_scene(name)
        assert scene.views
        assert scene.conditions


def test_missing_scene_root_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRANSOM_SCENES", "/nonexistent/scenes")
    with pytest.raises(InputError, match="TRANSOM_SCENES = '/nonexistent/scenes' is not a folder"):
        list_scenes()


def test_the_key_of_a_scene_does_not_hang_on_the_last_bit_of_its_normals() -> None:
    scene = load_scene("deflector_house")
    normals = scene.mesh.corner_normals
    assert normals is not None
    nudged = replace(scene.mesh, corner_normals=np.nextafter(normals, 2.0))
    turned = replace(scene.mesh, corner_normals=np.roll(normals, 1, axis=2))
    assert content_key(replace(scene, mesh=nudged)) == content_key(scene)
    assert content_key(replace(scene, mesh=turned)) != content_key(scene)

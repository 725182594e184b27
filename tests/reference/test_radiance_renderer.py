"""Radiance against closed forms, the shared glass and the shared sky, and its border of units and colours."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from reference_rooms import PlainCondition, box_quads, make_scene, room_view, window_room

from transom.colour import luminance
from transom.daylight.cie_sky import CieSky
from transom.daylight.perez_sky import PerezSky
from transom.daylight.sky_model import SkyModel, SkyPattern
from transom.errors import InputError
from transom.glass import pane
from transom.scene.model import Material, Mesh, Opening, PointSource, Scene
from transom_reference.mitsuba_renderer import MitsubaRenderer
from transom_reference.radiance_programs import make_octree, program_path, trace
from transom_reference.radiance_renderer import RadianceRenderer
from transom_reference.radiance_scene import write_scene

Float64 = NDArray[np.float64]
RADIANCE = RadianceRenderer()
UP = np.array([[0.0, 0.0, 1.0]])
EXACT = {"preset": "exact", "samples": 10, "passes": 4}
NO_SKY = SkyModel(CieSky(5), (0.0, 0.0, 1.0), 0.0)


def uniform(level: float, **light: Float64) -> PlainCondition:
    return PlainCondition(SkyModel(CieSky(5), (0.0, 0.0, 1.0), level), **light)


def black_room(glazing: str, transmittance: float = 1.0) -> Scene:
    """The room with the window, all of whose surfaces are black."""
    scene = window_room(glazing, transmittance)
    materials = tuple(Material(m.name, opening=m.opening) for m in scene.materials)
    return make_scene_like(scene, materials)


def make_scene_like(scene: Scene, materials: tuple[Material, ...]) -> Scene:
    quads = [(scene.mesh.vertices[f], scene.materials[m].name) for f, m in zip(*_faces(scene.mesh), strict=True)]
    return make_scene(quads, materials, scene.openings)


def _faces(mesh: Mesh) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    return mesh.faces, mesh.face_material


def furnace(reflectance: float, emitted: float) -> Scene:
    quads = [(corners, "wall") for corners in box_quads((2.0, 3.0, 2.5)).values()]
    return make_scene(quads, (Material("wall", (reflectance,) * 3, (emitted,) * 3),))


def test_uniform_sky_through_a_hole_lights_a_point_by_its_form_factor() -> None:
    """A point 1 m inside the window, facing it: E = pi L F in closed form.

    F of a rectangle parallel to the receiver, from the foot of its corner [Howell, C-11]; the point is at the height of
    the sill, so that all of the hole shows sky.
    """
    inside, half_width, height = 1.0, 1.0, 1.4
    x, y = half_width / inside, height / inside
    corner = (
        x / math.sqrt(1 + x * x) * math.atan(y / math.sqrt(1 + x * x))
        + y / math.sqrt(1 + y * y) * math.atan(x / math.sqrt(1 + y * y))
    ) / (2 * math.pi)
    point, normal = np.array([[2.0, inside, 0.9]]), np.array([[0.0, -1.0, 0.0]])
    found = RADIANCE.illuminance(black_room("none"), uniform(1000.0), point, normal, {**EXACT, "samples": 13})
    assert luminance(found.illuminance)[0] == pytest.approx(1000 * math.pi * 2 * corner, rel=2e-3)


@pytest.mark.parametrize("angle_deg", [1.0, 35.0, 60.0, 75.0, 85.0])
@pytest.mark.parametrize("transmittance", [0.4, 0.82])
def test_glass_passes_what_the_shared_pane_passes(angle_deg: float, transmittance: float, tmp_path: Path) -> None:
    """Radiance computes Fresnel's equations itself: 1e-5 of the closed form, seen from both sides."""
    octree = write_scene(tmp_path, black_room("clear", transmittance), uniform(179.0))
    angle = math.radians(angle_deg)
    upwards = np.array([0.0, -math.cos(angle), math.sin(angle)])
    start = np.array([2.0, 0.0, 1.6]) - 0.2 * upwards
    values = trace(octree, ["-ab", "0", "-lw", "0", "-lr", "8"], np.concatenate([start, upwards])[None])
    expected = pane(transmittance, np.array([math.cos(angle)]))[0]
    assert values[0] == pytest.approx(np.repeat(expected, 3), rel=1e-5)


def test_room_side_of_glass_is_a_mirror_in_full_physics_only(tmp_path: Path) -> None:
    """A ray to the pane and back to an emitting wall: directional reflectance in full physics, none when matched."""
    scene = window_room("clear", 0.82)
    materials = tuple(
        Material(m.name, luminance=(179.0,) * 3 if m.name == "north" else (0.0,) * 3, opening=m.opening)
        for m in scene.materials
    )
    scene = make_scene_like(scene, materials)
    start, towards = np.array([2.0, 2.5, 1.6]), np.array([0.1, -1.0, 0.0]) / math.hypot(0.1, 1.0)
    ray = np.concatenate([start, towards])[None]
    seen = []
    for is_full in (False, True):
        folder = tmp_path / str(is_full)
        folder.mkdir()
        octree = write_scene(folder, scene, PlainCondition(NO_SKY), full_physics=is_full)
        seen.append(float(trace(octree, ["-ab", "0", "-lw", "0", "-lr", "8"], ray)[0, 1]))
    mirror = float(pane(0.82, np.array([-towards[1]]))[1][0])
    assert seen == pytest.approx([0.0, mirror], rel=1e-4)


@pytest.mark.parametrize(
    "pattern",
    [*(CieSky(number) for number in (1, 3, 5, 7, 10, 12, 15, 16)), PerezSky((-1.1, -0.3, 8.0, -2.9, 0.4))],
    ids=str,
)
def test_sky_function_is_the_shared_sky(pattern: SkyPattern, tmp_path: Path) -> None:
    """At 300 directions, down to the horizon and beyond: 1e-5, and the ground below."""
    generator = np.random.default_rng(3)
    directions = generator.normal(size=(300, 3))
    directions[0], directions[1] = (0.0, 0.0, 1.0), (1.0, 0.0, 1e-4)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    sky = SkyModel(pattern, (0.48, -0.6, 0.64), 2500.0)
    ground = np.array([300.0, 200.0, 100.0])
    condition = PlainCondition(sky, sky_rgb=np.array([0.9, 1.0, 1.3]), ground_luminance_rgb=ground)
    octree = write_scene(tmp_path, furnace(0.5, 0.0), condition)  # type: ignore[arg-type]
    rays = np.hstack([np.full_like(directions, 50.0), directions])
    found = 179.0 * trace(octree, ["-ab", "0"], rays)
    expected = sky.luminance(directions)[:, None] * condition.sky_rgb
    expected[directions[:, 2] < 0] = ground
    assert found == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("physics", ["matched", "full"])
def test_sun_arrives_with_its_illuminance(physics: str) -> None:
    """Through a hole, on a sensor at an angle: E cos, for a point sun and for a disc."""
    sun = np.array([0.1, -0.7, 0.5]) / np.linalg.norm([0.1, -0.7, 0.5])
    condition = uniform(0.0, sun_direction=sun, sun_illuminance_rgb=np.array([80e3, 90e3, 70e3]))
    point = np.array([[2.0, 0.0, 1.6]]) - 0.5 * sun
    found = RADIANCE.illuminance(black_room("none"), condition, point, UP, {**EXACT, "physics": physics})
    assert found.illuminance[0] == pytest.approx(np.array([80e3, 90e3, 70e3]) * sun[2], rel=1e-3)


def test_furnace_is_uniform_and_has_its_closed_form() -> None:
    """E = pi L / (1 - rho) in a closed box that emits L everywhere: bounces to the end, emitters that reflect."""
    found = RADIANCE.illuminance(furnace(0.6, 100.0), PlainCondition(NO_SKY), np.array([[1.0, 1.0, 1.0]]), UP, EXACT)
    expected, error = math.pi * 100 / 0.4, float(found.standard_error[0])
    assert error < 0.02 * expected
    assert luminance(found.illuminance)[0] == pytest.approx(expected, abs=4 * error)


def test_point_source_follows_the_inverse_square() -> None:
    """5e-4: it is a sphere of 1 mm, sampled at random places."""
    scene = furnace(0.0, 0.0)
    lamp = PointSource("lamp", (1.0, 1.5, 2.0), (100.0, 100.0, 100.0))
    scene = make_scene([(c, "wall") for c in box_quads((2.0, 3.0, 2.5)).values()], scene.materials, (), (lamp,))
    found = RADIANCE.illuminance(scene, PlainCondition(NO_SKY), np.array([[1.0, 1.5, 0.01]]), UP, EXACT)
    assert luminance(found.illuminance)[0] == pytest.approx(100 / 1.99**2, rel=5e-4)


def test_colours_return_as_they_went_through_the_border() -> None:
    """A coloured emitter seen by the camera: the same three channels, Rec. 709, in cd/m²."""
    quads = [(corners, "wall") for corners in box_quads((4.0, 5.0, 3.0)).values()]
    colour = (3000.0, 40.0, 700.0)
    scene = make_scene(quads, (Material("wall", luminance=colour),))
    image = RADIANCE.render(scene, PlainCondition(NO_SKY), room_view(4, 3), {"preset": "fast"})
    assert image.mean.reshape(-1, 3) == pytest.approx(np.tile(colour, (12, 1)), rel=1e-5)


def test_an_image_can_be_repeated_and_has_halves() -> None:
    scene, condition = window_room(), uniform(5000.0)
    options = {"parameters": "-ab 2 -ad 64 -as 0 -aa 0.3 -ar 16", "passes": 2, "samples": 1}
    first, second = (RADIANCE.render(scene, condition, room_view(8, 6), options) for _ in range(2))
    assert np.array_equal(first.mean, second.mean)
    assert first.halves is not None and first.standard_error is not None
    assert np.mean(first.halves, axis=0) == pytest.approx(first.mean, rel=1e-5)


def test_refusals_say_what_is_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, condition = window_room(), uniform(1000.0)
    with pytest.raises(InputError, match=r"preset.*best"):
        RADIANCE.illuminance(scene, condition, np.ones((1, 3)), UP, {"preset": "best"})
    with pytest.raises(InputError, match="-no-such"):
        RADIANCE.illuminance(scene, condition, np.ones((1, 3)), UP, {"parameters": "-no-such"})
    with pytest.raises(InputError, match="no function"):
        RADIANCE.illuminance(scene, PlainCondition(UniformSkyElsewhere()), np.ones((1, 3)), UP, {})
    (tmp_path / "broken.rad").write_text("void plastic half\n0\n0\n5 0.5\n")
    with pytest.raises(InputError, match="oconv"):
        make_octree(tmp_path / "broken.rad", tmp_path / "broken.oct")
    with pytest.raises(InputError, match="not among the programs"):
        program_path("no_such_program")
    monkeypatch.setattr("transom_reference.radiance_programs.radiance_folder", lambda: tmp_path)
    with pytest.raises(InputError, match="oconv"):
        RADIANCE.illuminance(scene, condition, np.ones((1, 3)), UP, {})


class UniformSkyElsewhere:
    """A sky that is neither CIE's nor Perez's."""

    pattern, scale, sun_direction = object(), 1.0, (0.0, 0.0, 1.0)


def test_clear_opening_of_another_transmittance_is_refused() -> None:
    opening = Opening("window", "glass", "clear", 0.95)
    scene = window_room()
    quads = [(scene.mesh.vertices[f], scene.materials[m].name) for f, m in zip(*_faces(scene.mesh), strict=True)]
    with pytest.raises(InputError, match=r"0\.9183"):
        bad = make_scene(quads, scene.materials, (opening,))
        RADIANCE.illuminance(bad, uniform(1.0), np.ones((1, 3)), UP, {})


def test_paths_are_not_too_bright_where_rays_are_few() -> None:
    """A closed box whose ceiling emits, against Mitsuba: correlated sampling (-u-) would be 1.4 % off."""
    faces, tones = box_quads((4.0, 3.0, 2.5)), {"floor": (0.2, 0.0), "ceiling": (0.8, 1000.0)}
    materials = tuple(
        Material(name, (tones.get(name, (0.5, 0.0))[0],) * 3, (tones.get(name, (0.5, 0.0))[1],) * 3) for name in faces
    )
    scene = make_scene([(corners, name) for name, corners in faces.items()], materials)
    points = np.array([[0.7, 0.6, 0.01], [2.0, 1.5, 0.01], [3.2, 1.9, 1.0]])
    up = np.tile(UP, (3, 1))
    ours = RADIANCE.illuminance(scene, PlainCondition(NO_SKY), points, up, {**EXACT, "samples": 13, "passes": 16})
    theirs = MitsubaRenderer().illuminance(scene, PlainCondition(NO_SKY), points, up, {"batches": 16})
    difference = luminance(ours.illuminance) / luminance(theirs.illuminance) - 1
    noise = np.hypot(ours.standard_error, theirs.standard_error) / luminance(theirs.illuminance)
    assert noise.max() < 2.5e-3
    assert abs(difference.mean()) < 4 * noise.max() / np.sqrt(3)

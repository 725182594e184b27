"""The reference renderer against closed forms: direct light, furnaces, radiosity in a box, energy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference_rooms import GradedSky, PlainCondition, UniformSky, box_quads, make_scene, room_view, window_room

from transom.glass import transmittance_table
from transom.scene.model import Material, PointSource, Scene
from transom_reference import vertex_light
from transom_reference.analytic import perpendicular_rectangle_factor, refine_box, refine_cube
from transom_reference.mitsuba_renderer import MitsubaRenderer, camera_rays
from transom_reference.portal_integrator import PathOptions, PortalIntegrator
from transom_reference.transport_scene import build_transport_scene

Float64 = NDArray[np.float64]
DARK: Any = PlainCondition(UniformSky(0.0))
OPTIONS = {"batches": 8}
SIGMAS = 4.5
"""Allowed deviation in standard errors: with 8 batches about 0.3 % of correct values lie outside."""


def with_reflectance(scene: Scene, value: float) -> Scene:
    materials = tuple(replace(m, reflectance=(value,) * 3) if m.opening < 0 else m for m in scene.materials)
    return replace(scene, materials=materials)


def closed_box(size: tuple[float, float, float], tones: dict[str, tuple[float, float]], **more: Any) -> Scene:
    """A box whose faces have (reflectance, own luminance) by name."""
    materials = tuple(Material(name, (r,) * 3, (own,) * 3) for name, (r, own) in tones.items())
    return make_scene([(quad, name) for name, quad in box_quads(size).items()], materials, **more)


def test_sky_light_through_a_hole_is_luminance_times_form_factor() -> None:
    condition: Any = PlainCondition(UniformSky(5000.0), ground_luminance_rgb=np.full(3, 2000.0))
    points = np.array([[1.4, 0.8, 0.4], [2.0, 3.0, 0.4], [3.7, 4.5, 0.4]])
    result = MitsubaRenderer().illuminance(
        with_reflectance(window_room("none"), 0.0), condition, points, np.tile([0, 0, 1.0], (3, 1)), OPTIONS
    )
    window = tuple(np.array(v) for v in (1.0, 3.0, 0.5, 1.9))
    expected = np.pi * 5000.0 * perpendicular_rectangle_factor(points[:, 0], points[:, 1], window)
    assert np.abs(result.illuminance[:, 1] / expected - 1).max() < 2e-3
    assert np.abs(result.illuminance[:, 1] - expected).max() < SIGMAS * result.standard_error.max()


def test_sky_light_through_glass_is_the_integral_over_the_pane() -> None:
    sky, ground = GradedSky(5000.0, (0.8, -0.6, 0.0)), 2500.0
    condition: Any = PlainCondition(sky, ground_luminance_rgb=np.full(3, ground))
    scene = with_reflectance(window_room("clear"), 0.0)
    points, normals = np.array([[2.0, 1.5, 0.8], [3.9, 4.0, 2.0]]), np.array([[0.0, 0, 1], [-1, 0, 0]])
    result = MitsubaRenderer().illuminance(scene, condition, points, normals, OPTIONS)
    x, z = np.meshgrid(1 + 2 * (np.arange(800) + 0.5) / 800, 0.9 + 1.4 * (np.arange(560) + 0.5) / 560)
    table = transmittance_table(scene.openings[0]).astype(float)
    for point, normal, found, error in zip(points, normals, result.illuminance, result.standard_error, strict=True):
        gap = np.stack([x - point[0], np.full_like(x, -point[1]), z - point[2]], axis=-1)
        distance = np.linalg.norm(gap, axis=-1)
        towards = gap / distance[..., None]
        light = sky.luminance(towards.reshape(-1, 3)).reshape(x.shape)
        light = np.where(towards[..., 2] >= 0, light, ground)
        passed = np.interp(-towards[..., 1] * 1024, np.arange(1025), table)
        flow = np.clip(towards @ normal, 0, None) * -towards[..., 1] / distance**2
        expected = float((light * passed * flow).sum() * (2.8 / x.size))
        assert found[1] == pytest.approx(expected, abs=SIGMAS * error + 2e-4 * expected)


def test_sun_through_glass_is_exact() -> None:
    sun = np.array([0.2, -0.7, 0.5])
    sun /= np.linalg.norm(sun)
    condition: Any = PlainCondition(UniformSky(0.0), sun, np.array([90e3, 80e3, 70e3]))
    scene = with_reflectance(window_room("clear"), 0.0)
    lit = np.array([2.0, 0.0, 1.6]) - 1.5 * sun / sun[2]
    points = np.array([[lit[0], lit[1], 0.1], [0.2, 4.8, 0.1]])
    result = MitsubaRenderer().illuminance(scene, condition, points, np.tile([0, 0, 1.0], (2, 1)), OPTIONS)
    passed = np.interp(-sun[1] * 1024, np.arange(1025), transmittance_table(scene.openings[0]).astype(float))
    expected = np.array([90e3, 80e3, 70e3]) * sun[2] * passed
    assert result.illuminance[0] == pytest.approx(expected, rel=1e-4)
    assert result.illuminance[1] == pytest.approx(np.zeros(3), abs=1e-6)


def test_closed_furnace_has_one_luminance() -> None:
    scene = closed_box((4.0, 5.0, 3.0), dict.fromkeys(box_quads((1, 1, 1)), (0.8, 100.0)))
    image = MitsubaRenderer().render(scene, DARK, room_view(24, 18), {"samples": 1024, "batches": 4})
    assert float(image.mean.mean()) == pytest.approx(500.0, rel=2e-3)


def test_white_room_in_a_uniform_surround_has_the_luminance_of_the_surround() -> None:
    """All reflectances near 1: what enters leaves, and light paths may neither lose nor gain any."""
    rho = 0.9
    condition: Any = PlainCondition(UniformSky(1000.0), ground_luminance_rgb=np.full(3, 1000.0))
    scene = with_reflectance(window_room("none"), rho)
    emitting = tuple(replace(m, luminance=(1000 * (1 - rho),) * 3) if m.opening < 0 else m for m in scene.materials)
    points, normals = np.array([[2.0, 2.5, 0.01], [0.5, 4.5, 2.0]]), np.array([[0.0, 0, 1], [1, 0, 0]])
    result = MitsubaRenderer().illuminance(replace(scene, materials=emitting), condition, points, normals, OPTIONS)
    assert result.illuminance[:, 1] == pytest.approx(np.full(2, np.pi * 1000), rel=3e-3)


def test_cube_has_its_tabulated_luminance() -> None:
    source = PointSource("lamp", (5.0, 5.0, 5.0), (50_000.0,) * 3)
    scene = closed_box((10.0,) * 3, dict.fromkeys(box_quads((1, 1, 1)), (2 / 3, 0.0)), point_sources=(source,))
    cube = refine_cube(8)
    uv = np.array([[0.5, 0.5], [0.75, 0.5], [0.75, 0.75], [0.9, 0.9]])
    points = np.concatenate([10 * uv, np.zeros((4, 1))], axis=1)
    result = MitsubaRenderer().illuminance(scene, DARK, points, np.tile([0, 0, 1.0], (4, 1)), OPTIONS)
    expected = [cube.luminance("z0", u, v) for u, v in uv]
    assert result.illuminance[:, 1] * (2 / 3) / np.pi == pytest.approx(expected, rel=2e-3)


def test_three_tones_have_the_radiosity_of_the_box() -> None:
    tones = {"floor": (0.2, 0.0), "ceiling": (0.8, 1000.0)} | dict.fromkeys(
        ("south", "north", "west", "east"), (0.5, 0)
    )
    scene = closed_box((4.0, 3.0, 2.5), tones)  # type: ignore[arg-type]
    reflectance = {"z0": 0.2, "z1": 0.8} | dict.fromkeys(("x0", "x1", "y0", "y1"), 0.5)
    box = refine_box((4.0, 3.0, 2.5), reflectance, {"z1": 1000.0}, cells=8)
    points, normals = (
        np.array([[2.0, 1.5, 0.0], [0.5, 0.4, 0.0], [2.0, 0.0, 1.2]]),
        np.array([[0.0, 0, 1]] * 2 + [[0, 1, 0]]),
    )
    result = MitsubaRenderer().illuminance(scene, DARK, points, normals, OPTIONS)
    expected = [
        box.luminance("z0", 0.5, 0.5) * np.pi / 0.2,
        box.luminance("z0", 0.125, 0.4 / 3) * np.pi / 0.2,
        box.luminance("y0", 0.5, 0.48) * np.pi / 0.5,
    ]
    assert result.illuminance[:, 1] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("glazing", ["none", "clear"])
def test_connections_to_light_paths_change_nothing_but_the_noise(glazing: str) -> None:
    sun = np.array([0.3, -0.6, 0.6]) / 0.9
    condition: Any = PlainCondition(UniformSky(5000.0), sun, np.full(3, 80e3), ground_luminance_rgb=np.full(3, 3000.0))
    transport = build_transport_scene(window_room(glazing), condition)
    start = camera_rays(room_view(12, 9))
    means, errors = [], []
    for connect, first_seed in ((False, 0), (True, 100)):
        integrator = PortalIntegrator(transport, start, PathOptions(8, 512, connect=connect))
        values = np.array([integrator.batch(first_seed + k)[:, 1] for k in range(8)])
        means.append(values.mean(axis=0))
        errors.append(values.std(axis=0, ddof=1) / np.sqrt(8))
    relative = (means[1] - means[0]) / means[0]
    uncertainty = np.sqrt((errors[0] ** 2 + errors[1] ** 2).sum()) / means[0].sum()
    assert errors[1].mean() < errors[0].mean()
    assert abs(means[1].sum() / means[0].sum() - 1) < SIGMAS * uncertainty + 1e-3
    assert abs(relative.mean()) < 0.005


def test_more_connections_of_a_vertex_change_nothing_but_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    condition: Any = PlainCondition(UniformSky(5000.0), ground_luminance_rgb=np.full(3, 3000.0))
    transport = build_transport_scene(window_room("clear"), condition)
    means, errors = [], []
    for connections, first_seed in ((1, 0), (vertex_light.VERTEX_CONNECTIONS, 100)):
        monkeypatch.setattr(vertex_light, "VERTEX_CONNECTIONS", connections)
        integrator = PortalIntegrator(transport, camera_rays(room_view(12, 9)), PathOptions(6, 512))
        values = np.array([integrator.batch(first_seed + k)[:, 1] for k in range(12)])
        means.append(values.mean(axis=0))
        errors.append(values.std(axis=0, ddof=1) / np.sqrt(12))
    uncertainty = np.sqrt((errors[0] ** 2 + errors[1] ** 2).sum()) / means[0].sum()
    assert errors[1].mean() < errors[0].mean()
    assert abs(means[1].sum() / means[0].sum() - 1) < SIGMAS * uncertainty + 1e-3

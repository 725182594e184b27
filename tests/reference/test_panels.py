"""Rooms lit through glazing products: closed forms for beams, residual and sky, and invariances of the estimators."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from panel_rooms import MadeUpProduct, lopsided_matrix, product_room
from reference_rooms import GradedSky, PlainCondition, UniformSky, room_view

from transom.bsdf.directions import KLEMS_FULL
from transom.errors import InputError
from transom.fenestration.light import panel_light
from transom.fenestration.panels import panel_groups
from transom.fenestration.through import Lobe
from transom.scene.model import Scene
from transom_reference.mitsuba_renderer import MitsubaRenderer, camera_rays
from transom_reference.portal_integrator import PathOptions, PortalIntegrator
from transom_reference.transport_scene import build_transport_scene

OPTIONS = {"batches": 8, "seed": 5}
SIGMAS = 5.0
SUN = np.array([0.2, -0.7, 0.5]) / np.linalg.norm([0.2, -0.7, 0.5])
NO_SKY = UniformSky(0.0)


def black(scene: Scene) -> Scene:
    return replace(scene, materials=tuple(replace(m, reflectance=(0.0,) * 3) for m in scene.materials))


def unit(*vector: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(vector) / np.linalg.norm(vector)


def exit_luminance(product: MadeUpProduct, sky: GradedSky, ground: float) -> np.ndarray[Any, Any]:
    """Luminance by exit bin behind a south panel, by summing over fine steps of all incident directions (145,)."""
    square, phi = np.meshgrid((np.arange(2000) + 0.5) / 2000, 2 * np.pi * (np.arange(720) + 0.5) / 720, indexing="ij")
    sine = np.sqrt(square)
    local = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.sqrt(1 - square)], axis=-1).reshape(-1, 3)
    # As seen from the room a south panel has west at its right: x = -east, y = up, z = north.
    towards = -np.stack([-local[:, 0], local[:, 2], local[:, 1]], axis=1)
    light = np.where(towards[:, 2] >= 0, sky.luminance(towards), ground)
    arriving = np.bincount(KLEMS_FULL.bin_of(local), light * np.pi / len(local), 145)
    return np.asarray(product.matrix @ arriving)


def direct_from_panel(luminance: Any, point: Any, normal: Any) -> float:
    """Illuminance of a point from the window of the room, by sums over the pane; luminance: by exit bin."""
    x, z = np.meshgrid(1 + 2 * (np.arange(800) + 0.5) / 800, 0.9 + 1.4 * (np.arange(560) + 0.5) / 560)
    gap = np.stack([x - point[0], np.full_like(x, -point[1]), z - point[2]], axis=-1)
    distance = np.linalg.norm(gap, axis=-1)
    leaving = -gap / distance[..., None]
    local = np.stack([-leaving[..., 0], leaving[..., 2], leaving[..., 1]], axis=-1)
    flow = np.clip(-leaving @ normal, 0, None) * local[..., 2] / distance**2
    return float((luminance[KLEMS_FULL.bin_of(local)] * flow).sum() * (2.8 / x.size))


def over_the_box(size: tuple[float, float, float], spacing: float) -> tuple[Any, Any]:
    """Points just inside all faces of a box, one at random in each of equal cells, and normals inwards."""
    generator = np.random.default_rng(2)
    points, normals = [], []
    for axis in range(3):
        u, v = (k for k in range(3) if k != axis)
        count = [round(size[k] / spacing) for k in (u, v)]
        cells = np.stack(np.meshgrid(*map(np.arange, count), indexing="ij"), axis=-1).reshape(-1, 2)
        for side in (0.0, size[axis]):
            places = np.zeros((len(cells), 3))
            places[:, (u, v)] = (cells + generator.random(cells.shape)) / count * [size[u], size[v]]
            normal = np.zeros(3)
            normal[axis] = 1.0 if side == 0.0 else -1.0
            places[:, axis] = side
            points.append(places + 1e-4 * normal)
            normals.append(np.tile(normal, (len(cells), 1)))
    return np.concatenate(points), np.concatenate(normals)


def test_sky_and_ground_through_a_lopsided_product_are_the_sum_over_its_table(monkeypatch: pytest.MonkeyPatch) -> None:
    sky, product = GradedSky(5000.0, (0.8, -0.6, 0.0)), MadeUpProduct(lopsided_matrix())
    condition: Any = PlainCondition(sky, ground_luminance_rgb=np.full(3, 2500.0))
    scene = black(product_room(product, monkeypatch))
    points, normals = (
        np.array([[2.0, 1.5, 0.8], [3.9, 4.0, 2.0], [1.0, 2.0, 2.99]]),
        np.array([[0.0, 0, 1], [-1, 0, 0], [0, 0, -1]]),
    )
    result = MitsubaRenderer().illuminance(scene, condition, points, normals, OPTIONS)
    luminance = exit_luminance(product, sky, 2500.0)
    for point, normal, found, error in zip(points, normals, result.illuminance, result.standard_error, strict=True):
        expected = direct_from_panel(luminance, point, normal)
        assert found[1] == pytest.approx(expected, abs=SIGMAS * error + 1e-3 * expected)
        assert error < 0.005 * expected


def test_residual_of_the_sun_is_what_the_bins_say(monkeypatch: pytest.MonkeyPatch) -> None:
    product = MadeUpProduct(lopsided_matrix(), spread=True)
    condition: Any = PlainCondition(NO_SKY, SUN, np.array([90e3, 80e3, 70e3]))
    scene = black(product_room(product, monkeypatch))
    points, normals = np.array([[2.0, 1.5, 0.8], [1.0, 2.0, 2.99]]), np.array([[0.0, 0, 1], [0, 0, -1]])
    result = MitsubaRenderer().illuminance(scene, condition, points, normals, OPTIONS)
    (light,) = panel_light(scene, condition)
    for point, normal, found, error in zip(points, normals, result.illuminance, result.standard_error, strict=True):
        expected = direct_from_panel(light.residual_rgb[:, 1], point, normal)
        assert found[1] == pytest.approx(expected, abs=SIGMAS * error + 1e-3 * expected)
        assert found[0] / found[2] == pytest.approx(9 / 7, rel=1e-5)


def test_a_lobe_lights_its_patch_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    """Illuminance of the ceiling in the beam: flux share of the panel, spread over the beam's own section."""
    direction = unit(-0.2, 0.6, 0.8)
    product = MadeUpProduct(np.zeros((145, 145)), lobes=(Lobe(direction, 0.4),))
    condition: Any = PlainCondition(NO_SKY, SUN, np.full(3, 80e3))
    scene = black(product_room(product, monkeypatch))
    world = panel_groups(scene)[0].to_world(direction)
    lit = np.array([2.0, 0.0, 1.6]) + world * (3.0 - 1.6) / world[2]
    points = np.array([[*lit[:2], 2.999], [0.2, 4.8, 2.999]])
    result = MitsubaRenderer().illuminance(scene, condition, points, np.tile([0, 0, -1.0], (2, 1)), OPTIONS)
    expected = 80e3 * -SUN[1] * 0.4 / direction[2] * world[2]
    assert result.illuminance[0] == pytest.approx(np.full(3, expected), rel=1e-4)
    assert result.illuminance[1] == pytest.approx(np.zeros(3), abs=1e-6)


def test_all_residual_that_a_product_passes_is_absorbed_in_the_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """A grey room of one reflectance and a panel that reflects as much: E mean = flux / (area (1 - rho))."""
    rho, product = 0.5, MadeUpProduct(lopsided_matrix(), 0.5, (), spread=True)
    condition: Any = PlainCondition(NO_SKY, SUN, np.full(3, 80e3))
    scene = product_room(product, monkeypatch)
    scene = replace(scene, materials=tuple(replace(m, reflectance=(rho,) * 3) for m in scene.materials))
    points, normals = over_the_box((4.0, 5.0, 3.0), 0.3)
    result = MitsubaRenderer().illuminance(scene, condition, points, normals, {"batches": 2, "seed": 5})
    flux = 80e3 * -SUN[1] * 2.8 * 0.6
    assert result.illuminance[:, 1].mean() == pytest.approx(flux / (94.0 * (1 - rho)), rel=0.006)


@pytest.mark.parametrize("with_sky", [False, True])
def test_connections_through_panels_change_nothing_but_the_noise(
    with_sky: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    lobes = (Lobe(unit(-0.2, 0.6, 0.8), 0.3), Lobe(unit(0.3, -0.4, 0.9), 0.15))
    product = MadeUpProduct(lopsided_matrix(), 0.2, lobes, True)
    sky = GradedSky(5000.0, (0.8, -0.6, 0.0)) if with_sky else NO_SKY
    condition: Any = PlainCondition(sky, SUN, np.full(3, 20e3), ground_luminance_rgb=np.full(3, 3000.0 * with_sky))
    transport = build_transport_scene(product_room(product, monkeypatch), condition)
    means, errors = [], []
    for connect, first_seed in ((False, 0), (True, 100)):
        integrator = PortalIntegrator(transport, camera_rays(room_view(12, 9)), PathOptions(8, 512, connect=connect))
        values = np.array([integrator.batch(first_seed + k)[:, 1] for k in range(8)])
        means.append(values.mean(axis=0).mean())
        errors.append(values.mean(axis=1).std(ddof=1) / np.sqrt(8))
    assert means[1] == pytest.approx(means[0], abs=SIGMAS * np.hypot(*errors))
    assert np.hypot(*errors) < 0.003 * means[0]


def test_full_physics_refuses_products(monkeypatch: pytest.MonkeyPatch) -> None:
    condition: Any = PlainCondition(NO_SKY, SUN, np.full(3, 80e3))
    scene = product_room(MadeUpProduct(np.zeros((145, 145))), monkeypatch)
    with pytest.raises(InputError, match="physics"):
        build_transport_scene(scene, condition, full_physics=True)

"""Sun patches in metres: synthetic sunlight on a floor, whose area, place and movement are known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from harness_fakes import small_scene

from transom.scene.model import Scene, View
from transom.sun_patch import PatchShift, SunPatch, facing, patch_shift, sun_patches, surface_names
from transom.visible import FirstSurfaces

SAMPLES = 4
"""Samples a pixel and axis, as the engine takes at edges."""


def floor_scene() -> Scene:
    scene = small_scene()
    view = View("down", (0.3, -4.0, 1.6), (0.2, 0.0, 0.0), (0, 0, 1), math.radians(60), 320, 240, 1000.0)
    mesh = dataclasses.replace(scene.mesh, vertices=np.array([[-5.0, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]]))
    return dataclasses.replace(scene, mesh=mesh, views=(view,))


def floor_points(view: View, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Where rays through `samples` x `samples` places of each pixel meet the floor, and whether they do."""
    eye, target, up = (np.array(v, float) for v in (view.position, view.target, view.up))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    half = math.tan(view.vertical_fov_rad / 2)
    columns = (np.arange(view.width * samples) + 0.5) / samples
    rows = (np.arange(view.height * samples) + 0.5) / samples
    x = (2 * columns / view.width - 1) * half * view.width / view.height
    y = (1 - 2 * rows / view.height) * half
    direction = forward + x[None, :, None] * right + y[:, None, None] * above
    with np.errstate(divide="ignore"):
        distance = np.where(direction[..., 2] < 0, -eye[2] / direction[..., 2], 1e9)
    points = eye + distance[..., None] * direction
    return points, (np.abs(points[..., :2]) <= 5).all(axis=-1) & (direction[..., 2] < 0)


def patch_of(low: tuple[float, float], high: tuple[float, float], level: float = 800.0) -> SunPatch:
    scene = floor_scene()
    view = scene.views[0]
    points, on_floor = floor_points(view, SAMPLES)
    lit = on_floor & (points[..., :2] >= low).all(axis=-1) & (points[..., :2] <= high).all(axis=-1)
    sun = level * lit.reshape(view.height, SAMPLES, view.width, SAMPLES).mean(axis=(1, 3))
    centres, is_floor = floor_points(view, 1)
    seen = FirstSurfaces(np.where(is_floor, 0, -1).astype(np.int32), centres.astype(np.float32), is_floor)
    (patch,) = sun_patches(sun, scene, view, seen)
    return patch


def shift(low: tuple[float, float], high: tuple[float, float], by: tuple[float, float]) -> PatchShift:
    moved = [(x + by[0], y + by[1]) for x, y in (low, high)]
    return patch_shift(patch_of(low, high), patch_of(moved[0], moved[1], level=790.0))


def test_area_place_and_outline_of_a_patch_are_those_of_the_rectangle() -> None:
    patch = patch_of((-0.9, -2.1), (0.6, -1.2))
    assert patch.surface == "floor facing up"
    assert patch.area_m2 == pytest.approx(1.5 * 0.9, rel=0.005)
    assert patch.centroid_m == pytest.approx((-0.15, -1.65, 0.0), abs=0.003)
    assert patch.outline_m == pytest.approx(2 * (1.5 + 0.9), rel=0.15)


@pytest.mark.parametrize("by", [(0.010, 0.0), (0.0, 0.010), (-0.006, 0.008)])
def test_shadow_shifted_by_10_mm_is_reported_as_10_mm(by: tuple[float, float]) -> None:
    found = shift((-0.9, -2.1), (0.6, -1.2), by)
    assert found.shift_mm[:2] == pytest.approx((1000 * by[0], 1000 * by[1]), abs=1.0)
    assert found.distance_mm == pytest.approx(10.0, abs=1.0)
    assert found.growth_mm == pytest.approx(0.0, abs=1.0)


def test_shade_that_moves_one_edge_shows_as_growth() -> None:
    before, now = patch_of((-0.9, -2.1), (0.6, -1.2)), patch_of((-0.9, -2.1), (0.61, -1.2))
    found = patch_shift(before, now)
    assert found.shift_mm[0] == pytest.approx(5.0, abs=1.0)
    assert found.growth_mm == pytest.approx(1000 * 0.01 * 0.9 / before.outline_m, abs=0.5)


def test_brighter_sun_moves_nothing() -> None:
    before, now = patch_of((-0.9, -2.1), (0.6, -1.2)), patch_of((-0.9, -2.1), (0.6, -1.2), level=1600.0)
    assert patch_shift(before, now).distance_mm == pytest.approx(0.0, abs=1e-6)


def test_dark_floor_has_no_patch() -> None:
    scene = floor_scene()
    view = scene.views[0]
    centres, is_floor = floor_points(view, 1)
    seen = FirstSurfaces(np.where(is_floor, 0, -1).astype(np.int32), centres.astype(np.float32), is_floor)
    assert sun_patches(np.zeros(is_floor.shape), scene, view, seen) == []


def test_surfaces_are_named_by_object_and_direction() -> None:
    assert surface_names(floor_scene()) == ["floor facing up"]
    assert [facing(normal) for normal in ((0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0.2), (0, -1, 0))] == [
        *("down", "east", "west", "north", "south")
    ]

"""Scenes that grow: loading, patches that small faces share, and memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from transom.bench_hall import hall_scene, write_hall
from transom.daylight.condition import resolve_condition
from transom.engine import Engine, SolveOptions
from transom.scene import load_scene
from transom.scene.enclosure import TriangleRays
from transom.scene.model import Scene
from transom.timing import peak_memory_mib

OPTIONS = SolveOptions(
    target_patch_count=400, patch_rays=256, patch_opening_rays=64, node_rays=128, node_opening_rays=64
)


def overcast_sensors(scene: Scene, options: SolveOptions = OPTIONS) -> tuple[np.ndarray, Engine]:
    engine = Engine.solve(scene, options)
    engine.relight(resolve_condition(replace(scene.conditions[0], sky="overcast"), scene.site))
    sensors = scene.sensors[0]
    return engine.illuminance(sensors.points, sensors.normals, rays=8192, opening_rays=2048)["total"][:, 1], engine


def test_a_hall_has_the_openings_and_triangles_that_were_asked_for(tmp_path: Path) -> None:
    scene = hall_scene(2000, 7)
    assert int((scene.mesh.face_material == len(scene.materials) - 1).sum()) == 7
    assert len(scene.mesh.triangles()[0]) == pytest.approx(2000, rel=0.1)
    loaded = load_scene(write_hall(tmp_path / "hall", scene))
    assert len(loaded.mesh.faces) == len(scene.mesh.faces)
    np.testing.assert_allclose(loaded.sensors[0].points, scene.sensors[0].points)


def test_rays_meet_the_same_triangles_in_blocks_and_without() -> None:
    mesh = hall_scene(1500, 4).mesh
    random = np.random.default_rng(3)
    origins = random.uniform((1, 1, 0.5), (29, 19, 5.5), (200, 3))
    directions = random.normal(size=(200, 3))
    directions[0] = (1, 0, 0)
    whole, blocks = TriangleRays(mesh), TriangleRays(mesh, block_triangles=0)
    ignored = random.random(len(whole.triangles)) < 0.3
    for passed in (None, ignored):
        distance, triangle = whole.nearest(origins, directions, passed)
        block_distance, block_triangle = blocks.nearest(origins, directions, passed)
        np.testing.assert_allclose(block_distance, distance, rtol=1e-12)
        assert np.isfinite(distance).any()
        np.testing.assert_array_equal(block_triangle[np.isfinite(distance)], triangle[np.isfinite(distance)])


def test_small_faces_share_patches() -> None:
    _, engine = overcast_sensors(hall_scene(20000, 12))
    facts = engine.facts()
    assert facts["faces"] > 19000
    assert facts["patches"] < 2 * OPTIONS.target_patch_count
    assert facts["form_factor_defects"]["reciprocity"] < 1e-6
    assert abs(engine.audit(1 << 14).imbalance) < 5e-3


@pytest.mark.slow
def test_finer_bodies_leave_the_light_of_the_room_as_it_is() -> None:
    """The bodies' shape changes by less than 1 % between these; trees keep their area, their leaves become smaller.

    With fewer leaves, whether one hangs over a sensor is luck: a hall of 700 triangles is lit by 15 % more sky.
    """
    options = replace(OPTIONS, target_patch_count=1500)
    coarse, own_patches = overcast_sensors(hall_scene(2900, 12), options)
    fine, shared_patches = overcast_sensors(hall_scene(24000, 12), options)
    assert own_patches.facts()["faces"] < 2 * options.target_patch_count < shared_patches.facts()["faces"]
    np.testing.assert_allclose(fine.mean(), coarse.mean(), rtol=0.03)


@pytest.mark.slow
def test_a_million_triangles_and_two_hundred_openings_take_less_than_two_gigabytes() -> None:
    _, engine = overcast_sensors(hall_scene(1_000_000, 200))
    assert engine.facts()["faces"] > 950_000
    assert engine.facts()["patches"] < 3000
    assert peak_memory_mib() < 2048

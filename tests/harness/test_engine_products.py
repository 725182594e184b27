"""Glazing products in the engine: from a scene's words to light, other products without another solve."""

from __future__ import annotations

import numpy as np
import pytest

from transom.daylight.condition import Condition, resolve_condition
from transom.engine import Engine, SolveOptions
from transom.errors import InputError
from transom.fenestration.reglazing import reglazed
from transom.scene import load_scene
from transom.scene.model import Scene

OPTIONS = SolveOptions(target_patch_count=600, patch_rays=128, node_rays=64, node_opening_rays=64, panel_rays=64)


@pytest.fixture(scope="module")
def room() -> Scene:
    return load_scene("test_room")


@pytest.fixture(scope="module")
def morning(room: Scene) -> Condition:
    return resolve_condition(next(c for c in room.conditions if c.name == "mar21_1000"), room.site)


@pytest.fixture(scope="module")
def prism(room: Scene) -> Engine:
    return Engine.solve(reglazed(room, ["south_upper=prismatic_panel"]), OPTIONS)


def test_flux_that_products_send_in_is_absorbed(prism: Engine, morning: Condition) -> None:
    prism.relight(morning)
    assert prism.facts()["panels"] == 3
    assert abs(prism.audit().imbalance) < 2e-3


def test_another_facet_angle_is_the_light_of_a_new_solve(room: Scene, morning: Condition) -> None:
    other = reglazed(room, ["south_upper=prismatic_panel(angle_low=30, angle_high=60)"])
    engine = Engine.solve(reglazed(room, ["south_upper=prismatic_panel"]), OPTIONS)
    engine.replace_products(other)
    fresh = Engine.solve(other, OPTIONS)
    points, normals = np.array([[2.0, 3.0, 0.8], [3.0, 1.5, 0.8]]), np.array([[0.0, 0, 1], [0, 0, 1]])
    totals = []
    for each in (engine, fresh):
        each.relight(morning)
        totals.append(each.illuminance(points, normals, rays=1024, opening_rays=1024)["total"])
    np.testing.assert_allclose(totals[0], totals[1], rtol=2e-3)


def test_clear_glass_for_a_product_needs_a_solve(room: Scene, prism: Engine) -> None:
    before = prism.scene
    with pytest.raises(InputError, match="Solve the scene anew"):
        prism.replace_products(room)
    assert prism.scene is before

"""Products in the openings of a scene: how they are named, and the frame in which a panel sees light."""

from __future__ import annotations

import numpy as np
import pytest

from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.fenestration.light import panel_light, room_reflectance
from transom.fenestration.load import load_fenestration
from transom.fenestration.panels import panel_axes, panel_groups
from transom.fenestration.reglazing import reglazed
from transom.scene import content_key, load_scene
from transom.scene.model import ConditionSpec, Scene


@pytest.fixture(scope="module")
def room() -> Scene:
    return load_scene("test_room")


@pytest.mark.parametrize("normal", [(0, -1, 0), (1, 0, 0), (0, 0, 1), (0, -0.6, 0.8)])
def test_frame_is_right_handed_and_looks_into_the_room(normal: tuple[float, float, float]) -> None:
    axes = panel_axes(np.array(normal, float))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    np.testing.assert_allclose(axes[2], -np.array(normal), atol=1e-12)


def test_from_the_room_a_south_panel_has_west_to_its_right_and_a_west_panel_north() -> None:
    np.testing.assert_allclose(panel_axes(np.array([0.0, -1.0, 0.0]))[0], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(panel_axes(np.array([-1.0, 0.0, 0.0]))[0], [0, 1, 0], atol=1e-12)


def test_a_product_changes_the_content_of_a_scene_and_glass_put_back_restores_it(room: Scene) -> None:
    panel = reglazed(room, ["south_upper=prismatic_panel(angle_low=30)"])
    other = reglazed(room, ["south_upper=prismatic_panel(angle_low=31)"])
    keys = {content_key(scene) for scene in (room, panel, other)}
    assert len(keys) == 3
    assert content_key(reglazed(panel, ["south_upper=clear:0.82"])) == content_key(room)


def test_panels_of_one_opening_and_orientation_are_one_group(room: Scene) -> None:
    (group,) = panel_groups(reglazed(room, ["south_upper=clear_slab"]))
    assert len(group.faces) == 3
    np.testing.assert_allclose(group.normal, [0, -1, 0], atol=1e-9)


def test_flux_behind_a_panel_is_its_transmittance_of_what_falls_on_it(room: Scene) -> None:
    scene = reglazed(room, ["south_upper=clear_slab"])
    spec = ConditionSpec("noon", "2026-03-21T12:00", direct_normal_illuminance_lx=100_000.0)
    condition = resolve_condition(spec, room.site)
    (light,) = panel_light(scene, condition)
    (group,) = panel_groups(scene)
    assert condition.sun_direction is not None
    cosine = float(condition.sun_direction @ group.normal)
    product = scene.openings[group.opening].product
    assert product is not None
    weights = load_fenestration(product).basis.projected_solid_angles
    residual = float((light.residual_rgb[:, 1] * weights).sum())
    beams = sum(beam.normal_illuminance_rgb[1] * -(beam.direction @ group.normal) for beam in light.beams)
    assert 0.8 < (residual + beams) / (100_000 * cosine) < 0.92
    assert 0 < room_reflectance(scene.openings[group.opening]) < 0.2


@pytest.mark.parametrize(
    ("glazing", "message"),
    [
        ("north=prismatic_panel", "not OPENING=GLAZING"),
        ("south_upper=prismatic", "is not a product"),
        ("south_upper=prismatic_panel(angle=3)", "not a parameter"),
        ("south_upper=prismatic_panel(angle_low)", "not NAME=NUMBER"),
        ("south_upper=clear:1.2", "outside 0"),
        ("south_upper=missing.xml", "does not exist"),
    ],
)
def test_wrong_glazing_is_refused_by_name(room: Scene, glazing: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        reglazed(room, [glazing])

"""The published method from Python, and light that is found beside the drawing, by either method."""

import dataclasses

import numpy as np
import pytest

from transom.daylight.condition import resolve_condition
from transom.engine import Engine, SolveOptions
from transom.errors import InputError
from transom.scene import load_scene

SENSOR_TOLERANCE = 0.05
"""Of illuminance at single points: constant patches and 50 sky points on all openings miss by so much."""


@pytest.fixture(scope="module")
def engines() -> tuple[Engine, Engine]:
    scene = load_scene("test_room")
    return (
        Engine.solve(scene, SolveOptions(method="classic", target_patch_count=1500)),
        Engine.solve(scene, SolveOptions(target_patch_count=1500)),
    )


def test_classic_agrees_with_the_default_at_sensors(engines: tuple[Engine, Engine]) -> None:
    classic, gather = engines
    scene = classic.scene
    sensors = scene.sensors[0]
    values = []
    for engine in (classic, gather):
        engine.relight(resolve_condition(scene.conditions[0], scene.site))
        values.append(engine.illuminance(np.asarray(sensors.points), np.asarray(sensors.normals))["total"][:, 1])
    np.testing.assert_allclose(values[0], values[1], rtol=SENSOR_TOLERANCE)
    assert np.mean(values[0]) == pytest.approx(np.mean(values[1]), rel=0.02)


def test_an_interrupted_relighting_ends_in_the_light_of_the_newest_condition(engines: tuple[Engine, Engine]) -> None:
    classic, _ = engines
    scene = classic.scene
    old, new = (resolve_condition(spec, scene.site) for spec in scene.conditions[:2])
    classic.relight(new)
    fresh = classic.audit().absorbed
    with classic.relighting() as relighting:
        relighting.begin(old)
        relighting.begin(new)  # replaces the old one, whatever was done of it
        relighting.finish()
    assert classic.condition is new
    assert classic.forward_rays > 100_000
    np.testing.assert_allclose(classic.audit().absorbed, fresh, rtol=5e-3)


def test_light_found_beside_the_drawing_is_that_of_a_relighting(engines: tuple[Engine, Engine]) -> None:
    _, gather = engines
    scene = gather.scene
    conditions = [resolve_condition(spec, scene.site) for spec in scene.conditions[:3]]
    view = dataclasses.replace(scene.views[0], width=32, height=24)
    with gather.relighting() as relighting:
        for condition in conditions:
            relighting.begin(condition)
            if relighting.take():
                gather.render(view)
        while not relighting.take():
            gather.render(view)
        beside = gather.render(view).radiance
    assert gather.condition is conditions[-1]
    gather.relight(conditions[-1])
    np.testing.assert_array_equal(beside, gather.render(view).radiance)
    with pytest.raises(RuntimeError, match="has ended"):
        relighting.take()
    with pytest.raises(RuntimeError, match="has ended"):
        relighting.begin(conditions[0])


def test_a_condition_that_cannot_be_is_refused_and_what_is_in_work_goes_on(engines: tuple[Engine, Engine]) -> None:
    _, gather = engines
    good = resolve_condition(gather.scene.conditions[0], gather.scene.site)
    bad = dataclasses.replace(good, ground_luminance_rgb=np.array([-1.0, 0.0, 0.0]))
    with gather.relighting() as relighting:
        relighting.begin(good)
        with pytest.raises(InputError):
            relighting.begin(bad)
        relighting.finish()
    assert gather.condition is good


def test_the_plan_says_what_a_condition_needed(engines: tuple[Engine, Engine]) -> None:
    _, gather = engines
    specs = {spec.name: spec for spec in gather.scene.conditions}
    gather.relight(resolve_condition(specs["overcast"], gather.scene.site))
    assert gather.plan() == {"channels": 3, "beams": 0, "facing_openings": 0, "beam_patches": 0, "unshaded": 0}
    gather.relight(resolve_condition(specs["mar21_1000"], gather.scene.site))
    assert gather.plan()["beams"] == 1
    assert 0 < gather.plan()["beam_patches"] < gather.facts()["patches"] / 2

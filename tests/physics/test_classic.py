"""The published method from Python: it relights in steps, and its means are those of the default method."""

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
    steps = classic.relight_in_steps(old, shots=16)
    assert next(steps) > next(steps) > 0  # left early
    shares = list(classic.relight_in_steps(new, shots=64))
    assert shares == sorted(shares, reverse=True)
    assert classic.forward_rays > 100_000
    np.testing.assert_allclose(classic.audit().absorbed, fresh, rtol=5e-3)


def test_the_default_method_does_not_relight_in_steps(engines: tuple[Engine, Engine]) -> None:
    _, gather = engines
    with pytest.raises(InputError, match="method"):
        next(gather.relight_in_steps(resolve_condition(gather.scene.conditions[0], gather.scene.site)))

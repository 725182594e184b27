"""The engine's sub-suns against path tracing with the sun's disc: what a point errs by behind louvres, and they do."""

from __future__ import annotations

import numpy as np
import pytest

from transom.colour import luminance
from transom.hard.changes import sunlit
from transom.hard.claims import Lit
from transom.hard.disc_cases import BLADES, LOW_SUN, unglazed_louvres
from transom.hard.rooms import WINDOW_M
from transom_reference.mitsuba_renderer import MitsubaRenderer

SENSORS = 16


@pytest.mark.slow
def test_sensors_behind_louvres_have_the_light_of_the_disc() -> None:
    """Through one period of unglazed blades, 2.3 m behind them. Standard errors of the reference are 0.2 % at most.
    Errors here are relative to the mean over the sensors."""
    lit = Lit(unglazed_louvres(), lambda condition: sunlit(condition, LOW_SUN))
    pitch = (WINDOW_M[3] - WINDOW_M[1]) / BLADES
    points = np.tile([1.4, 2.0, 0.7], (SENSORS, 1))
    points[:, 2] += pitch * np.arange(SENSORS) / SENSORS
    normals = np.tile([0.0, 0.0, 1.0], (SENSORS, 1))
    options = {"batches": 8, "physics": "full"}
    full = luminance(MitsubaRenderer().illuminance(lit.scene, lit.condition, points, normals, options).illuminance)
    errors = {}
    for count in (1, 7, 19, 127):
        lit.engine.relight(lit.condition, count)
        ours = luminance(lit.engine.illuminance(points, normals)["total"])
        errors[count] = (float(np.abs(ours - full).mean() / full.mean()), float(ours.mean() / full.mean() - 1))
    mean = {count: error[0] for count, error in errors.items()}
    assert mean[1] > 0.2, errors
    assert mean[7] < 0.08 and mean[19] < 0.04 and mean[127] < 0.015, errors
    assert abs(errors[127][1]) < 0.01, errors

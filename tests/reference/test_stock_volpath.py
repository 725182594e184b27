"""Our integrator against Mitsuba's own `volpath` in a small room with sun, sky and glass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from reference_rooms import GradedSky, PlainCondition, UniformSky, room_view, window_room

from transom_reference.mitsuba_renderer import MitsubaRenderer
from transom_reference.mitsuba_scene import environment_bitmap, stock_volpath

SUN = np.array([0.3, -0.6, 0.6]) / 0.9


def compare(condition: Any, glazing: str, samples: int, batches: int, tolerance: float) -> None:
    scene, view = window_room(glazing), room_view(8, 6)
    ours = MitsubaRenderer().render(scene, condition, view, {"samples": 1024, "batches": 8})
    stock = np.array([stock_volpath(scene, condition, view, samples, seed) for seed in range(1, batches + 1)])
    error = stock.mean(axis=(1, 2)).std(axis=0, ddof=1) / np.sqrt(batches)
    ratio = ours.mean.mean(axis=(0, 1)) / stock.mean(axis=(0, 1, 2)) - 1
    limit = 4 * error / stock.mean(axis=(0, 1, 2)) + 1e-3
    assert np.all(np.abs(ratio) < limit), f"ours / stock - 1 = {ratio}, limit {limit}"
    assert limit.max() < tolerance, "the stock render is too noisy to say anything"


def test_sky_image_is_turned_to_mitsubas_azimuth() -> None:
    """Bright towards the east (+x): the column at our azimuth 0 is Mitsuba's at a quarter of the width."""
    image = np.zeros((5, 8, 3), dtype=np.float32)
    image[:, 0] = 1.0  # azimuth 22.5 degrees from +x towards +y
    turned = environment_bitmap(image)
    assert turned[:, 1].min() == 1.0  # azimuth 67.5 degrees from +y towards +x
    assert turned.sum() == image.sum()


def test_sun_and_sky_through_glass_agree_with_volpath() -> None:
    condition = PlainCondition(UniformSky(5000.0), SUN, np.full(3, 60e3), ground_luminance_rgb=np.full(3, 5000.0))
    compare(condition, "clear", samples=4096, batches=4, tolerance=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("glazing", ["none", "clear"])
@pytest.mark.parametrize(
    "condition",
    [
        PlainCondition(UniformSky(5000.0), ground_luminance_rgb=np.full(3, 5000.0)),
        PlainCondition(GradedSky(5000.0, (0.8, -0.6, 0.0)), ground_luminance_rgb=np.full(3, 2000.0)),
        PlainCondition(UniformSky(0.0), SUN, np.array([80e3, 70e3, 60e3])),
    ],
    ids=["uniform", "graded", "sun"],
)
def test_every_part_of_daylight_agrees_with_volpath(condition: Any, glazing: str) -> None:
    compare(condition, glazing, samples=16384, batches=8, tolerance=0.02)

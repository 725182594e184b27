"""Batches, resumption, noise estimates and options of the reference renderer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from reference_rooms import PlainCondition, UniformSky, room_view, window_room

from transom.colour import luminance
from transom.errors import InputError
from transom_reference.mitsuba_renderer import MitsubaRenderer

CONDITION: Any = PlainCondition(UniformSky(5000.0), ground_luminance_rgb=np.full(3, 2000.0))
SMALL = {"samples": 4, "batches": 6}


class MemoryStore:
    """Batches in memory; counts what was saved."""

    def __init__(self, first: int = 0) -> None:
        self.first = first
        self.kept: dict[int, dict[str, NDArray[Any]]] = {}
        self.saved = 0

    def has(self, index: int) -> bool:
        return index in self.kept

    def load(self, index: int) -> Mapping[str, NDArray[Any]]:
        return self.kept[index]

    def save(self, index: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        self.kept[index] = dict(arrays)
        self.saved += 1


def test_resumed_run_repeats_nothing_and_gives_the_same_image() -> None:
    store, renderer, seen = MemoryStore(), MitsubaRenderer(), []
    view = room_view(16, 12)
    first = renderer.render(window_room(), CONDITION, view, SMALL, lambda d, t: seen.append((d, t)), batches=store)
    assert seen[0] == (0, 6)
    assert seen[-1] == (6, 6)
    del store.kept[3]
    store.saved = 0
    again = renderer.render(window_room(), CONDITION, view, SMALL, batches=store)
    assert store.saved == 1
    np.testing.assert_allclose(again.mean, first.mean, rtol=1e-5)
    assert again.facts["batches_loaded"] == 5


def test_batches_before_the_first_wanted_are_left_out_and_the_others_are_the_same() -> None:
    whole, later, view = MemoryStore(), MemoryStore(first=3), room_view(16, 12)
    MitsubaRenderer().render(window_room(), CONDITION, view, SMALL, batches=whole)
    image = MitsubaRenderer().render(window_room(), CONDITION, view, SMALL, batches=later)
    assert sorted(later.kept) == [3, 4, 5]
    values = np.array([whole.kept[index]["values"] for index in (3, 4, 5)])
    np.testing.assert_array_equal(later.kept[4]["values"], values[1])
    assert image.halves is not None
    np.testing.assert_allclose(image.halves[0], values[1], rtol=1e-6)
    np.testing.assert_allclose(image.halves[1], (values[0] + values[2]) / 2, rtol=1e-6)
    np.testing.assert_allclose(image.mean, values.mean(axis=0), rtol=1e-6)


def test_halves_average_to_the_mean() -> None:
    image = MitsubaRenderer().render(window_room(), CONDITION, room_view(16, 12), SMALL)
    assert image.halves is not None
    np.testing.assert_allclose((image.halves[0] + image.halves[1]) / 2, image.mean, rtol=1e-5)


def test_standard_error_describes_the_spread_of_independent_runs() -> None:
    """The mean over pixels of squared standard errors equals half the mean squared difference of two seeds."""
    view = room_view(32, 24)
    runs = [
        MitsubaRenderer().render(window_room(), CONDITION, view, {"samples": 4, "batches": 16, "seed": seed})
        for seed in (1, 2)
    ]
    difference = np.asarray(luminance(runs[0].mean)) - np.asarray(luminance(runs[1].mean))
    errors = [run.standard_error for run in runs if run.standard_error is not None]
    scale = np.sqrt(errors[0] ** 2 + errors[1] ** 2)
    assert np.sqrt(np.mean((difference / scale) ** 2)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    ("options", "field"),
    [({"samples": 48}, "samples"), ({"batches": 1}, "batches"), ({"physics": "real"}, "physics"), ({"spp": 4}, "spp")],
)
def test_wrong_option_is_named(options: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        MitsubaRenderer().render(window_room(), CONDITION, room_view(), options)

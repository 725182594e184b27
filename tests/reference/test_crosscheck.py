"""The referees' cross-check: it passes where both are right, and catches one that is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reference_rooms import PlainCondition, window_room

from transom import validation
from transom.colour import luminance
from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.crosscheck import check_picture, check_sensors, ladder_options
from transom.daylight.cie_sky import CieSky
from transom.daylight.sky_model import SkyModel
from transom.judge import Missing, Outcome, judge, read_tolerances
from transom.referee_pictures import block_difference, halved
from transom.renderer import ImageResult, Renderer
from transom.scene import scene_root
from transom.scene.model import View
from transom.sensor_file import SensorTable
from transom.suite import SuiteCase
from transom_reference.mitsuba_renderer import MitsubaRenderer
from transom_reference.radiance_renderer import PRESETS, RadianceRenderer

SUN = (0.48, -0.6, 0.64)
SENSORS = SensorTable(
    ("a", "b", "c"),
    np.array([[2.0, 0.8, 0.8], [1.2, 0.6, 0.8], [2.8, 1.0, 1.2]]),
    np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.0, -0.6, 0.8]]),
)
BATCHES = 32


def sky_of(level: float) -> Any:
    return PlainCondition(SkyModel(CieSky(12), SUN, level), ground_luminance_rgb=np.full(3, 0.2 * level))


def measured(renderer: Renderer, condition: Any, options: dict[str, Any]) -> SensorTable:
    result = renderer.illuminance(window_room(), condition, SENSORS.points, SENSORS.normals, options)
    return SENSORS.measured(luminance(result.illuminance), result.standard_error)


def entry() -> SuiteCase:
    condition: Any = replace(sky_of(1.0))
    object.__setattr__(condition, "name", "clear")
    return SuiteCase(window_room(), condition, (), True)


def outcome(rows: Any) -> list[Outcome]:
    comparison = Comparison(COMPARISON_FORMAT, "crosscheck", "", crosschecks=tuple(rows))
    verdicts = judge(comparison.subjects(), comparison.missing, read_tolerances(scene_root() / "tolerances.toml"))
    return [verdict.outcome for verdict in verdicts]


@pytest.mark.slow
def test_cross_check_passes_two_right_references_and_fails_a_sky_of_3_percent_more() -> None:
    mitsuba = measured(MitsubaRenderer(), sky_of(2000.0), {"batches": BATCHES})
    options = {"preset": "exact", "samples": 14, "passes": BATCHES}
    for level, expected in ((2000.0, Outcome.PASS), (2060.0, Outcome.FAIL)):
        radiance = measured(RadianceRenderer(), sky_of(level), options)
        rows = check_sensors(entry(), "matched", radiance, mitsuba, BATCHES)
        assert outcome(rows) == [expected], rows


def noisy(level: np.ndarray[Any, Any], share: float, seed: int) -> ImageResult:
    """A grey picture of two independent noisy halves."""
    generator = np.random.default_rng(seed)
    halves = [
        np.repeat((level * (1 + share * generator.normal(size=level.shape)))[..., None], 3, axis=2).astype(np.float32)
        for _ in range(2)
    ]
    mean = (halves[0] + halves[1]) / 2
    return ImageResult(mean, (halves[0], halves[1]), (level * share / np.sqrt(2)).astype(np.float32))


LEVEL = 100 + 50 * np.sin(np.arange(120 * 160) / 500.0).reshape(120, 160)
EVERYWHERE = np.ones(LEVEL.shape, dtype=bool)


def test_noise_is_no_difference_of_blocks() -> None:
    """Blocks of 3 % of noise: their own differences would be 4 %."""
    value, error = block_difference(noisy(LEVEL, 0.12, 1), noisy(LEVEL, 0.12, 2), EVERYWHERE)
    assert value < 0.01
    assert error < 0.005


def test_pattern_of_4_percent_is_a_difference_of_blocks() -> None:
    pattern = 1 + 0.04 * np.sign(np.sin((np.arange(160) + 0.5) / 160 * 20 * np.pi))
    value, error = block_difference(noisy(LEVEL * pattern, 0.12, 1), noisy(LEVEL, 0.12, 2), EVERYWHERE)
    assert value == pytest.approx(0.04, abs=4 * error)


def test_picture_that_is_3_percent_too_bright_fails() -> None:
    view = View("in", (0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 0.0, 1.0), 1.0, 160, 120, 1000.0)
    right = noisy(LEVEL, 0.1, 1)
    for factor, expected in ((1.0, Outcome.PASS), (1.03, Outcome.FAIL)):
        rows = check_picture(entry(), view, noisy(factor * LEVEL, 0.1, 2), right, {"interior": EVERYWHERE}, BATCHES)
        assert outcome(rows) == [expected, expected], rows


def test_halving_keeps_means_and_halves_the_noise_of_independent_pixels() -> None:
    image = noisy(np.full((120, 160), 100.0), 0.1, 4)
    small = halved(image)
    assert small.mean.shape == (60, 80, 3)
    assert small.mean.mean() == pytest.approx(image.mean.mean(), rel=1e-6)
    assert small.standard_error is not None and image.standard_error is not None
    assert small.standard_error.mean() == pytest.approx(image.standard_error.mean() / 2, rel=1e-5)


class Measured:
    """A bundle of sensors that is not on disk."""

    def __init__(self, values: list[float], errors: list[float]) -> None:
        self.table = SENSORS.measured(np.array(values), np.array(errors))

    def sensors(self) -> SensorTable:
        return self.table


def test_model_error_is_matched_against_full_with_both_noises(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = {
        False: Measured([102.0, 99.0, 50.0], [0.3, 0.0, 0.0]),
        True: Measured([100.0, 100.0, 50.0], [0.4, 0.1, 0.0]),
    }
    monkeypatch.setattr(validation, "sensors_of", lambda _entry, _name, options: answers[bool(options)])
    rows = validation.sensor_model_errors(entry(), [])
    assert [row.model_error_percent for row in rows] == pytest.approx([2.0, -1.0, 0.0])
    assert [row.uncertainty_percent for row in rows] == pytest.approx([0.5, 0.1, 0.0])


def test_missing_full_physics_is_missing_and_no_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validation, "sensors_of", lambda *_: None)
    missing: list[Missing] = []
    assert validation.sensor_model_errors(entry(), missing) == []
    assert [gap.outcome for gap in missing] == [Outcome.NO_REFERENCE]


def test_ladder_rises_to_the_accurate_preset() -> None:
    steps = ladder_options()
    assert steps[-1] == {"preset": "accurate"}
    assert {"preset": "fast"} in steps
    for option in ("-ab", "-ad", "-ar"):
        words = [(step.get("parameters") or PRESETS[step["preset"]].parameters).split() for step in steps]
        values = [int(step[step.index(option) + 1]) for step in words]
        assert values == sorted(values), option

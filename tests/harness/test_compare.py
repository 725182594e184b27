"""Error measures on simulated pictures whose errors are known."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from harness_fakes import grey
from numpy.typing import NDArray

from transom.compare import (
    CaseNames,
    SensorComparison,
    block_errors,
    compare_images,
    compare_region,
    compare_sensors,
    cross_half_mse,
)
from transom.comparison import (
    COMPARISON_FORMAT,
    Comparison,
    CrossCheck,
    read_comparison,
    reference_kind,
    write_comparison,
)
from transom.errors import InputError
from transom.judge import Outcome, ToleranceFile, judge
from transom.noise import mean_relative_standard_error
from transom.renderer import ImageResult
from transom.sensor_file import SensorTable, read_sensors, write_sensors
from transom.visible import EXTERIOR, INTERIOR

NAMES = CaseNames("room", "noon", "rays", "mitsuba", "view")
SHAPE = (120, 160)
EVERYWHERE = np.ones(SHAPE, bool)


def noisy_reference(truth: NDArray[np.float64], relative_noise: float, seed: int, samples: int = 2) -> ImageResult:
    """A reference with two halves; `relative_noise` is that of the mean."""
    random = np.random.default_rng(seed)
    spread = relative_noise * np.sqrt(samples)
    halves = [truth * (1 + spread * random.standard_normal(truth.shape)) for _ in range(2)]
    error = (relative_noise * truth).astype(np.float32)
    return ImageResult(grey((halves[0] + halves[1]) / 2), (grey(halves[0]), grey(halves[1])), error)


def smooth_truth() -> NDArray[np.float64]:
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return 200.0 + 100 * np.sin(rows / 20) * np.cos(columns / 30)


def test_uniform_error_is_found_exactly_in_every_measure() -> None:
    truth = smooth_truth()
    result = compare_region(ImageResult(grey(1.03 * truth)), ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    # The floor of 1 % of the median takes about a hundredth of each relative error away.
    assert result.mean_relative_error_percent == pytest.approx(3.0, rel=0.02)
    assert result.bias_percent == pytest.approx(3.0, rel=1e-4)
    assert result.bias_standard_error_percent == 0
    assert result.block_p50_percent == pytest.approx(3.0, rel=0.03)
    assert (result.share_within_2_percent, result.share_within_5_percent) == (0.0, 100.0)
    assert result.floor_cd_m2 == pytest.approx(0.01 * np.median(truth), rel=1e-4)


def test_identical_pictures_have_no_error() -> None:
    picture = ImageResult(grey(smooth_truth()))
    result = compare_region(picture, picture, EVERYWHERE, "all", NAMES)
    assert result.mean_relative_error_percent == result.bias_percent == result.relative_rmse_percent == 0
    assert result.share_within_2_percent == 100


def test_cross_half_estimator_is_unbiased_by_noise_where_the_plain_one_is_not() -> None:
    truth, error, noise = 100.0, 3.0, 20.0
    random = np.random.default_rng(11)
    cross, plain = [], []
    for _ in range(400):
        halves = truth + noise * random.standard_normal((2, 2000))
        engine = np.full(2000, truth + error)
        cross.append(cross_half_mse(engine, halves[0], halves[1]))
        plain.append(float(np.mean((engine - halves.mean(axis=0)) ** 2)))
    standard_error = np.std(cross) / np.sqrt(len(cross))
    assert np.mean(cross) == pytest.approx(error**2, abs=4 * standard_error)
    assert np.mean(plain) == pytest.approx(error**2 + noise**2 / 2, rel=0.02), "inflated by the variance of the mean"


def test_perfect_engine_against_noise_is_reported_below_the_noise_about_half_the_time() -> None:
    truth = smooth_truth()
    outcomes = [
        compare_region(ImageResult(grey(truth)), noisy_reference(truth, 0.01, seed), EVERYWHERE, "all", NAMES)
        for seed in range(40)
    ]
    below = sum(result.relative_rmse_percent is None for result in outcomes)
    assert 8 <= below <= 32


@pytest.mark.parametrize("noise", [0.005, 0.01, 0.02])
def test_true_mean_relative_error_lies_between_extrapolated_and_raw(noise: float) -> None:
    truth = smooth_truth()
    pattern = 0.03 * np.sin(np.arange(SHAPE[1]) / 7.0)[None, :]
    engine = ImageResult(grey(truth * (1 + pattern)))
    exact = compare_region(engine, ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    results = [
        compare_region(engine, noisy_reference(truth, noise, seed), EVERYWHERE, "all", NAMES) for seed in range(6)
    ]
    raw = np.mean([result.mean_relative_error_raw_percent for result in results])
    extrapolated = np.mean([result.mean_relative_error_percent for result in results])
    wanted = exact.mean_relative_error_percent
    slack = 4 * results[0].mean_relative_error_standard_error_percent / np.sqrt(len(results))
    assert wanted - slack <= raw
    assert abs(extrapolated - wanted) < abs(raw - wanted)
    assert results[0].reference_standard_error_percent == pytest.approx(100 * noise, rel=0.03)


def test_standard_error_of_the_bias_covers_what_noise_does() -> None:
    truth = smooth_truth()
    engine = ImageResult(grey(truth))
    results = [
        compare_region(engine, noisy_reference(truth, 0.05, seed), EVERYWHERE, "all", NAMES) for seed in range(60)
    ]
    spread = np.std([result.bias_percent for result in results])
    assert np.mean([result.bias_standard_error_percent for result in results]) >= 0.9 * spread


def test_regions_are_apart_and_exterior_is_not_in_the_interior() -> None:
    truth = smooth_truth()
    interior = EVERYWHERE.copy()
    interior[:40] = False
    engine = truth.copy()
    engine[:40] *= 2
    desk = interior.copy()
    desk[:100] = False
    engine[100:] *= 1.1
    masks = {INTERIOR: interior, "desk": desk, EXTERIOR: ~interior}
    rows = compare_images(ImageResult(grey(engine)), ImageResult(grey(truth)), masks, NAMES)
    by_name = {row.region: row for row in rows}
    assert set(by_name) == {INTERIOR, "desk", EXTERIOR}
    assert by_name["desk"].bias_percent == pytest.approx(10.0, rel=1e-3)
    assert by_name[EXTERIOR].bias_percent == pytest.approx(100.0, rel=1e-3)
    assert by_name[INTERIOR].bias_percent < 10
    assert by_name[INTERIOR].pixel_count == 80 * 160


def test_blocks_average_noise_that_pixels_keep() -> None:
    truth = smooth_truth()
    result = compare_region(ImageResult(grey(truth)), noisy_reference(truth, 0.04, 5), EVERYWHERE, "all", NAMES)
    assert result.block_p50_percent < result.mean_relative_error_raw_percent / 2


def test_blocks_count_only_pixels_in_the_mask() -> None:
    mask = np.zeros((8, 8), bool)
    mask[:4, :2] = True
    engine, reference = np.full((8, 8), 110.0), np.full((8, 8), 100.0)
    engine[~mask] = 900.0
    errors = block_errors(engine, reference, mask, 0.0)
    np.testing.assert_allclose(errors, [0.1])


def test_black_pixels_do_not_divide_by_zero() -> None:
    black = ImageResult(grey(np.zeros(SHAPE)))
    result = compare_region(black, black, EVERYWHERE, "all", NAMES)
    assert all(np.isfinite(value) for value in dataclasses.asdict(result).values() if isinstance(value, float))


def test_pictures_of_different_size_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot be compared"):
        compare_region(ImageResult(grey(np.ones((4, 4)))), ImageResult(grey(np.ones((4, 5)))), EVERYWHERE, "a", NAMES)


def test_noise_of_a_picture_is_the_mean_over_pixels_of_its_relative_error() -> None:
    truth = smooth_truth()
    assert mean_relative_standard_error(noisy_reference(truth, 0.03, 1), EVERYWHERE) == pytest.approx(0.03, rel=0.03)


def test_sensor_error_is_relative_to_the_reference() -> None:
    points, normals = np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0, 0, 1.0]] * 2)
    place = SensorTable(("desk", "desk"), points, normals)
    engine = place.measured(np.array([103.0, 0.0]), np.zeros(2))
    reference = place.measured(np.array([100.0, 0.0]), np.array([0.2, 0.0]))
    first, dark = compare_sensors(engine, reference, NAMES)
    assert first.error_percent == pytest.approx(3.0)
    assert first.error_standard_error_percent == pytest.approx(0.2 * 1.03), "of E / R, whose derivative by R is E / R²"
    assert dark.error_percent == 0
    moved = SensorTable(("desk", "desk"), points + 0.1, normals).measured(np.ones(2), np.zeros(2))
    with pytest.raises(ValueError, match="different sensors"):
        compare_sensors(moved, reference, NAMES)


def test_numerical_bias_is_the_change_from_half_as_many_patches() -> None:
    truth = smooth_truth()
    ours, coarse = ImageResult(grey(1.01 * truth)), ImageResult(grey(1.03 * truth))
    result = compare_region(ours, ImageResult(grey(truth)), EVERYWHERE, "all", NAMES, coarse)
    assert result.bias_numerical_percent == pytest.approx(2.0, rel=1e-3)
    assert result.mean_relative_error_numerical_percent == pytest.approx(2.0, rel=0.02)
    assert compare_region(ours, ours, EVERYWHERE, "all", NAMES).bias_numerical_percent is None


def test_noise_that_pixels_share_is_in_the_uncertainty_of_the_mean() -> None:
    """A reference whose every batch is too bright or too dark as a whole: its pixels agree, its batches do not."""
    truth, random = smooth_truth(), np.random.default_rng(2)
    levels = 1 + 0.05 * random.standard_normal(64)
    means = dataclasses.replace(NAMES, reference_means={"all": [float(truth.mean() * level) for level in levels]})
    reference = ImageResult(grey(truth * levels.mean()))
    result = compare_region(ImageResult(grey(truth)), reference, EVERYWHERE, "all", means)
    assert result.bias_standard_error_percent == pytest.approx(5.0 / 8, rel=0.25)
    assert abs(result.bias_percent) < 4 * result.bias_standard_error_percent
    assert result.mean_relative_error_standard_error_percent >= result.bias_standard_error_percent * 0.99


def noisy_with_groups(error: float = 0.02) -> tuple[ImageResult, ImageResult, CaseNames]:
    """Engine, reference and names whose reference has three groups of batches."""
    truth = smooth_truth()
    means = [float(truth.mean() * level) for level in (0.99, 1.0, 1.01)]
    names = dataclasses.replace(NAMES, reference_means={"all": means}, reference_batch_count=3)
    return ImageResult(grey(truth * (1 + error))), noisy_reference(truth, 0.01, 3), names


def test_few_groups_of_batches_are_said_so_that_students_quantile_is_theirs() -> None:
    engine, reference, names = noisy_with_groups()
    result = compare_region(engine, reference, EVERYWHERE, "all", names)
    assert result.reference_group_count == 3
    expected = 0.01 * smooth_truth().mean() / np.sqrt(3)
    assert result.reference_mean_standard_error_cd_m2 == pytest.approx(expected), "spread of 1 %, by N - 1"
    without = dataclasses.replace(names, reference_means={})
    assert compare_region(engine, reference, EVERYWHERE, "all", without).reference_group_count == 2, "its two halves"
    exact = compare_region(engine, ImageResult(grey(smooth_truth())), EVERYWHERE, "all", NAMES)
    assert exact.reference_group_count == 0


def test_light_where_the_reference_is_black_is_an_error_of_100_percent() -> None:
    black, engine = ImageResult(grey(np.zeros(SHAPE))), ImageResult(grey(np.full(SHAPE, 5.0)))
    result = compare_region(engine, black, EVERYWHERE, "all", NAMES)
    assert result.mean_relative_error_percent == result.bias_percent == result.block_p95_percent == 100
    assert result.share_within_10_percent == 0
    both = compare_region(black, black, EVERYWHERE, "all", NAMES)
    assert both.mean_relative_error_percent == both.bias_percent == both.block_p95_percent == 0
    assert both.share_within_2_percent == 100


def test_one_black_pixel_of_the_reference_counts_against_the_floor() -> None:
    truth = np.full(SHAPE, 100.0)
    truth[0, 0] = 0.0
    engine = np.full(SHAPE, 100.0)
    result = compare_region(ImageResult(grey(engine)), ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    # 100 cd/m² over the floor of 1 cd/m², in one pixel of all.
    assert result.mean_relative_error_percent == pytest.approx(100 * 100 / truth.size, rel=1e-5)
    assert (result.dark_pixel_count, result.floor_cd_m2) == (1, pytest.approx(1.0))
    assert result.light_leak_percent == pytest.approx(100 * 100 / truth.sum(), rel=1e-4)


def test_mostly_black_reference_has_a_floor_of_its_mean() -> None:
    truth = np.zeros(SHAPE)
    truth[:40] = 90.0
    engine = truth.copy()
    engine[40:] = 0.09
    result = compare_region(ImageResult(grey(engine)), ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    assert result.floor_cd_m2 == pytest.approx(0.3)
    assert result.mean_relative_error_percent == pytest.approx(100 * 0.3 * 80 / 120, rel=1e-4)
    assert result.light_leak_percent == pytest.approx(100 * 0.09 * 80 / (90 * 40), rel=1e-4)


def test_light_leak_is_zero_for_a_dark_engine_and_for_a_lit_reference() -> None:
    truth = smooth_truth()
    result = compare_region(ImageResult(grey(1.1 * truth)), ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    assert (result.dark_pixel_count, result.light_leak_percent) == (0, 0.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_engine_that_is_not_finite_is_named_as_a_fault_and_its_row_stays_finite(value: float) -> None:
    truth = smooth_truth()
    engine = truth.copy()
    engine[3, 4:7] = value
    result = compare_region(ImageResult(grey(engine)), ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    assert result.fault == f"3 of {truth.size} pixels of the engine are not finite"
    assert all(np.isfinite(entry) for entry in dataclasses.asdict(result).values() if isinstance(entry, float))
    assert result.mean_relative_error_percent > 0, "they count as black"
    elsewhere = EVERYWHERE.copy()
    elsewhere[:8] = False
    apart = compare_region(ImageResult(grey(engine)), ImageResult(grey(truth)), elsewhere, "all", NAMES)
    assert (apart.fault, apart.mean_relative_error_percent) == ("", 0.0)


@pytest.mark.parametrize("part", ["mean", "half", "standard_error"])
def test_reference_that_is_not_finite_is_an_error_that_names_the_bundle(part: str) -> None:
    reference = noisy_reference(smooth_truth(), 0.01, 1)
    assert reference.halves is not None
    assert reference.standard_error is not None
    broken = {"mean": reference.mean, "half": reference.halves[1], "standard_error": reference.standard_error}[part]
    broken[5, 5] = np.nan
    names = dataclasses.replace(NAMES, reference_file="store/room-view-noon-mitsuba-0123")
    with pytest.raises(InputError, match=r"room-view-noon-mitsuba-0123: image.exr holds values that are not finite"):
        compare_region(ImageResult(grey(smooth_truth())), reference, EVERYWHERE, "all", names)


def test_region_without_pixels_has_no_row_and_does_not_stop_the_others() -> None:
    picture = ImageResult(grey(smooth_truth()))
    rows = compare_images(picture, picture, {"nothing": ~EVERYWHERE, "all": EVERYWHERE}, NAMES)
    assert [row.region for row in rows] == ["all"]
    with pytest.raises(ValueError, match="nothing has no pixel"):
        compare_region(picture, picture, ~EVERYWHERE, "nothing", NAMES)


def test_region_too_small_for_blocks_counts_as_one_block() -> None:
    truth, mask = smooth_truth(), ~EVERYWHERE
    mask[0, :5] = True
    result = compare_region(ImageResult(grey(1.02 * truth)), noisy_reference(truth, 0.001, 1), mask, "few", NAMES)
    assert result.pixel_count == 5
    assert result.block_p95_percent == pytest.approx(2.0, abs=0.3)
    assert result.block_p95_percent == pytest.approx(result.block_p50_percent)


def test_rows_say_what_physics_their_reference_has() -> None:
    picture = ImageResult(grey(smooth_truth()))
    full = dataclasses.replace(NAMES, physics="full")
    assert compare_region(picture, picture, EVERYWHERE, "all", full).physics == "full"
    assert compare_region(picture, picture, EVERYWHERE, "all", NAMES).physics == "matched"
    assert [reference_kind(name) for name in ("full", "matched", "closed form")] == [
        "validation",
        "verification",
        "verification",
    ]


def test_pixel_quantiles_are_of_pixels_and_block_quantiles_of_blocks() -> None:
    truth = np.full(SHAPE, 100.0)
    engine = truth.copy()
    engine[::4, ::4] *= 1.32
    result = compare_region(ImageResult(grey(engine)), ImageResult(grey(truth)), EVERYWHERE, "all", NAMES)
    assert (result.pixel_p50_percent, result.pixel_p95_percent) == (0.0, pytest.approx(32 / 1.01, rel=1e-4))
    assert result.block_p95_percent == pytest.approx(2 / 1.01, rel=1e-3)


def sensors(engine: list[float], reference: list[float]) -> list[SensorComparison]:
    points, normals = np.array([[float(i), 0, 0] for i in range(len(engine))]), np.array([[0, 0, 1.0]] * len(engine))
    place = SensorTable(("desk",) * len(engine), points, normals)
    truth = place.measured(np.array(reference), np.full(len(engine), 0.1))
    return compare_sensors(place.measured(np.array(engine), np.zeros(len(engine))), truth, NAMES)


def test_dark_sensors_are_judged_against_a_floor_and_light_in_the_dark_is_100_percent() -> None:
    rows = sensors([100.0, 100.0, 1.5], [100.0, 100.0, 0.5])
    assert rows[2].error_percent == pytest.approx(100.0), "1 lx too much, at a floor of 1 % of 100 lx"
    assert [row.error_percent for row in sensors([0.0, 2.0], [0.0, 0.0])] == [0.0, 100.0]


def test_sensor_of_the_engine_that_is_not_finite_is_a_fault_and_one_of_the_reference_an_error() -> None:
    first, second = sensors([np.nan, 100.0], [100.0, 100.0])
    assert (first.fault, first.error_percent) == ("illuminance of the engine is nan", -100.0)
    assert second.fault == ""
    with pytest.raises(InputError, match="not finite"):
        sensors([100.0], [np.inf])


def test_faults_fail_even_without_a_tolerance_and_say_what_is_wrong() -> None:
    row = dataclasses.replace(
        compare_region(*(ImageResult(grey(smooth_truth())),) * 2, EVERYWHERE, "all", NAMES), fault="is not finite"
    )
    comparison = Comparison(COMPARISON_FORMAT, "s", "S", images=(row,), sensors=tuple(sensors([np.inf], [1.0])))
    rule = {"quantity": "analytic_percent", "tolerance": 1.0, "reason": "stated"}
    tolerances = ToleranceFile.model_validate({"format": 1, "tolerances": [rule]})
    verdicts = judge(comparison.subjects(), [], tolerances)
    assert [verdict.outcome for verdict in verdicts] == [Outcome.FAIL] * 4
    assert {verdict.reason for verdict in verdicts} == {"is not finite", "illuminance of the engine is inf"}


def test_comparison_with_values_that_are_not_finite_is_written_and_read_back(tmp_path: Path) -> None:
    check = CrossCheck("a", "v", "r", "c", "sensor", "lx", "matched", "x", "y", 1.0, 0.0, np.nan, np.inf)
    write_comparison(tmp_path / "c.json", Comparison(COMPARISON_FORMAT, "s", "S", crosschecks=(check,)))
    (subject,) = read_comparison(tmp_path / "c.json").subjects()
    assert np.isnan(subject.difference)
    assert subject.uncertainty == np.inf


def test_sensor_file_keeps_values_that_are_not_finite_for_the_comparison_to_name(tmp_path: Path) -> None:
    place = SensorTable(("desk",), np.zeros((1, 3)), np.array([[0, 0, 1.0]]))
    write_sensors(tmp_path / "sensors.csv", place.measured(np.array([np.nan]), np.zeros(1)))
    engine = read_sensors(tmp_path / "sensors.csv")
    (row,) = compare_sensors(engine, place.measured(np.array([5.0]), np.array([0.1])), NAMES)
    assert row.fault == "illuminance of the engine is nan"

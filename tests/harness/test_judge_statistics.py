"""The judge and its error measures on simulated errors: how often noise alone makes them wrong, and what they find.

Rates are compared with what they must be within the binomial interval in which 99.9 % of fair simulations lie.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from harness_fakes import grey
from numpy.typing import NDArray
from scipy import ndimage, stats

from transom.compare import CaseNames, ImageComparison, compare_region
from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.error_measures import (
    MEAN_EXCESS,
    MEAN_SHORTFALL,
    QUANTILE_EXCESS,
    Estimate,
    Region,
    block_error_quantiles,
    block_errors,
    cross_half_mse,
    mean_relative_error,
)
from transom.judge import Outcome, Subject, ToleranceFile, Verdict, coverage_factor, judge
from transom.noise import floor_cd_m2, standard_error_of_mean, tile_indices
from transom.renderer import ImageResult

Float64 = NDArray[np.float64]

ALPHA, TOLERANCE = 0.05, 3.0
JUST_INSIDE, JUST_OUTSIDE = TOLERANCE - 1e-9, TOLERANCE + 1e-9
RULES = ToleranceFile.model_validate(
    {
        "format": 1,
        "alpha": ALPHA,
        "tolerances": [
            {"quantity": "bias_percent", "tolerance": TOLERANCE, "reason": "stated"},
            {"quantity": "mean_relative_error_percent", "tolerance": TOLERANCE, "reason": "stated"},
        ],
    }
)
NAMES = CaseNames("room", "noon", "rays", "mitsuba", "view")


def interval(rate: float, trials: int) -> tuple[float, float]:
    """Rates between which 99.9 % of simulations of so many trials lie."""
    low, high = stats.binom.interval(0.999, trials, rate)
    return float(low) / trials, float(high) / trials


def judged_suites(
    truths: Sequence[float], u: float, suites: int, batches: int = 32, seed: int = 1, numerical_bias: float = 0.0
) -> list[list[Verdict]]:
    """Verdicts of suites with these true errors [%], seen through batches so noisy that their mean has error u."""
    random = np.random.default_rng(seed)
    values = random.standard_normal((suites, len(truths), batches))
    means = np.asarray(truths) + u * math.sqrt(batches) * values.mean(axis=2)
    errors = u * values.std(axis=2, ddof=1)
    place = ("room", "view", "interior", "noon", "rays", "mitsuba")
    return [
        judge(
            [
                Subject("bias_percent", *place, float(mean), float(error), numerical_bias, batches)
                for mean, error in zip(suite_means, suite_errors, strict=True)
            ],
            [],
            RULES,
        )
        for suite_means, suite_errors in zip(means, errors, strict=True)
    ]


def rate_of(outcome: Outcome, judged: Sequence[Sequence[Verdict]]) -> float:
    """Share of suites in which at least one verdict is `outcome`."""
    return float(np.mean([any(verdict.outcome is outcome for verdict in suite) for suite in judged]))


def at_tolerance(value: float, count: int) -> list[float]:
    """So many errors of that size, with alternating signs."""
    return [value * (-1) ** index for index in range(count)]


@pytest.mark.parametrize(("count", "batches", "suites"), [(1, 32, 3000), (1, 3, 3000), (20, 32, 800), (60, 8, 300)])
def test_false_alarms_come_in_alpha_of_suites_whatever_their_size_and_the_batches(
    count: int, batches: int, suites: int
) -> None:
    """Every error is exactly at its tolerance, the worst that is still right."""
    low, high = interval(ALPHA, suites)
    judged = judged_suites(at_tolerance(JUST_INSIDE, count), 0.3, suites, batches)
    assert low <= rate_of(Outcome.FAIL, judged) <= high


@pytest.mark.parametrize(("count", "batches", "suites"), [(1, 32, 3000), (1, 3, 3000), (20, 32, 800), (60, 8, 300)])
def test_wrong_passes_come_in_alpha_of_suites_whatever_their_size_and_the_batches(
    count: int, batches: int, suites: int
) -> None:
    low, high = interval(ALPHA, suites)
    judged = judged_suites(at_tolerance(JUST_OUTSIDE, count), 0.3, suites, batches, seed=2)
    assert low <= rate_of(Outcome.PASS, judged) <= high


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 1.0, 3.0, 10.0])
def test_no_amount_of_reference_noise_turns_a_fail_into_a_pass_beyond_alpha(share: float) -> None:
    suites = 600
    judged = judged_suites(at_tolerance(1.02 * TOLERANCE, 5), share * TOLERANCE, suites, seed=3)
    assert rate_of(Outcome.PASS, judged) <= interval(ALPHA, suites)[1]


@pytest.mark.parametrize("share", [0.1, 0.3, 1.0])
@pytest.mark.parametrize("truth", [0.0, 0.5, 0.98])
def test_no_reference_noise_up_to_the_tolerance_turns_a_pass_into_a_fail_beyond_alpha(
    share: float, truth: float
) -> None:
    suites = 600
    judged = judged_suites(at_tolerance(truth * TOLERANCE, 5), share * TOLERANCE, suites, seed=4)
    assert rate_of(Outcome.FAIL, judged) <= interval(ALPHA, suites)[1]


def test_error_of_one_and_a_half_tolerances_is_found_as_often_as_theory_says() -> None:
    """u = T/6 and 32 batches: 0.5 T is 3 u, and the chance of a FAIL is that of a noncentral t beyond k: 90 %."""
    suites, u = 4000, TOLERANCE / 6
    expected = float(stats.nct.sf(coverage_factor(ALPHA, 1, 32), 31, 3.0))
    assert expected > 0.88
    low, high = interval(expected, suites)
    assert low <= rate_of(Outcome.FAIL, judged_suites([1.5 * TOLERANCE], u, suites)) <= high
    assert low <= rate_of(Outcome.PASS, judged_suites([-0.5 * TOLERANCE], u, suites, seed=5)) <= high


def test_reference_that_is_just_good_enough_finds_one_and_a_half_tolerances_in_a_large_suite() -> None:
    """k u = T/3 with 50 quantities, 49 of them right: the wrong one is found in nine of ten suites and never passes."""
    count, suites = 50, 400
    u = TOLERANCE / 3 / coverage_factor(ALPHA, count, 32)
    judged = judged_suites([1.5 * TOLERANCE] + [0.0] * (count - 1), u, suites)
    first = [suite[0].outcome for suite in judged]
    assert np.mean([outcome is Outcome.FAIL for outcome in first]) > 0.9
    assert Outcome.PASS not in first
    assert all(verdict.outcome is Outcome.PASS for suite in judged for verdict in suite[1:])


@pytest.mark.parametrize("numerical_bias", [0.3, 1.0])
def test_numerical_bias_counts_in_full_against_both_verdicts(numerical_bias: float) -> None:
    """The engine's own bias hides an error beyond T, or adds to one within: verdicts stay wrong in alpha at most."""
    suites = 2000
    low, high = interval(ALPHA, suites)
    hidden = judged_suites([JUST_OUTSIDE - numerical_bias], 0.3, suites, numerical_bias=numerical_bias)
    added = judged_suites([-JUST_INSIDE - numerical_bias], 0.3, suites, seed=6, numerical_bias=numerical_bias)
    assert low <= rate_of(Outcome.PASS, hidden) <= high
    assert low <= rate_of(Outcome.FAIL, added) <= high


@pytest.mark.parametrize("truth", [2.0, -2.6, 4.2])
def test_batches_that_an_inconclusive_verdict_asks_for_decide_it(truth: float) -> None:
    spread, batches, trials = 6.0, 16, 1500
    place = ("room", "view", "interior", "noon", "rays", "mitsuba")
    seen = Subject("bias_percent", *place, truth, spread / math.sqrt(batches), batch_count=batches)
    (verdict,) = judge([seen], [], RULES)
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert verdict.batches_needed is not None
    right = Outcome.PASS if abs(truth) < TOLERANCE else Outcome.FAIL

    def decided(count: int) -> float:
        return rate_of(right, judged_suites([truth], spread / math.sqrt(count), trials, count, seed=7))

    assert decided(verdict.batches_needed) >= interval(0.9, trials)[0]
    assert decided(verdict.batches_needed // 2) < 0.8, "nor does it ask for many more than it needs"


# Error measures


def wavy_truth(shape: tuple[int, int] = (96, 128)) -> Float64:
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return np.asarray(200.0 + 100 * np.sin(rows / 20) * np.cos(columns / 30))


def unit_noise(random: np.random.Generator, shape: tuple[int, ...], correlation_pixels: float) -> Float64:
    """Normal noise of unit variance; neighbours alike over about so many pixels."""
    white = random.standard_normal(shape)
    if correlation_pixels == 0:
        return white
    sigma = (0.0,) * (len(shape) - 2) + (correlation_pixels,) * 2
    smooth = ndimage.gaussian_filter(white, sigma, mode="wrap")
    return np.asarray(smooth * 2 * correlation_pixels * math.sqrt(math.pi))


def simulated_regions(
    pattern: Float64,
    noise: float,
    correlation_pixels: float = 0.0,
    level_noise: float = 0.0,
    count: int = 16,
    seed: int = 9,
) -> list[Region]:
    """An engine that is off by `pattern` (shares), and references of that relative standard error in each pixel."""
    truth, random = wavy_truth(), np.random.default_rng(seed)
    mask = np.ones(truth.shape, bool)
    regions = []
    for _ in range(count):
        relative = noise * math.sqrt(2) * unit_noise(random, (2, *truth.shape), correlation_pixels)
        relative += level_noise * math.sqrt(2) * random.standard_normal((2, 1, 1))
        first, second = truth * (1 + relative)
        reference = (first + second) / 2
        floor = floor_cd_m2(reference)
        regions.append(
            Region(
                ours=truth * (1 + pattern),
                reference=reference,
                halves=(first, second),
                noise=math.hypot(noise, level_noise) * truth,
                mask=mask,
                floor=floor,
                level_error=level_noise,
            )
        )
    return regions


def patterns() -> dict[str, Float64]:
    truth, random = wavy_truth(), np.random.default_rng(10)
    columns = np.mgrid[: truth.shape[0], : truth.shape[1]][1]
    return {
        "none": np.zeros_like(truth),
        "1 % too bright": np.full_like(truth, 0.01),
        "3 % too dark": np.full_like(truth, -0.03),
        "waves of 3 %": 0.03 * np.sin(columns / 7.0),
        "1 % from pixel to pixel": 0.01 * random.standard_normal(truth.shape),
        "10 % in a twentieth": np.where(columns % 40 < 2, 0.1, 0.005),
    }


NOISES = (0.005, 0.01, 0.02, 0.05, 0.1)
SHARED = ((0.0, 0.0), (3.0, 0.0), (0.0, 0.004))
"""Likeness of the noise of neighbours in pixels, and of a whole picture as a relative standard error."""


def exact_errors(pattern: Float64) -> tuple[float, float]:
    """Mean relative error and its 95th percentile over blocks, against the truth itself."""
    truth = wavy_truth()
    mask, floor = np.ones(truth.shape, bool), floor_cd_m2(truth)
    blocks = block_errors(truth * (1 + pattern), truth, mask, floor)
    return float(np.mean(np.abs(pattern) * truth / (truth + floor))), float(np.percentile(blocks, 95))


def tolerated(name: str, count: int) -> float:
    """Share of estimates that may be missed on one side; twice alpha for a perfect engine, whose error both signs of
    the noise can only raise (no tolerance is 0, so that this makes no verdict wrong)."""
    return interval(2 * ALPHA if name == "none" else ALPHA, count)[1]


def share_missed(estimates: Sequence[Estimate], exact: float) -> tuple[float, float]:
    """Shares of the estimates that are too high, and too low, by more than the judge allows for. k is that of a single
    quantity and 32 batches, the smallest in use."""
    k = coverage_factor(ALPHA, 1, 32)
    off = np.array([estimate.value - exact for estimate in estimates])
    allowed = np.array([k * estimate.standard_error + estimate.extrapolation for estimate in estimates])
    return float(np.mean(off > allowed)), float(np.mean(off < -allowed))


@pytest.mark.parametrize("name", list(patterns()))
def test_mean_relative_error_is_covered_by_its_uncertainty_at_every_noise(name: str) -> None:
    pattern = patterns()[name]
    exact, _ = exact_errors(pattern)
    found: list[Estimate] = []
    for seed, (noise, (correlation, level)) in enumerate(product(NOISES, SHARED)):
        regions = simulated_regions(pattern, noise, correlation, level, seed=seed)
        estimates = [mean_relative_error(region) for region in regions]
        found += estimates
        bias = float(np.mean([estimate.value for estimate in estimates])) - exact
        slack = 0.05 * noise + level
        assert -MEAN_SHORTFALL * noise - slack <= bias <= MEAN_EXCESS * noise + slack
    assert max(share_missed(found, exact)) <= tolerated(name, len(found))


def test_uncertainty_of_the_mean_relative_error_is_small_where_noise_is_small() -> None:
    """A reference a third as noisy as the errors of a pixel judges them to a tenth; extrapolation removes the rest."""
    for name in ("waves of 3 %", "3 % too dark"):
        exact, _ = exact_errors(patterns()[name])
        estimates = [mean_relative_error(region) for region in simulated_regions(patterns()[name], 0.01)]
        assert all(estimate.standard_error + estimate.extrapolation < 0.1 * exact for estimate in estimates)
        assert np.mean([estimate.value for estimate in estimates]) == pytest.approx(exact, rel=0.01)


def test_raw_mean_relative_error_is_inflated_by_noise_and_the_reported_one_much_less() -> None:
    exact, _ = exact_errors(patterns()["waves of 3 %"])
    estimates = [mean_relative_error(region) for region in simulated_regions(patterns()["waves of 3 %"], 0.02)]
    raw, reported = (np.mean([getattr(estimate, field) for estimate in estimates]) for field in ("raw", "value"))
    assert raw > 1.2 * exact
    assert abs(reported - exact) < 0.1 * (raw - exact)


def test_bounds_of_the_extrapolation_are_those_of_the_folded_normal_distribution() -> None:
    """Mean of |d + noise|: s sqrt(2/pi) exp(-d²/2s²) + d erf(d / s sqrt 2) (Leone, Nelson and Nottingham 1961)."""
    d = np.linspace(0, 12, 4001)
    single, double = (stats.foldnorm.mean(d / s, scale=s) for s in (1.0, math.sqrt(2)))
    left = 2 * single - double - d
    assert left.max() == pytest.approx(MEAN_EXCESS, abs=1e-6)
    assert -left.min() == pytest.approx(MEAN_SHORTFALL, abs=1e-3)
    assert pytest.approx((2 - math.sqrt(2)) * stats.foldnorm.ppf(0.95, 0), abs=1e-4) == QUANTILE_EXCESS


@pytest.mark.parametrize("name", [name for name in patterns() if name != "10 % in a twentieth"])
def test_95th_percentile_of_blocks_is_covered_by_its_uncertainty_at_every_noise(name: str) -> None:
    """Except for errors with a gap at that percentile, where it is not defined."""
    pattern = patterns()[name]
    _, exact = exact_errors(pattern)
    found: list[Estimate] = []
    for seed, (noise, (correlation, level)) in enumerate(product(NOISES, SHARED)):
        regions = simulated_regions(pattern, noise, correlation, level, seed=seed)
        found += [block_error_quantiles(region)[1] for region in regions]
    assert max(share_missed(found, exact)) <= tolerated(name, len(found))


def test_95th_percentile_of_blocks_is_extrapolated_from_its_raw_value() -> None:
    _, exact = exact_errors(patterns()["waves of 3 %"])
    estimates = [block_error_quantiles(region)[1] for region in simulated_regions(patterns()["waves of 3 %"], 0.02)]
    raw, reported = (np.mean([getattr(estimate, field) for estimate in estimates]) for field in ("raw", "value"))
    assert raw > 1.1 * exact
    assert abs(reported - exact) < 0.5 * (raw - exact)
    assert np.mean([estimate.standard_error + estimate.extrapolation for estimate in estimates]) < 0.007


@pytest.mark.parametrize("correlation", [0.0, 3.0])
def test_cross_half_squared_error_is_unbiased_also_when_pixels_are_alike(correlation: float) -> None:
    random, error, noise, draws = np.random.default_rng(12), 2.0, 20.0, 600
    shape = (24, 32)
    halves = 100 + noise * unit_noise(random, (draws, 2, *shape), correlation)
    engine = np.full(shape, 100 + error)
    cross = [cross_half_mse(engine, first, second) for first, second in halves]
    with_itself = [cross_half_mse(engine, pair.mean(axis=0), pair.mean(axis=0)) for pair in halves]
    margin = 4 * float(np.std(cross)) / math.sqrt(draws)
    assert np.mean(cross) == pytest.approx(error**2, abs=margin)
    assert np.mean(with_itself) == pytest.approx(error**2 + noise**2 / 2, rel=0.1), "what one picture would say"


@pytest.mark.parametrize("correlation", [0.0, 2.0, 3.0])
def test_standard_error_of_a_mean_knows_that_neighbouring_pixels_share_their_noise(correlation: float) -> None:
    random, shape, draws = np.random.default_rng(13), (96, 128), 120
    tiles = tile_indices(np.ones(shape, bool))
    noise = unit_noise(random, (draws, *shape), correlation)
    spread = float(np.std(noise.mean(axis=(1, 2))))
    stated = math.sqrt(np.mean([standard_error_of_mean(draw.ravel(), tiles) ** 2 for draw in noise]))
    assert 0.75 * spread < stated < 1.3 * spread
    if correlation:
        assert spread > 5 / math.sqrt(shape[0] * shape[1]), "far from what independent pixels would have"


def test_small_regions_have_enough_tiles_for_a_standard_error() -> None:
    mask = np.zeros((240, 320), bool)
    mask[10:26, 20:44] = True
    assert tile_indices(mask).max() + 1 >= 32
    assert len(tile_indices(mask)) == 16 * 24
    assert tile_indices(np.ones((2, 3), bool)).tolist() == [0, 1, 2, 3, 4, 5]


def compared_pictures(error: float, level_noise: float, count: int, batches: int = 16) -> list[ImageComparison]:
    """Small pictures off by `error`, against references whose batches are each too bright or too dark as a whole."""
    random, truth = np.random.default_rng(14), wavy_truth((16, 24))
    mask = np.ones(truth.shape, bool)
    rows = []
    for _ in range(count):
        shared = level_noise * math.sqrt(batches) * random.standard_normal((batches, 1, 1))
        own = 0.03 * random.standard_normal((batches, *truth.shape))
        batch = truth * (1 + shared + own)
        names = CaseNames(
            "room",
            "noon",
            "rays",
            "mitsuba",
            "view",
            reference_batch_count=batches,
            reference_means={"interior": batch.mean(axis=(1, 2)).tolist()},
        )
        halves = (grey(batch[::2].mean(axis=0)), grey(batch[1::2].mean(axis=0)))
        noise = (batch.std(axis=0, ddof=1) / math.sqrt(batches)).astype(np.float32)
        reference = ImageResult(grey(batch.mean(axis=0)), halves, noise)
        rows.append(compare_region(ImageResult(grey(truth * (1 + error))), reference, mask, "interior", names))
    return rows


@pytest.mark.parametrize(("error", "wrong"), [(0.03 - 1e-6, Outcome.FAIL), (0.03 + 1e-6, Outcome.PASS)])
def test_from_pixels_to_verdict_the_bias_of_a_picture_is_wrong_in_alpha_of_cases(error: float, wrong: Outcome) -> None:
    """What all pixels of a batch have in common is ten times what independent pixels would say."""
    trials = 500
    rates = {"bias_percent": 0.0, "mean_relative_error_percent": 0.0}
    for row in compared_pictures(error, 0.004, trials):
        for subject in Comparison(COMPARISON_FORMAT, "s", "S", images=(row,)).subjects():
            if subject.quantity in rates:
                (verdict,) = judge([subject], [], RULES)
                rates[subject.quantity] += (verdict.outcome is wrong) / trials
    low, high = interval(ALPHA, trials)
    assert low <= rates["bias_percent"] <= high
    assert rates["mean_relative_error_percent"] <= high

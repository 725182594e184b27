"""The judge on simulated errors whose right verdict is known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from transom.errors import InputError
from transom.judge import (
    Missing,
    Outcome,
    Subject,
    ToleranceFile,
    coverage_factor,
    decide,
    exit_code,
    judge,
    read_tolerances,
)


def subject(difference: float, uncertainty: float = 0.0, batches: int = 32, **changes: object) -> Subject:
    values: dict[str, object] = {
        "quantity": "bias_percent",
        "scene": "room",
        "view": "north",
        "region": "interior",
        "condition": "noon",
        "method": "rays",
        "reference": "mitsuba",
        "difference": difference,
        "uncertainty": uncertainty,
        "batch_count": batches,
        **changes,
    }
    return Subject(**values)  # type: ignore[arg-type]


def rules(*entries: dict[str, object], alpha: float = 0.05) -> ToleranceFile:
    return ToleranceFile.model_validate({"format": 1, "alpha": alpha, "tolerances": list(entries)})


BIAS = {"quantity": "bias_percent", "tolerance": 3.0, "reason": "stated"}


@pytest.mark.parametrize(
    ("difference", "expanded", "bias", "outcome"),
    [
        (2.0, 0.9, 0.0, Outcome.PASS),
        (-2.0, 1.0, 0.0, Outcome.PASS),
        (2.0, 1.1, 0.0, Outcome.INCONCLUSIVE),
        (2.0, 0.5, 0.6, Outcome.INCONCLUSIVE),
        (3.5, 0.6, 0.0, Outcome.INCONCLUSIVE),
        (3.5, 0.4, 0.0, Outcome.FAIL),
        (-3.5, 0.2, 0.2, Outcome.FAIL),
        (3.5, 0.3, 0.3, Outcome.INCONCLUSIVE),
        (math.nan, 0.0, 0.0, Outcome.FAIL),
        (math.inf, 0.0, 0.0, Outcome.FAIL),
    ],
)
def test_rule(difference: float, expanded: float, bias: float, outcome: Outcome) -> None:
    assert decide(difference, expanded, bias, 3.0) is outcome


def test_coverage_factor_is_students_at_sidaks_level() -> None:
    assert coverage_factor(0.05, 1, 0) == pytest.approx(1.6449, abs=1e-4)
    assert coverage_factor(0.05, 1, 2) == pytest.approx(6.3138, abs=1e-4)
    assert coverage_factor(0.05, 20, 33) == pytest.approx(stats.t.isf(1 - 0.95 ** (1 / 20), 32))
    assert coverage_factor(0.05, 100, 32) > coverage_factor(0.05, 10, 32) > coverage_factor(0.05, 10, 1000)


def test_noise_turns_a_wrong_engine_into_a_pass_with_chance_alpha_at_most_over_the_whole_suite() -> None:
    """Twenty quantities, each just over its tolerance, judged from 32 noisy batches: a false PASS anywhere in the suite
    may happen in 5 % of suites."""
    random = np.random.default_rng(7)
    tolerance, truth, suites, count, batches = 3.0, 3.0 + 1e-9, 2000, 20, 32
    samples = truth + 2.0 * random.standard_normal((suites, count, batches))
    means = samples.mean(axis=2)
    errors = samples.std(axis=2, ddof=1) / np.sqrt(batches)
    factor = coverage_factor(0.05, count, batches)
    passed = [
        any(decide(m, factor * u, 0.0, tolerance) is Outcome.PASS for m, u in zip(row, row_error, strict=True))
        for row, row_error in zip(means, errors, strict=True)
    ]
    assert np.mean(passed) == pytest.approx(0.05, abs=3 * math.sqrt(0.05 * 0.95 / suites))


def test_noise_turns_a_right_engine_into_a_fail_with_chance_alpha_at_most() -> None:
    random = np.random.default_rng(8)
    tolerance, truth, suites, count, batches = 3.0, 3.0 - 1e-9, 2000, 20, 32
    samples = truth + 2.0 * random.standard_normal((suites, count, batches))
    factor = coverage_factor(0.05, count, batches)
    errors = samples.std(axis=2, ddof=1) / np.sqrt(batches)
    failed = (samples.mean(axis=2) - factor * errors > tolerance).any(axis=1)
    assert failed.mean() == pytest.approx(0.05, abs=3 * math.sqrt(0.05 * 0.95 / suites))


def test_inconclusive_says_how_many_batches_would_decide() -> None:
    (verdict,) = judge([subject(2.5, 1.0, 32)], [], rules(BIAS))
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert verdict.batches_needed is not None
    factor = coverage_factor(0.05, 1, 32)
    shrunk = factor * 1.0 * math.sqrt(32 / verdict.batches_needed)
    assert decide(2.5, shrunk, 0.0, 3.0) is Outcome.PASS
    assert verdict.reference_is_good_enough is False


def test_more_batches_do_not_help_against_the_engines_own_bias() -> None:
    (verdict,) = judge([subject(2.8, 0.1, numerical_bias=0.5)], [], rules(BIAS))
    assert verdict.outcome is Outcome.INCONCLUSIVE
    assert verdict.batches_needed is None


def test_most_specific_tolerance_wins() -> None:
    tolerances = rules(
        BIAS,
        {**BIAS, "tolerance": 5.0, "scene": "room"},
        {**BIAS, "tolerance": 1.0, "scene": "room", "region": "interior"},
        {**BIAS, "tolerance": 9.0, "scene": "other"},
    )
    found = [tolerances.find(subject(0, **change)) for change in ({}, {"region": "desk"}, {"scene": "hall"})]
    assert [rule.tolerance for rule in found if rule] == [1.0, 5.0, 3.0]


def test_equally_specific_tolerances_are_an_error() -> None:
    tolerances = rules({**BIAS, "scene": "room"}, {**BIAS, "view": "north", "tolerance": 1.0})
    with pytest.raises(InputError, match="two equally specific rules"):
        tolerances.find(subject(0))


def test_quantity_without_tolerance_is_not_judged() -> None:
    assert judge([subject(99.0, quantity="sensor_percent")], [], rules(BIAS)) == []


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "format"),
        ("format = 2\ntolerances = []", "format"),
        ("format = 1\ntolerances = []", "tolerances"),
        ("format = 1\nformat = 1", "is not TOML"),
        ('format = 1\n[[tolerances]]\nquantity = "bias"\ntolerance = 1.0\nreason = "x"', r"tolerances\[0\].quantity"),
        ('format = 1\n[[tolerances]]\nquantity = "bias_percent"\ntolerance = -1.0\nreason = "x"', "tolerance = -1.0"),
        ('format = 1\n[[tolerances]]\nquantity = "bias_percent"\ntolerance = 1.0', "reason"),
        ('format = 1\n[[tolerances]]\nquantity = "bias_percent"\ntolerance = nan\nreason = "x"', "tolerance"),
        ('format = 1\n[[tolerances]]\nquantity = "bias_percent"\ntolerance = 1.0\nreason = "x"\nroom = "a"', "room"),
    ],
)
def test_malformed_tolerances_are_an_error_that_names_the_field(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "tolerances.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=problem):
        read_tolerances(path)


def test_missing_references_and_crashes_are_verdicts_and_win_the_exit_code() -> None:
    missing = [Missing(Outcome.NO_REFERENCE, "room", "north", "noon", "rays", "no reference")]
    passed = judge([subject(0.0)], [], rules(BIAS))
    failed = judge([subject(9.0)], [], rules(BIAS))
    unsure = judge([subject(2.9, 1.0)], [], rules(BIAS))
    assert exit_code(passed) == 0
    assert exit_code(passed + failed) == 1
    assert exit_code(passed + unsure) == 3
    assert exit_code(unsure + failed) == 1
    assert exit_code(passed + failed + judge([], missing, rules(BIAS))) == 4
    assert exit_code([]) == 4, "a suite that judged nothing did not pass"

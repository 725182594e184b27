"""The verdict: the only place that decides. Everything before it measures, everything after it formats.

With e = engine - reference, u the reference's standard uncertainty, b the engine's own numerical bias (added linearly),
T the tolerance stated beforehand in scenes/tolerances.toml, and k the one-sided quantile for the whole suite:

    |e| + b + k u <= T   PASS        |e| - b - k u > T   FAIL        else   INCONCLUSIVE

k is Student's quantile (batches - 1 degrees of freedom) at the level that Sidak's formula leaves each of the m
quantities judged together, 1 - (1 - alpha)^(1/m): noise alone turns one of them from right to wrong with chance alpha.
What noise leaves in a quantity beside its scatter is added to k u: U = k u + b (GUM, F.2.4.5), and U takes its place.
One side is enough: a wrong PASS needs an error beyond T on its own side. A wrong FAIL has that chance as long as
u <= T; a reference that is noisier is not good enough, which is said beside its verdict.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from scipy import stats

from transom.errors import InputError, invalid_field

GOOD_ENOUGH_SHARE = 1 / 3
"""A reference can judge when k u is at most this share of the tolerance."""

DECIDING_CHANCE = 0.9
"""With as many batches as an inconclusive verdict asks for, it is decided with this chance."""

SELECTORS = ("scene", "view", "region", "condition", "method")

Quantity = Literal[
    "mean_relative_error_percent",
    "bias_percent",
    "block_p95_percent",
    "sensor_percent",
    "analytic_percent",
    "agreement_percent",
    "crosscheck_image_percent",
    "crosscheck_sensor_percent",
    "baseline_percent",
    "baseline_seed_percent",
    "sun_edge_mm",
    "energy_percent",
    "broken_claims",
]
"""What can be judged; each name ends in its unit, that of the tolerance too."""

QUANTITIES: tuple[str, ...] = get_args(Quantity)


RULE_FORM = "A rule is [[tolerances]] with quantity, tolerance (above 0), reason, and any of " + ", ".join(
    (*SELECTORS, "aims")
)


class Outcome(StrEnum):
    """Verdicts, best first."""

    PASS = "PASS"
    INCONCLUSIVE = "INCONCLUSIVE"
    FAIL = "FAIL"
    NO_REFERENCE = "NO_REFERENCE"
    CRASHED = "CRASHED"


EXIT_CODES = {
    Outcome.PASS: 0,
    Outcome.FAIL: 1,
    Outcome.INCONCLUSIVE: 3,
    Outcome.NO_REFERENCE: 4,
    Outcome.CRASHED: 4,
}
EXIT_PRIORITY = (4, 2, 1, 3, 0)
"""Highest wins first: crash or missing reference, wrong use, fail, inconclusive, pass."""


class Tolerance(BaseModel):
    """One rule of tolerances.toml: a bound on a quantity, why, and what it applies to (nothing: everything).

    Places are names or shell patterns, such as scene "test_room-*" for every variant of test_room.

    aims: stricter bounds, falling, that are not judged: whether they would hold is said beside the verdict.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    quantity: Quantity
    tolerance: float = Field(gt=0.0, allow_inf_nan=False)
    reason: str = Field(min_length=1)
    scene: str | None = None
    view: str | None = None
    region: str | None = None
    condition: str | None = None
    method: str | None = None
    aims: list[float] = []

    @model_validator(mode="after")
    def _aims_fall(self) -> Tolerance:
        bounds = [self.tolerance, *self.aims]
        if any(not 0 < later < earlier for earlier, later in pairwise(bounds)):
            raise ValueError(f"aims {self.aims} do not fall from the tolerance {self.tolerance:g} towards 0")
        return self

    def specificity(self) -> int:
        return sum(getattr(self, name) is not None for name in SELECTORS)

    def place(self) -> str:
        """For people: what the rule names."""
        named = (f"{name} {getattr(self, name)}" for name in SELECTORS if getattr(self, name) is not None)
        return ", ".join(named)

    def applies(self, subject: Subject) -> bool:
        return self.quantity == subject.quantity and all(
            getattr(self, name) is None or fnmatchcase(getattr(subject, name), getattr(self, name))
            for name in SELECTORS
        )


class ToleranceFile(BaseModel):
    """scenes/tolerances.toml. alpha: family-wise error rate of a suite."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    format: Literal[1]
    alpha: float = Field(default=0.05, gt=0.0, lt=0.5)
    tolerances: list[Tolerance] = Field(min_length=1)

    def find(self, subject: Subject) -> Tolerance | None:
        """The most specific rule for a quantity, or None. Raises InputError when two rules are equally specific."""
        rules = sorted((rule for rule in self.tolerances if rule.applies(subject)), key=Tolerance.specificity)
        if not rules:
            return None
        best = rules[-1]
        if len(rules) > 1 and rules[-2].specificity() == best.specificity():
            raise InputError(
                f"has two equally specific rules for {subject.quantity} of {subject.place()}",
                file="tolerances.toml",
                field="tolerances",
                value=[rules[-2].tolerance, best.tolerance],
                remedy="Name one more of " + ", ".join(SELECTORS),
            )
        return best


@dataclass(frozen=True)
class Subject:
    """One quantity to be judged. difference: engine minus reference; uncertainty: the reference's standard uncertainty;
    numerical_bias: the engine's own; all in percent. batch_count: batches of the reference, 0 for one without noise.
    group_count: groups of batches whose spread the uncertainty is from, 0 for every batch by itself.
    noise_bias: bound on what the reference's noise leaves in the difference beside its scatter; falls with it.
    fault: what makes the engine's value wrong whatever the reference says; it fails, with or without a tolerance."""

    quantity: str
    scene: str
    view: str
    region: str
    condition: str
    method: str
    reference: str
    difference: float
    uncertainty: float = 0.0
    numerical_bias: float = 0.0
    batch_count: int = 0
    group_count: int = 0
    noise_bias: float = 0.0
    fault: str = ""

    def place(self) -> str:
        """For people."""
        return " / ".join(part for part in (self.scene, self.view, self.region, self.condition, self.method) if part)


@dataclass(frozen=True)
class Missing:
    """A case without an answer to judge: its reference is missing, or a renderer crashed."""

    outcome: Literal[Outcome.NO_REFERENCE, Outcome.CRASHED]
    scene: str
    view: str
    condition: str
    method: str
    message: str


@dataclass(frozen=True)
class Aim:
    """A stricter bound, and what the verdict by it would be."""

    bound: float
    outcome: Outcome


@dataclass(frozen=True)
class Verdict:
    """The decision on one quantity. expanded_uncertainty: k u, and what noise leaves beside its scatter [%].
    batches_needed: of the reference, to decide an inconclusive one with a chance of 90 %, if the difference is what was
    seen (None where more of them would not). reference_is_good_enough: expanded_uncertainty <= T/3. aims: the rule's,
    not judged."""

    outcome: Outcome
    quantity: str
    scene: str
    view: str
    region: str
    condition: str
    method: str
    reference: str
    difference: float | None
    numerical_bias: float | None
    expanded_uncertainty: float | None
    tolerance: float | None
    reason: str
    reference_is_good_enough: bool | None
    batches_needed: int | None = None
    aims: tuple[Aim, ...] = ()


@dataclass(frozen=True)
class ToleranceDebt:
    """A rule that is looser than the general one of its quantity: by how many times, where, and why."""

    quantity: str
    place: str
    tolerance: float
    general: float
    ratio: float
    reason: str


def read_tolerances(path: Path) -> ToleranceFile:
    """Reads tolerances.toml. Raises InputError for anything that is not exactly in its form."""
    try:
        return ToleranceFile.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError as error:
        raise InputError("does not exist", file=path, remedy="It is part of the repository") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"is not TOML ({error})", file=path, remedy=RULE_FORM) from error
    except ValidationError as error:
        first = invalid_field(error, path)
        raise InputError(
            f"is refused: {error.errors()[0]['msg']}", file=path, field=first.field, value=first.value, remedy=RULE_FORM
        ) from error


def tolerance_debt(tolerances: ToleranceFile) -> list[ToleranceDebt]:
    """Every rule that is looser than the general one of its quantity (the one that names no place), loosest first."""
    general = {rule.quantity: rule.tolerance for rule in tolerances.tolerances if rule.specificity() == 0}
    debts = [
        ToleranceDebt(
            quantity=rule.quantity,
            place=rule.place(),
            tolerance=rule.tolerance,
            general=general[rule.quantity],
            ratio=rule.tolerance / general[rule.quantity],
            reason=rule.reason,
        )
        for rule in tolerances.tolerances
        if rule.tolerance > general.get(rule.quantity, math.inf)
    ]
    return sorted(debts, key=lambda debt: -debt.ratio)


def unused_rules(tolerances: ToleranceFile, subjects: Collection[Subject]) -> list[Tolerance]:
    """Rules by which none of `subjects` (of all suites) is judged: misspelt, or superseded by more specific ones."""
    used = {id(tolerances.find(subject)) for subject in subjects}
    return [rule for rule in tolerances.tolerances if id(rule) not in used]


@cache
def coverage_factor(alpha: float, quantity_count: int, batch_count: int) -> float:
    """k: one-sided Student quantile (normal for a reference without batches) at Sidak's level for `quantity_count`.

    Infinite for a single batch, which says nothing of its noise.
    """
    level = 1 - (1 - alpha) ** (1 / max(quantity_count, 1))
    if batch_count == 1:
        return math.inf
    if batch_count >= 2:
        return float(stats.t.isf(level, batch_count - 1))
    return float(stats.norm.isf(level))


def decide(difference: float, uncertainty: float, numerical_bias: float, tolerance: float) -> Outcome:
    """The rule, for an expanded uncertainty k u. A value that is not finite fails."""
    if not math.isfinite(difference):
        return Outcome.FAIL
    if abs(difference) + numerical_bias + uncertainty <= tolerance:
        return Outcome.PASS
    if abs(difference) - numerical_bias - uncertainty > tolerance:
        return Outcome.FAIL
    return Outcome.INCONCLUSIVE


def judge(subjects: Sequence[Subject], missing: Iterable[Missing], tolerances: ToleranceFile) -> list[Verdict]:
    """A verdict for every subject that a tolerance names or that has a fault, and for every missing case."""
    found = [(subject, tolerances.find(subject)) for subject in subjects]
    count = sum(rule is not None for _, rule in found)
    verdicts = [
        _judge_one(subject, rule, tolerances.alpha, count)
        for subject, rule in found
        if rule is not None or subject.fault
    ]
    return verdicts + [_judge_missing(case) for case in missing]


def exit_code(verdicts: Iterable[Verdict]) -> int:
    """The exit code of a set of verdicts, highest wins: 4, 2, 1, 3, 0. Nothing judged is a missing reference: 4."""
    codes = {EXIT_CODES[verdict.outcome] for verdict in verdicts}
    return next((code for code in EXIT_PRIORITY if code in codes), 4)


def _judge_one(subject: Subject, rule: Tolerance | None, alpha: float, quantity_count: int) -> Verdict:
    factor = coverage_factor(alpha, quantity_count, subject.group_count or subject.batch_count)
    expanded = math.inf if math.isinf(factor) else factor * subject.uncertainty + subject.noise_bias

    def outcome_by(bound: float) -> Outcome:
        if subject.fault:
            return Outcome.FAIL
        return decide(subject.difference, expanded, subject.numerical_bias, bound)

    outcome = outcome_by(rule.tolerance) if rule is not None else Outcome.FAIL
    needed = None
    if outcome is Outcome.INCONCLUSIVE and rule is not None:
        needed = _batches_needed(subject, factor, rule.tolerance)
    return Verdict(
        outcome=outcome,
        quantity=subject.quantity,
        scene=subject.scene,
        view=subject.view,
        region=subject.region,
        condition=subject.condition,
        method=subject.method,
        reference=subject.reference,
        difference=subject.difference,
        numerical_bias=subject.numerical_bias,
        expanded_uncertainty=expanded,
        tolerance=None if rule is None else rule.tolerance,
        reason=subject.fault or (rule.reason if rule is not None else ""),
        reference_is_good_enough=None if rule is None else expanded <= GOOD_ENOUGH_SHARE * rule.tolerance,
        batches_needed=needed,
        aims=() if rule is None else tuple(Aim(bound, outcome_by(bound)) for bound in rule.aims),
    )


def _batches_needed(subject: Subject, factor: float, tolerance: float) -> int | None:
    """Batches at which the verdict is decided with DECIDING_CHANCE, if the true difference is what was seen.

    u and the noise's bias fall as 1/sqrt(batches), and the difference that will be seen then scatters by u: both, and
    the scatter on the side of the tolerance, must fit between the difference and the tolerance.
    """
    size, bias = abs(subject.difference), subject.numerical_bias
    room = max(tolerance - size - bias, size - bias - tolerance)
    if room <= 0 or subject.batch_count < 2:
        return None
    wanted = (factor + float(stats.norm.ppf(DECIDING_CHANCE))) * subject.uncertainty + subject.noise_bias
    return max(subject.batch_count + 1, math.ceil(subject.batch_count * (wanted / room) ** 2))


def _judge_missing(case: Missing) -> Verdict:
    return Verdict(
        outcome=case.outcome,
        quantity="",
        scene=case.scene,
        view=case.view,
        region="",
        condition=case.condition,
        method=case.method,
        reference="",
        difference=None,
        numerical_bias=None,
        expanded_uncertainty=None,
        tolerance=None,
        reason=case.message,
        reference_is_good_enough=None,
    )


# ---- Speed --------------------------------------------------------------------------------------------------------

SPEED_ABSOLUTE_FLOOR_S = 0.5e-3
"""A difference below this is nothing that anybody notices, whatever its share."""

SPEED_LARGEST_UNSEEN = 1.10
"""A build passes when its interval rules out that it is slower by this factor or more."""


@dataclass(frozen=True)
class SpeedChange:
    """One quantity of two builds timed in interleaved pairs (transom.speed_pairs).

    base_s, ours_s: medians [s]. ratio: median of ours / base over the rounds; low, high: its bootstrap interval at the
    level that Sidak's formula leaves each of the quantities. control_ratio: the same for two processes of the base
    build (A/A). threshold: ratio from which a change is relevant, learnt from A/A.
    """

    quantity: str
    pair_count: int
    base_s: float
    ours_s: float
    ratio: float
    low: float
    high: float
    control_ratio: float
    threshold: float

    def looks_slower(self) -> bool:
        """Significant (the interval excludes 1), relevant (beyond what A/A shows), and large enough to notice."""
        return self.low > 1 and self.ratio > self.threshold and self._gain_s(self.ratio) > SPEED_ABSOLUTE_FLOOR_S

    def is_clear(self) -> bool:
        """Whether the interval leaves no room for a slowdown that matters."""
        return self.high < SPEED_LARGEST_UNSEEN or self._gain_s(self.high) < SPEED_ABSOLUTE_FLOOR_S

    def _gain_s(self, ratio: float) -> float:
        return (ratio - 1) * self.base_s


def decide_speed(first: SpeedChange, second: SpeedChange | None = None) -> Outcome:
    """The rule for a quantity's speed. second: from fresh builds, measured for what looks slower at first.

    slower both times   FAIL        not slower, and the last interval rules a slowdown out   PASS
    anything else   INCONCLUSIVE: more pairs decide, or a second build where there was none
    """
    if first.looks_slower() and second is not None and second.looks_slower():
        return Outcome.FAIL
    last = second or first
    if last.looks_slower() or not last.is_clear():
        return Outcome.INCONCLUSIVE
    return Outcome.PASS

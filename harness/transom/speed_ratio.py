"""Equal-error speed-up, with its interval, and which settings are worth having."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

DRAWS = 2000
INTERVAL = (2.5, 97.5)
"""Percentiles of the stated interval."""

MONTE_CARLO = frozenset({"mitsuba"})
"""Programs whose error falls as 1/sqrt(time): beyond their best point they may be extrapolated."""

Kind = Literal["interpolated", "extrapolated", "at_least"]


class Row(Protocol):
    """What is read of a row of the speed-error file."""

    @property
    def program(self) -> str: ...
    @property
    def setting(self) -> str: ...
    @property
    def phase(self) -> Literal["cold", "hour"]: ...
    @property
    def seconds(self) -> tuple[float, ...]: ...
    @property
    def error_percent(self) -> float: ...
    @property
    def error_uncertainty_percent(self) -> float: ...


AnyRow = TypeVar("AnyRow", bound=Row)


@dataclass(frozen=True)
class SpeedUp:
    """How many times longer a program takes than the engine to be as right as the engine at its default setting.

    ratio with its 95 % interval low..high; at_error_percent: the engine's error. kind: the program's time is between
    two of its settings; extrapolated from its best one as error ~ 1/sqrt(time - set-up); or the program was never so
    right, and the ratio is that of its most accurate setting: it needs at least so long.
    """

    program: str
    phase: Literal["cold", "hour"]
    ratio: float
    low: float
    high: float
    at_error_percent: float
    kind: Kind

    def sentence(self) -> str:
        words = {
            "interpolated": "",
            "extrapolated": ", extrapolated as 1/sqrt(time)",
            "at_least": " or more: it was never so right",
        }[self.kind]
        place = "cold" if self.phase == "cold" else "for each further hour"
        interval = f"{self.low:.3g} to {self.high:.3g}"
        what = f"{self.program} takes {self.ratio:.3g} times as long ({interval}){words}"
        return f"at {self.at_error_percent:.2f} % {place}: {what}"


def speed_ups(rows: Sequence[Row], ours: str, setting: str, seed: int = 1) -> list[SpeedUp]:
    """Every other program against our `setting`, in each phase.

    The interval is a bootstrap: times are drawn anew from their samples, errors from a log-normal distribution with
    their standard uncertainty.
    """
    found: list[SpeedUp] = []
    rng = np.random.default_rng(seed)
    phases: tuple[Literal["cold", "hour"], ...] = ("cold", "hour")
    for phase in phases:
        base = next((r for r in rows if (r.program, r.setting, r.phase) == (ours, setting, phase)), None)
        if base is None:
            continue
        for program in dict.fromkeys(row.program for row in rows if row.program != ours):
            theirs = [row for row in rows if row.program == program and row.phase == phase]
            if not theirs:
                continue
            can_extrapolate = program in MONTE_CARLO
            times = np.array([np.median(row.seconds) for row in theirs])
            errors = np.array([row.error_percent for row in theirs])
            seconds, kind = time_at_error(times, errors, base.error_percent, can_extrapolate)
            draws = []
            for _ in range(DRAWS):
                wanted = _drawn_error(base, rng)
                drawn_times = np.array([_drawn_time(row, rng) for row in theirs])
                drawn_errors = np.array([_drawn_error(row, rng) for row in theirs])
                needed, _ = time_at_error(drawn_times, drawn_errors, wanted, can_extrapolate)
                draws.append(needed / _drawn_time(base, rng))
            low, high = np.percentile(draws, INTERVAL)
            ratio = seconds / float(np.median(base.seconds))
            found.append(SpeedUp(program, phase, ratio, float(low), float(high), base.error_percent, kind))
    return found


def time_at_error(times: Float64, errors: Float64, wanted: float, can_extrapolate: bool) -> tuple[float, Kind]:
    """Seconds until a program's error is `wanted`: along its frontier, straight between points in log-log.

    A program whose worst setting is right enough already is given that setting's time: its speed is not overstated
    against it, since it may be faster still. Beyond its best setting see `SpeedUp`.
    """
    order = np.argsort(times)
    t, e = times[order], np.minimum.accumulate(errors[order])
    if wanted >= e[0]:
        return float(t[0]), "interpolated"
    if wanted < e[-1]:
        best = int(np.argmax(e <= e[-1]))
        if not can_extrapolate or len(t) < 2:
            return float(t[best]), "at_least"
        set_up = float(t[0]) if best > 0 else 0.0
        return set_up + (float(t[best]) - set_up) * (float(e[best]) / wanted) ** 2, "extrapolated"
    k = int(np.argmax(e <= wanted))
    share = math.log(e[k - 1] / wanted) / math.log(e[k - 1] / e[k])
    return float(t[k - 1] * (t[k] / t[k - 1]) ** share), "interpolated"


def dominated(rows: Sequence[AnyRow]) -> list[AnyRow]:
    """The rows, each with the first other setting that is no slower and no less right in its phase (`dominated_by`)."""
    result = []
    for row in rows:
        better = next(
            (
                f"{other.program}, {other.setting}"
                for other in rows
                if other is not row and other.phase == row.phase and _is_better(other, row)
            ),
            "",
        )
        result.append(replace(row, dominated_by=better))  # type: ignore[type-var]
    return result


def _is_better(other: Row, row: Row) -> bool:
    ours, theirs = (float(np.median(entry.seconds)) for entry in (row, other))
    return (
        theirs <= ours
        and other.error_percent <= row.error_percent
        and (theirs, other.error_percent)
        != (
            ours,
            row.error_percent,
        )
    )


def _drawn_time(row: Row, rng: np.random.Generator) -> float:
    return float(np.median(rng.choice(row.seconds, len(row.seconds))))


def _drawn_error(row: Row, rng: np.random.Generator) -> float:
    relative = row.error_uncertainty_percent / row.error_percent if row.error_percent > 0 else 0.0
    return row.error_percent * math.exp(relative * float(rng.standard_normal()))

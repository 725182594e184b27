"""Baselines: our own blessed answers, kept in reports/baselines/SUITE.json, against which a check has no noise.

A baseline says of each measure its value with the default seed, and its mean and spread over several seeds. It is
written by `transom bless` alone, which adds one entry, with a reason, to a history that only grows; a file that was
changed in any other way is refused.
"""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from transom.errors import InputError, invalid_field
from transom.files import write_atomic
from transom.judge import GOOD_ENOUGH_SHARE, Subject, ToleranceFile, coverage_factor
from transom.measures import SEEN, TRIANGLE, UP_CLOSE, Measure
from transom.provenance import current_provenance

BASELINE_FORMAT = 1

KEPT_CHANGES = 12
"""Of each blessing, so many of the largest changes are kept in the history, by category."""

SEED_QUANTITIES = {"baseline_percent": "baseline_seed_percent"}
"""What is judged with a tolerance of its own when another seed than the blessed one was used."""

CHANCE_SPREAD = 0.5
"""A triangle whose light spreads over the seeds by more than this share of its mean is found by some of them only: it
lies outdoors, where no room sees it, as the outer side of a window's frame does."""

LEAST_REASON = 10
"""Characters that a reason has at least."""

BASELINES = Path(__file__).resolve().parents[2] / "reports" / "baselines"


class BlessedMeasure(BaseModel):
    """A measure: with the default seed (value), and over all seeds (mean, standard deviation `spread`)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    quantity: str
    category: str
    place: str
    factor: float
    value: float
    mean: float
    spread: float


class BlessedCase(BaseModel):
    """All measures of one case. inputs: what its answer depends on, but for the engine's build."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    case: str
    scene: str
    view: str
    condition: str
    method: str
    inputs: dict[str, str]
    seeds: int = Field(ge=1)
    measures: list[BlessedMeasure]


class Change(BaseModel):
    """The largest change of one category that a blessing accepted. change: in the unit of the quantity."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    case: str
    category: str
    place: str
    quantity: str
    before: float | None
    after: float | None
    change: float | None


class Blessing(BaseModel):
    """Who accepted new values, when, for what reason, and what moved. seeds: so many were measured; refused: those by
    which the engine would not solve a scene, which is a fault of its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    date: str
    author: str
    commit: str | None
    reason: str = Field(min_length=LEAST_REASON)
    engine: str
    processor: str
    seeds: int
    refused: list[str]
    changes: list[Change]
    values: str
    previous: str


class Baseline(BaseModel):
    """reports/baselines/SUITE.json."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: int
    suite: str
    history: list[Blessing] = Field(min_length=1)
    cases: list[BlessedCase]

    def find(self, case: str) -> BlessedCase | None:
        """The values of a case, or None."""
        return next((entry for entry in self.cases if entry.case == case), None)


@dataclass(frozen=True)
class Measured:
    """What was measured now on a case: one list of measures for each seed, the default seed's first."""

    case: str
    scene: str
    view: str
    condition: str
    method: str
    inputs: Mapping[str, str]
    by_seed: Sequence[Sequence[Measure]]


@dataclass(frozen=True)
class Drift:
    """One measure, blessed and now. difference: in the unit of its quantity. spread_share: of the change to what
    another seed alone does (standard deviations), None for what no seed changes. None of `before` or `now`: it was
    not there."""

    case: str
    scene: str
    view: str
    condition: str
    method: str
    quantity: str
    category: str
    place: str
    before: float | None
    now: float | None
    difference: float
    uncertainty: float
    seeds: int
    spread_share: float | None

    def subject(self, reference: str) -> Subject:
        """What is judged: by its category as the method, so that a tolerance can name it."""
        place = (self.scene, self.view, self.place, self.condition, self.category)
        return Subject(self.quantity, *place, reference, self.difference, self.uncertainty, batch_count=self.seeds)


def baseline_file(suite: str, folder: Path | None = None) -> Path:
    return (folder or BASELINES) / f"{suite}.json"


def read_baseline(path: Path) -> Baseline | None:
    """The baseline, or None where there is none. Raises InputError for a malformed one, or one edited by hand."""
    if not path.is_file():
        return None
    remedy = "Bring back the committed file, or bless the suite again: transom bless SUITE --reason ..."
    try:
        baseline = Baseline.model_validate_json(path.read_bytes())
    except ValidationError as error:
        raise invalid_field(error, path) from error
    if baseline.format != BASELINE_FORMAT:
        raise InputError("is of another version", file=path, field="format", value=baseline.format, remedy=remedy)
    previous = ""
    for index, entry in enumerate(baseline.history):
        if entry.previous != previous:
            raise InputError("was changed: its history only grows", file=path, field=f"history[{index}]", remedy=remedy)
        previous = _digest(entry.model_dump(mode="json"))
    if baseline.history[-1].values != _values_digest(baseline.cases):
        problem = "were changed without a blessing: they are not the values of its last entry"
        raise InputError(problem, file=path, field="cases", remedy=remedy)
    return baseline


def bless(
    path: Path,
    suite: str,
    measured: Sequence[Measured],
    reason: str,
    engine: str,
    author: str | None = None,
    refused: Sequence[str] = (),
) -> Baseline:
    """Writes new values with one more entry of history. Raises InputError for a reason that says nothing."""
    reason = checked_reason(reason)
    earlier = read_baseline(path)
    cases = [_blessed(case) for case in measured]
    history = list(earlier.history) if earlier is not None else []
    machine = current_provenance()
    history.append(
        Blessing(
            date=datetime.now(UTC).isoformat(timespec="seconds"),
            author=author or _author(),
            commit=machine.commit,
            reason=reason,
            engine=engine,
            processor=machine.processor,
            seeds=max((len(case.by_seed) for case in measured), default=0),
            refused=list(refused),
            changes=_changes(earlier, measured) if earlier is not None else [],
            values=_values_digest(cases),
            previous=_digest(history[-1].model_dump(mode="json")) if history else "",
        )
    )
    baseline = Baseline(format=BASELINE_FORMAT, suite=suite, history=history, cases=cases)
    write_atomic(path, _text(baseline))
    return baseline


def checked_reason(reason: str) -> str:
    """The reason on one line. Raises InputError for one that says nothing."""
    words = " ".join(reason.split())
    if len(words) < LEAST_REASON:
        remedy = "Say in a sentence why the numbers may move"
        raise InputError("is no reason", field="--reason", value=reason, remedy=remedy)
    return words


def drifts(blessed: BlessedCase, now: Measured, *, fresh_seed: bool) -> list[Drift]:
    """Every measure of a case against the blessed one; for what is not in both, a difference that is not finite.

    fresh_seed: `now` was solved with a seed of its own, so that its difference from the blessed mean has the spread of
    the seeds; else value is compared with value, exactly.
    """
    measures = {measure.name: measure for measure in now.by_seed[0]}
    known = {(entry.quantity, entry.category, entry.place): entry for entry in blessed.measures}
    seen = {entry.place for entry in blessed.measures if entry.category == SEEN}
    place = (now.case, now.scene, now.view, now.condition, now.method)
    rows = [
        Drift(*place, "broken_claims", "inputs", f"{name} is as it was", None, None, 1.0, 0.0, 0, None)
        for name in sorted(blessed.inputs.keys() | now.inputs.keys())
        if blessed.inputs.get(name) != now.inputs.get(name)
    ]
    for name in [*known, *(name for name in measures if name not in known)]:
        before, after = known.get(name), measures.get(name)
        if before is None or after is None:
            found = (before.value if before else None, after.value if after else None)
            rows.append(Drift(*place, *name, *found, math.nan, 0.0, 0, None))
        elif before.category == UP_CLOSE and _hangs_on_chance(before, after, seen, fresh_seed=fresh_seed):
            continue
        elif fresh_seed:
            rows.append(_drift_of_mean(place, before, after, blessed.seeds))
        else:
            difference = before.factor * (after.value - before.value)
            spread = abs(before.factor) * before.spread
            share = abs(difference) / spread if spread > 0 else None
            rows.append(Drift(*place, *name, before.value, after.value, difference, 0.0, 0, share))
    return rows


def _hangs_on_chance(before: BlessedMeasure, after: Measure, seen: Collection[str], *, fresh_seed: bool) -> bool:
    """Whether a triangle's light is a matter of few rays. seen: the faces that a room sees."""
    if before.spread > CHANCE_SPREAD * abs(before.mean):
        return True  # in the sun or in the dark by whether a ray outdoors has found it: no room has light from it
    if not fresh_seed:
        return False
    if before.spread == 0:
        return True  # a buried face, dark by every blessed seed: one of its few rays by chance would light it
    # Outdoors, found by every blessed seed and not by this one.
    return before.place.partition(TRIANGLE)[0] not in seen and after.value < CHANCE_SPREAD * before.value


def _drift_of_mean(place: tuple[str, str, str, str, str], before: BlessedMeasure, after: Measure, seeds: int) -> Drift:
    """One value against the mean of `seeds` others: its variance is that of one, and of their mean."""
    quantity = SEED_QUANTITIES.get(before.quantity, before.quantity) if before.spread > 0 else before.quantity
    difference, spread = before.factor * (after.value - before.mean), abs(before.factor) * before.spread
    noise = spread * math.sqrt(1 + 1 / seeds)
    share = abs(difference) / spread if spread > 0 else None
    count = seeds if spread > 0 else 0
    names = (quantity, before.category, before.place)
    return Drift(*place, *names, before.mean, after.value, difference, noise, count, share)


def worth_judging(rows: Iterable[Drift], tolerances: ToleranceFile) -> list[Drift]:
    """Those whose noise between seeds leaves room within their tolerance: k u is at most GOOD_ENOUGH_SHARE of it."""
    rows = list(rows)
    kept = []
    for row in rows:
        rule = tolerances.find(row.subject(""))
        factor = coverage_factor(tolerances.alpha, len(rows), row.seeds) if row.uncertainty > 0 else 0.0
        if rule is not None and factor * row.uncertainty <= GOOD_ENOUGH_SHARE * rule.tolerance:
            kept.append(row)
    return kept


def _blessed(case: Measured) -> BlessedCase:
    measures = []
    for first in case.by_seed[0]:
        values = [found.value for seed in case.by_seed for found in seed if found.name == first.name]
        spread = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
        measures.append(
            BlessedMeasure(
                quantity=first.quantity,
                category=first.category,
                place=first.place,
                factor=_rounded(first.factor),
                value=_rounded(first.value),
                mean=_rounded(float(np.mean(values))),
                spread=_rounded(spread, 4),
            )
        )
    return BlessedCase(
        case=case.case,
        scene=case.scene,
        view=case.view,
        condition=case.condition,
        method=case.method,
        inputs=dict(case.inputs),
        seeds=len(case.by_seed),
        measures=measures,
    )


def _changes(earlier: Baseline, measured: Sequence[Measured]) -> list[Change]:
    """Of each case and category the largest change, the largest of all first."""
    largest: dict[tuple[str, str], Drift] = {}
    for case in measured:
        known = earlier.find(case.case)
        for row in drifts(known, case, fresh_seed=False) if known is not None else ():
            best = largest.get((row.case, row.category))
            if best is None or _size(row) > _size(best):
                largest[row.case, row.category] = row
    found = sorted((row for row in largest.values() if _size(row) > 0), key=_size, reverse=True)
    return [
        Change(
            case=row.case,
            category=row.category,
            place=row.place,
            quantity=row.quantity,
            before=row.before,
            after=row.now,
            change=_rounded(row.difference) if math.isfinite(row.difference) else None,
        )
        for row in found[:KEPT_CHANGES]
    ]


def _size(row: Drift) -> float:
    return abs(row.difference) if math.isfinite(row.difference) else math.inf


def _text(baseline: Baseline) -> str:
    """JSON with one line a measure: a diff shows which values moved."""
    content = baseline.model_dump(mode="json")
    cases = content.pop("cases")
    head = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    blocks = []
    for case in cases:
        measures = ",\n   ".join(json.dumps(entry, ensure_ascii=False) for entry in case.pop("measures"))
        opening = json.dumps(case, ensure_ascii=False)[:-1]
        blocks.append(f'  {opening}, "measures": [\n   {measures}\n  ]}}')
    return f'{head[:-2]},\n "cases": [\n{",".join(blocks)}\n ]\n}}\n'


def _rounded(value: float, digits: int = 9) -> float:
    return float(f"{value:.{digits}g}")


def _values_digest(cases: Sequence[BlessedCase]) -> str:
    return _digest([case.model_dump(mode="json") for case in cases])


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _author() -> str:
    """Name of the present git author, without the address."""
    command = ["git", "-C", str(BASELINES.parents[1]), "var", "GIT_AUTHOR_IDENT"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, check=True, timeout=20).stdout
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return found.partition("<")[0].strip() or "unknown"

"""results.json: every number of the report for other programs. Its JSON schema is reports/results.schema.json."""

from __future__ import annotations

import hashlib
import json
from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, get_type_hints

from pydantic import BaseModel, ConfigDict, TypeAdapter, create_model

from transom.compare import ImageComparison, SensorComparison
from transom.comparison import (
    AnalyticComparison,
    Comparison,
    CrossCheck,
    HardCase,
    LadderStep,
    MethodAgreement,
    ModelError,
)
from transom.files import write_atomic
from transom.judge import Outcome, Verdict
from transom.provenance import Provenance, current_provenance
from transom.report.junit import case_names
from transom.report.table import KEY_LENGTH, TablesFile, runs
from transom.timing import Timing

RESULTS_FORMAT = 2

SCHEMAS = Path(__file__).resolve().parents[3] / "reports"


class Judged(BaseModel):
    """What is added to each compared quantity: its suite, where it comes from, and its verdict if a tolerance names
    it. origin: the keys of the runs that were compared, or the comparison's digest."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    suite: str
    origin: str


def _row(title: str, source: type, verdicts: Sequence[str], **more: Any) -> type[BaseModel]:
    """A flat model with the fields of a dataclass and one verdict for each judged quantity."""
    fields = _fields(source) | more
    fields |= dict.fromkeys(verdicts, (Outcome | None, None))
    model: type[BaseModel] = create_model(title, __base__=Judged, __doc__=source.__doc__, **fields)
    return model


def _fields(source: type) -> dict[str, Any]:
    """Fields of a dataclass. A number that is not finite is null in JSON, which has no other way to write it."""
    return {name: (float | None if hint is float else hint, ...) for name, hint in get_type_hints(source).items()}


ImageRow = _row("ImageRow", ImageComparison, ("mean_relative_error_verdict", "bias_verdict", "block_verdict"))
SensorRow = _row("SensorRow", SensorComparison, ("verdict",))
AgreementRow = _row("AgreementRow", MethodAgreement, ("verdict",))
AnalyticRow = _row("AnalyticRow", AnalyticComparison, ("verdict",))
CrossCheckRow = _row("CrossCheckRow", CrossCheck, ("verdict",))
ModelErrorRow = _row("ModelErrorRow", ModelError, ())
LadderRow = _row("LadderRow", LadderStep, ())
HardCaseRow = _row("HardCaseRow", HardCase, ("verdict",))
VerdictRow = _row("VerdictRow", Verdict, (), name=(str, ...))


class SuiteRecord(BaseModel):
    """A suite as it was compared. digest: the beginning of the SHA-256 of its comparison, which names it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    suite: str
    title: str
    digest: str


class Results(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int
    created: datetime
    provenance: Provenance
    suites: list[SuiteRecord]
    images: list[ImageRow]  # type: ignore[valid-type]
    sensors: list[SensorRow]  # type: ignore[valid-type]
    agreements: list[AgreementRow]  # type: ignore[valid-type]
    analytic: list[AnalyticRow]  # type: ignore[valid-type]
    crosschecks: list[CrossCheckRow]  # type: ignore[valid-type]
    model_errors: list[ModelErrorRow]  # type: ignore[valid-type]
    ladder: list[LadderRow]  # type: ignore[valid-type]
    hard_cases: list[HardCaseRow]  # type: ignore[valid-type]
    timings: list[Timing]
    verdicts: list[VerdictRow]  # type: ignore[valid-type]


class _Verdicts:
    """The verdicts of a suite, handed out to the rows that they judge, in the order in which both were made.

    Sensors of one set share a place; their verdicts come in the sensors' order.
    """

    def __init__(self, verdicts: Sequence[Verdict]) -> None:
        self._waiting: dict[tuple[str, ...], deque[int]] = defaultdict(deque)
        self._verdicts = verdicts
        self.origins = [""] * len(verdicts)
        for index, verdict in enumerate(verdicts):
            place = (verdict.scene, verdict.view, verdict.region, verdict.condition, verdict.method)
            self._waiting[(verdict.quantity, *place)].append(index)

    def take(self, origin: str, quantity: str, *place: str) -> Outcome | None:
        waiting = self._waiting.get((quantity, *place))
        if not waiting:
            return None
        index = waiting.popleft()
        self.origins[index] = origin
        return self._verdicts[index].outcome


def collect_results(judged: Sequence[tuple[Comparison, Sequence[Verdict]]], timings: Sequence[Timing]) -> Results:
    """All suites' comparisons with their verdicts beside them."""
    lists: dict[str, list[BaseModel]] = defaultdict(list)
    suites = []
    for comparison, verdicts in judged:
        digest = hashlib.sha256(TypeAdapter(Comparison).dump_json(comparison)).hexdigest()[:KEY_LENGTH]
        suites.append(SuiteRecord(suite=comparison.suite, title=comparison.title, digest=digest))
        _collect(comparison, verdicts, f"{comparison.suite} {digest}", lists)
    names = ("images", "sensors", "agreements", "analytic", "crosschecks", "model_errors", "ladder", "hard_cases")
    found: dict[str, Any] = {name: lists[name] for name in (*names, "verdicts")}
    return Results(
        format=RESULTS_FORMAT,
        created=datetime.now(UTC).replace(microsecond=0),
        provenance=current_provenance(),
        suites=suites,
        timings=list(timings),
        **found,
    )


def _collect(
    comparison: Comparison, verdicts: Sequence[Verdict], digest: str, lists: dict[str, list[BaseModel]]
) -> None:
    suite, waiting = comparison.suite, _Verdicts(verdicts)
    for image in comparison.images:
        origin = runs(image.engine_key, image.reference_key) or digest
        place = (image.scene, image.view, image.region, image.condition, image.method)
        found = {
            "mean_relative_error_verdict": waiting.take(origin, "mean_relative_error_percent", *place),
            "bias_verdict": waiting.take(origin, "bias_percent", *place),
            "block_verdict": waiting.take(origin, "block_p95_percent", *place),
        }
        lists["images"].append(ImageRow(suite=suite, origin=origin, **asdict(image), **found))
    for sensor in comparison.sensors:
        origin = runs(sensor.engine_key, sensor.reference_key) or digest
        place = (sensor.scene, "", sensor.set, sensor.condition, sensor.method)
        outcome = waiting.take(origin, "sensor_percent", *place)
        lists["sensors"].append(SensorRow(suite=suite, origin=origin, **asdict(sensor), verdict=outcome))
    for pair in comparison.agreements:
        outcome = waiting.take(digest, "agreement_percent", pair.scene, pair.view, "", pair.condition, "volumes")
        lists["agreements"].append(AgreementRow(suite=suite, origin=digest, **asdict(pair), verdict=outcome))
    for entry in comparison.analytic:
        outcome = waiting.take(digest, "analytic_percent", entry.scene, "", entry.quantity, "", entry.program)
        lists["analytic"].append(AnalyticRow(suite=suite, origin=digest, **asdict(entry), verdict=outcome))
    for check in comparison.crosschecks:
        quantity = "crosscheck_sensor_percent" if check.quantity == "sensor" else "crosscheck_image_percent"
        place = (check.scene, check.view, check.region, check.condition, f"{check.first}, {check.physics}")
        outcome = waiting.take(digest, quantity, *place)
        lists["crosschecks"].append(CrossCheckRow(suite=suite, origin=digest, **asdict(check), verdict=outcome))
    for claim in comparison.hard_cases:
        outcome = waiting.take(digest, "broken_claims", claim.case, "", claim.claim, claim.group, "")
        lists["hard_cases"].append(HardCaseRow(suite=suite, origin=digest, **asdict(claim), verdict=outcome))
    lists["model_errors"] += [ModelErrorRow(suite=suite, origin=digest, **asdict(e)) for e in comparison.model_errors]
    lists["ladder"] += [LadderRow(suite=suite, origin=digest, **asdict(step)) for step in comparison.ladder]
    for name, verdict, origin in zip(case_names(verdicts), verdicts, waiting.origins, strict=True):
        lists["verdicts"].append(VerdictRow(suite=suite, origin=origin or digest, name=name, **asdict(verdict)))


def write_results(path: Path, results: Results) -> None:
    write_atomic(path, results.model_dump_json() + "\n")


def schema_texts() -> dict[str, str]:
    """The published JSON schemas by file name, as kept in reports/."""
    return {"results.schema.json": _schema(Results), "tables.schema.json": _schema(TablesFile)}


def _schema(model: type[BaseModel]) -> str:
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def write_schemas() -> None:
    """Writes the schemas in reports/ anew, after a change to what the files hold."""
    for name, text in schema_texts().items():
        write_atomic(SCHEMAS / name, text)

"""results.json: every number of the report for other programs. Its JSON schema is reports/results.schema.json."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, create_model

from transom.compare import ImageComparison, SensorComparison
from transom.comparison import AnalyticComparison, Comparison, MethodAgreement
from transom.files import write_atomic
from transom.judge import Outcome, Verdict
from transom.provenance import Provenance, current_provenance
from transom.timing import Timing

RESULTS_FORMAT = 1

SCHEMA_FILE = Path(__file__).resolve().parents[3] / "reports" / "results.schema.json"


class Judged(BaseModel):
    """What is added to each compared quantity: its suite, and its verdict where a tolerance names it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    suite: str


def _row(name: str, source: type, verdicts: Sequence[str]) -> type[BaseModel]:
    """A flat model with the fields of a dataclass and one verdict for each judged quantity."""
    from typing import get_type_hints

    fields: dict[str, Any] = {key: (hint, ...) for key, hint in get_type_hints(source).items()}
    fields |= dict.fromkeys(verdicts, (Outcome | None, None))
    model: type[BaseModel] = create_model(name, __base__=Judged, __doc__=source.__doc__, **fields)
    return model


IMAGE_VERDICTS = ("mean_relative_error_verdict", "bias_verdict")
ImageRow = _row("ImageRow", ImageComparison, IMAGE_VERDICTS)
SensorRow = _row("SensorRow", SensorComparison, ("verdict",))
AgreementRow = _row("AgreementRow", MethodAgreement, ("verdict",))
AnalyticRow = _row("AnalyticRow", AnalyticComparison, ("verdict",))


class Results(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int
    created: datetime
    provenance: Provenance
    images: list[ImageRow]  # type: ignore[valid-type]
    sensors: list[SensorRow]  # type: ignore[valid-type]
    agreements: list[AgreementRow]  # type: ignore[valid-type]
    analytic: list[AnalyticRow]  # type: ignore[valid-type]
    timings: list[Timing]
    verdicts: list[Verdict]


def collect_results(judged: Sequence[tuple[Comparison, Sequence[Verdict]]], timings: Sequence[Timing]) -> Results:
    """All suites' comparisons with their verdicts beside them."""
    images: list[BaseModel] = []
    sensors: list[BaseModel] = []
    agreements: list[BaseModel] = []
    analytic: list[BaseModel] = []
    for comparison, verdicts in judged:
        suite = comparison.suite
        outcomes = {_verdict_place(verdict): verdict.outcome for verdict in verdicts}
        for image in comparison.images:
            place = (image.scene, image.view, image.region, image.condition, image.method)
            found = {
                "mean_relative_error_verdict": outcomes.get(("mean_relative_error_percent", *place)),
                "bias_verdict": outcomes.get(("bias_percent", *place)),
            }
            images.append(ImageRow(suite=suite, **asdict(image), **found))
        # Sensors of one set share a place; verdicts come in the order of the sensors.
        sensor_verdicts = iter([verdict for verdict in verdicts if verdict.quantity == "sensor_percent"])
        for sensor in comparison.sensors:
            place = (sensor.scene, "", sensor.set, sensor.condition, sensor.method)
            is_judged = ("sensor_percent", *place) in outcomes
            outcome = next(sensor_verdicts).outcome if is_judged else None
            sensors.append(SensorRow(suite=suite, **asdict(sensor), verdict=outcome))
        for pair in comparison.agreements:
            key = ("agreement_percent", pair.scene, pair.view, "", pair.condition, "volumes")
            agreements.append(AgreementRow(suite=suite, **asdict(pair), verdict=outcomes.get(key)))
        for entry in comparison.analytic:
            key = ("analytic_percent", entry.scene, "", entry.quantity, "", entry.program)
            analytic.append(AnalyticRow(suite=suite, **asdict(entry), verdict=outcomes.get(key)))
    return Results(
        format=RESULTS_FORMAT,
        created=datetime.now(UTC).replace(microsecond=0),
        provenance=current_provenance(),
        images=images,
        sensors=sensors,
        agreements=agreements,
        analytic=analytic,
        timings=list(timings),
        verdicts=[verdict for _, verdicts in judged for verdict in verdicts],
    )


def write_results(path: Path, results: Results) -> None:
    write_atomic(path, results.model_dump_json(indent=1) + "\n")


def results_schema() -> str:
    """The JSON schema of results.json, as kept in reports/results.schema.json."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Results.model_json_schema()}
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def write_schema() -> None:
    """Writes reports/results.schema.json anew, after a change to what results hold."""
    write_atomic(SCHEMA_FILE, results_schema())


def _verdict_place(verdict: Verdict) -> tuple[str, ...]:
    return (verdict.quantity, verdict.scene, verdict.view, verdict.region, verdict.condition, verdict.method)

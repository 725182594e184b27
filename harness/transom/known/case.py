"""A case with a known answer: a scene, its light, points where illuminance is measured, and what must come of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from transom.bundle import Case, make_case
from transom.comparison import AnalyticComparison
from transom.daylight.condition import Condition
from transom.errors import InputError
from transom.renderer import Renderer
from transom.scene.model import Scene
from transom.sensor_file import SensorTable

Float64 = NDArray[np.float64]

PATHS_PER_PASS, LEAST_LOG2_PATHS = 1 << 15, 8
"""Of Radiance, over all sensors of a case; and of each sensor at least, as a power of two."""


@dataclass(frozen=True)
class Answer:
    """One known quantity, linear in the illuminances E that are measured: offset + sum over rows of weights x E.

    rows, weights: (K,) sensors that count and by how much. truth and its standard uncertainty, both in `unit`.
    group: answers of one group become one comparison, that of the answer farthest from its truth.
    """

    quantity: str
    unit: str
    truth: float
    truth_uncertainty: float
    source: str
    rows: NDArray[np.intp]
    weights: Float64
    offset: float = 0.0
    group: str = ""


@dataclass(frozen=True)
class KnownCase:
    """One scene under one condition, measured at `sensors`, and the known quantities that follow.

    label: tells apart the cases of one family ("cie 12", "rho 0.5"), "" where there is one.
    """

    scene: Scene
    condition: Condition
    sensors: SensorTable
    answers: Callable[[], Sequence[Answer]]
    label: str = ""

    def question(self, renderer: Renderer) -> Case:
        """The case as a renderer is asked. Raises InputError for an option that the renderer does not have."""
        return make_case(
            self.scene,
            self.condition,
            renderer,
            program_options(renderer, len(self.sensors.points)),
            sensors=self.sensors,
        )


def program_options(renderer: Renderer, sensor_count: int) -> dict[str, object]:
    """Radiance measures without a cache of indirect light, its paths shared among the sensors: what is known as a sum
    over many sensors needs fewer of each. The others measure as they are."""
    if "preset" not in renderer.default_options():
        return {}
    return {"preset": "exact", "samples": max(LEAST_LOG2_PATHS, round(math.log2(PATHS_PER_PASS / sensor_count)))}


def sensor_table(points: Float64, normals: Float64, name: str = "") -> SensorTable:
    """Points (N, 3) [m] and normals (N, 3) or one (3,) as a table."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    normals = np.broadcast_to(np.asarray(normals, np.float64), points.shape).copy()
    return SensorTable((name,) * len(points), points, normals)


def point_answer(row: int, name: str, truth: float, source: str, uncertainty: float = 0.0, group: str = "") -> Answer:
    """The illuminance of one sensor [lx]."""
    return Answer(name, "lx", truth, uncertainty, source, np.array([row]), np.ones(1), group=group)


def compare_answers(case: KnownCase, measured: SensorTable, program: str, batch_count: int) -> list[AnalyticComparison]:
    """The case's answers beside a program's illuminances: one row each, of a group the one that is farthest off."""
    if measured.illuminance is None or measured.standard_error is None:
        raise InputError("holds no illuminance", file=case.scene.file)
    rows: list[AnalyticComparison] = []
    groups: dict[str, list[AnalyticComparison]] = {}
    for answer in case.answers():
        value = answer.offset + float(answer.weights @ measured.illuminance[answer.rows])
        noise = math.sqrt(float((answer.weights**2) @ (measured.standard_error[answer.rows] ** 2)))
        row = AnalyticComparison(
            scene=case.scene.name,
            quantity=answer.quantity,
            unit=answer.unit,
            value=value,
            truth=answer.truth,
            truth_uncertainty=answer.truth_uncertainty,
            error_percent=100 * (value / answer.truth - 1),
            source=answer.source,
            program=program,
            error_uncertainty_percent=100 * noise / abs(answer.truth),
            batch_count=batch_count,
        )
        if answer.group:
            groups.setdefault(answer.group, []).append(row)
        else:
            rows.append(row)
    return rows + [_farthest(name, members) for name, members in groups.items()]


def _farthest(name: str, members: Sequence[AnalyticComparison]) -> AnalyticComparison:
    """The member with the greatest error, named after the group."""
    worst = max(members, key=lambda row: abs(row.error_percent) if math.isfinite(row.error_percent) else math.inf)
    return replace(worst, quantity=f"{name}, farthest of {len(members)} points")

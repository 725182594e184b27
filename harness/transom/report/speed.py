"""What `transom bench` found, for the report: speed against error and the speed at equal error."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from transom.figures import SpeedPoint, speed_error_svg
from transom.report import rows_speed
from transom.report.numbers import words
from transom.report.pictures import Drawing
from transom.report.rows_references import PROGRAM_WORDS
from transom.report.table import Table
from transom.scene import load_scene
from transom.suite import invalid_field

LOAD_REPEATS = 3
PHASE_WORDS = {"cold": "from the scene's files", "hour": "a new hour"}


class SpeedErrorRow(BaseModel):
    """One program at one setting: seconds of each repeat, and the mean pixel error without the reference's noise."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    scene: str
    view: str
    condition: str
    program: str
    setting: str
    phase: str
    seconds: list[float]
    error_percent: float
    error_uncertainty_percent: float


class SpeedUp(BaseModel):
    """How many times faster the engine is than a program at equal error, and the interval of that ratio."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    program: str
    phase: str
    ratio: float
    low: float
    high: float
    at_error_percent: float


class SpeedErrorFile(BaseModel):
    """build/bench/speed_error.json, as far as the report needs it."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    rows: list[SpeedErrorRow] = []
    speed_ups: list[SpeedUp] = []


@dataclass(frozen=True)
class Speed:
    """loads_s: seconds to read each scene. found: speed against error; source: where it was measured."""

    loads_s: dict[str, float]
    found: SpeedErrorFile
    source: str

    @property
    def tables(self) -> list[Table]:
        return [
            rows_speed.speed_error(self.found.rows, self.source),
            rows_speed.speed_ups(self.found.speed_ups, self.source),
        ]


def read_speed(build: Path, scenes: Iterable[str], source: str) -> Speed:
    """What is there; nothing where `transom bench` has not run. Raises InputError for a malformed file."""
    loads = {name: _load_seconds(name) for name in scenes}
    return Speed(loads, read_speed_error(build / "bench" / "speed_error.json"), source)


def read_speed_error(path: Path) -> SpeedErrorFile:
    """Raises InputError for a malformed file; an absent one holds nothing."""
    if not path.is_file():
        return SpeedErrorFile()
    try:
        return SpeedErrorFile.model_validate_json(path.read_bytes())
    except ValidationError as error:
        raise invalid_field(error, path) from error


def speed_drawings(speed: Speed) -> Iterator[Drawing]:
    """Error against time, one figure a scene."""
    for place in dict.fromkeys((row.scene, row.view, row.condition) for row in speed.found.rows):
        rows = [row for row in speed.found.rows if (row.scene, row.view, row.condition) == place]
        points = [
            SpeedPoint(
                program=PROGRAM_WORDS.get(row.program, words(row.program)),
                phase=PHASE_WORDS.get(row.phase, row.phase),
                low_s=float(np.min(row.seconds)),
                median_s=float(np.median(row.seconds)),
                high_s=float(np.max(row.seconds)),
                error_percent=row.error_percent,
                uncertainty_percent=row.error_uncertainty_percent,
            )
            for row in rows
        ]
        name = f"{words(place[0])}, {words(place[1]).lower()}, {place[2]}"
        yield Drawing(
            speed_error_svg(points),
            f"{name}: mean pixel error against time. Bars: fastest to slowest repeat, and the error's standard "
            "uncertainty. Lower and further left is better.",
            f"Log-log plot of error against time for {', '.join(dict.fromkeys(point.program for point in points))}",
            speed.source,
        )


def _load_seconds(name: str) -> float:
    samples = []
    for _ in range(LOAD_REPEATS):
        begin = time.perf_counter()
        load_scene(name)
        samples.append(time.perf_counter() - begin)
    return float(np.median(samples))

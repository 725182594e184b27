"""What `transom bench` has measured, for the report: times over sizes, speed against error, speed at equal error."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from transom.bench import Bench, read_bench
from transom.figures_speed import speed_error_figure
from transom.report.numbers import words
from transom.report.pictures import Drawing
from transom.report.table import KEY_LENGTH
from transom.scene import load_scene
from transom.speed_error import SpeedError, read_speed_error

LOAD_REPEATS = 3

AGAINST = "-against"
"""Ends the names of files that compare two builds."""


@dataclass(frozen=True)
class Speed:
    """loads_s: seconds to read each scene. benches: one a scene. variants: of scenes with other glazing. speed_error:
    None where it was not measured."""

    loads_s: dict[str, float]
    benches: Sequence[Bench]
    speed_error: SpeedError | None
    variants: Sequence[Bench] = ()


def read_speed(build: Path, scenes: Iterable[str]) -> Speed:
    """What is there; nothing where `transom bench` has not run. Raises InputError for a malformed file."""
    names = list(scenes)
    files = [path for name in names if (path := build / "bench" / f"{name}.json").is_file()]
    others = [file for name in names for file in sorted((build / "bench").glob(f"{name}-*.json"))]
    path = build / "bench" / "speed_error.json"
    return Speed(
        loads_s={name: _load_seconds(name) for name in names},
        benches=[read_bench(file) for file in files],
        speed_error=read_speed_error(path) if path.is_file() else None,
        variants=[read_bench(file) for file in others if not file.stem.endswith(AGAINST)],
    )


def speed_drawing(found: SpeedError) -> Drawing:
    """Error against time, log-log."""
    row = found.rows[0]
    text = speed_error_figure(found, "svg").decode()
    return Drawing(
        text[text.index("<svg") :],
        f"{words(row.scene)}, {words(row.view).lower()}, {row.condition}: mean pixel error against time. Bars: 95 % "
        "of the error, and the fastest and slowest sample. Filled points are on the frontier, hollow ones are "
        "dominated. The dotted line falls as a path tracer's error does with time.",
        f"Log-log plot of error against time for {', '.join(dict.fromkeys(entry.program for entry in found.rows))}",
        f"reference {found.reference_key[:KEY_LENGTH]}, {found.provenance.processor}, {found.created:%Y-%m-%d %H:%M}",
    )


def _load_seconds(name: str) -> float:
    samples = []
    for _ in range(LOAD_REPEATS):
        begin = time.perf_counter()
        load_scene(name)
        samples.append(time.perf_counter() - begin)
    return float(np.median(samples))

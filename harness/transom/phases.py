"""Traces: what the engine did when, as a file that Perfetto opens, and the difference of two of them by phase."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from transom.bench_worker import BESIDE, SENSOR_RAYS, Span, phase_seconds
from transom.daylight.condition import Condition, resolve_condition
from transom.errors import InputError
from transom.files import json_text, write_atomic
from transom.provenance import current_provenance
from transom.scene.model import Scene, View

Result = TypeVar("Result")

PROCESS, THREAD, BESIDE_THREAD = 1, 1, 2
"""Of the trace file: the engine's phases are steps of the calling thread, which its workers share, but for one that
runs beside another."""


@dataclass(frozen=True)
class Trace:
    """Nested spans (name, begin, end) [s] from the first one's begin on, and what they are of."""

    name: str
    spans: tuple[Span, ...]
    facts: dict[str, Any]

    def phases(self) -> dict[str, float]:
        """Seconds by path, as "relight/gather"."""
        return {path.removeprefix("/"): seconds for path, seconds in phase_seconds(self.spans, "").items()}


@dataclass(frozen=True)
class PhaseChange:
    """One phase of two traces [s]. None where a trace does not have it."""

    path: str
    first_s: float | None
    second_s: float | None

    @property
    def difference_s(self) -> float:
        return (self.second_s or 0.0) - (self.first_s or 0.0)

    @property
    def ratio(self) -> float | None:
        return self.second_s / self.first_s if self.first_s and self.second_s is not None else None


def record_trace(load: Callable[[], Scene], view_name: str | None = None, condition_name: str | None = None) -> Trace:
    """Loads, solves, relights (twice: the second is a further hour), draws a frame by both methods, and measures the
    sensors of a scene; each step with the engine's phases inside it. Names None: the scene's first.

    The engine counts from the begin of its own solve; the steps are measured here. The two clocks are one on Linux,
    and their offset is the largest that keeps every phase before the end of its step.
    """
    from transom.engine import Engine
    from transom.suite import choose

    steps: list[Span] = []

    def step(name: str, action: Callable[[], Result]) -> Result:
        begin = time.perf_counter()
        result = action()
        steps.append((name, begin, time.perf_counter()))
        return result

    scene = step("load", load)
    view: View = choose(scene.views, None if view_name is None else [view_name], scene, "view")[0]
    spec = choose(scene.conditions, None if condition_name is None else [condition_name], scene, "condition")[0]
    condition: Condition = step("condition", lambda: resolve_condition(spec, scene.site))
    engine = step("solve", lambda: Engine.solve(scene, trace=True))
    counts = [len(engine.trace())]

    def engine_step(name: str, action: Callable[[], object]) -> None:
        step(name, action)
        counts.append(len(engine.trace()))

    failures: list[str] = []

    def draw_volumes() -> None:
        try:
            engine.render(view, "volumes")
        except RuntimeError as error:  # no OpenGL here
            failures.append(str(error))

    engine_step("relight", lambda: engine.relight(condition))
    engine_step("relight again", lambda: engine.relight(condition))
    engine_step("frame rays", lambda: engine.render(view, "rays"))
    engine_step("frame volumes", draw_volumes)
    if scene.sensors:
        points = np.concatenate([sensors.points for sensors in scene.sensors])
        normals = np.concatenate([sensors.normals for sensors in scene.sensors])
        rays = SENSOR_RAYS
        engine_step("sensors", lambda: engine.illuminance(points, normals, rays=rays, opening_rays=rays))
    facts = {**engine.facts(), "sweeps": engine.sweeps, "view": view.name, "condition": spec.name}
    if failures:
        facts["volumes"] = f"not drawn: {failures[0]}"
    return Trace(scene.name, _aligned(steps, engine.trace(), counts), facts)


def write_trace(path: Path, trace: Trace) -> None:
    """Writes a trace in the Trace Event Format (complete events, "ph": "X"), which Perfetto and Chrome open."""
    titles = [
        ("process_name", THREAD, f"Transom: {trace.name}"),
        ("thread_name", THREAD, "calling thread"),
        ("thread_name", BESIDE_THREAD, "beside it"),
    ]
    events: list[dict[str, Any]] = [
        {"name": kind, "ph": "M", "pid": PROCESS, "tid": thread, "args": {"name": title}}
        for kind, thread, title in titles
    ]
    events += span_events(trace.spans)
    other = {"scene": trace.name, "facts": trace.facts, "provenance": current_provenance().model_dump(mode="json")}
    write_atomic(path, json_text({"traceEvents": events, "displayTimeUnit": "ms", "otherData": other}))


def span_events(spans: Iterable[Span]) -> list[dict[str, Any]]:
    """Spans [s] as complete events of the Trace Event Format."""
    return [
        {
            "name": name,
            "cat": "transom",
            "ph": "X",
            "pid": PROCESS,
            "tid": BESIDE_THREAD if name in BESIDE else THREAD,
            "ts": round(1e6 * begin, 3),
            "dur": round(1e6 * (end - begin), 3),
        }
        for name, begin, end in spans
    ]


def read_trace(path: Path) -> Trace:
    """A trace from a file of `write_trace`, or the trace.json of a run bundle. Raises InputError for anything else."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        spans = tuple(
            (str(event["name"]), 1e-6 * float(event["ts"]), 1e-6 * (float(event["ts"]) + float(event["dur"])))
            for event in content["traceEvents"]
            if event["ph"] == "X"
        )
    except FileNotFoundError as error:
        raise InputError("does not exist", file=path, remedy="transom trace SCENE -o FILE writes one") from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"is not a trace ({error})", file=path, remedy="transom trace SCENE -o FILE") from error
    if not spans:
        raise InputError("holds no phase", file=path)
    other = content.get("otherData", {})
    return Trace(other.get("scene", path.stem), spans, other.get("facts", {}))


def phase_changes(first: dict[str, float], second: dict[str, float]) -> list[PhaseChange]:
    """Phases of two traces beside each other, the largest difference first."""
    paths = dict.fromkeys([*first, *second])
    rows = [PhaseChange(path, first.get(path), second.get(path)) for path in paths]
    return sorted(rows, key=lambda row: -abs(row.difference_s))


def change_lines(changes: Sequence[PhaseChange], first: str, second: str) -> list[str]:
    """A table for the terminal."""
    width = max([len("phase"), *(len(row.path) for row in changes)])
    lines = [f"A: {first}", f"B: {second}", f"{'phase':{width}}{'A [ms]':>12}{'B [ms]':>12}{'B - A':>12}{'B / A':>9}"]
    for row in changes:
        ratio = "" if row.ratio is None else f"{row.ratio:.3f}"
        cells = f"{_ms(row.first_s):>12}{_ms(row.second_s):>12}{1e3 * row.difference_s:>+12.3f}{ratio:>9}"
        lines.append(f"{row.path:{width}}{cells}")
    return lines


def phase_lines(phases: dict[str, float]) -> list[str]:
    """One trace as a table for the terminal, in the order in which things were done, parts indented."""
    paths = [(path.count("/"), path.rsplit("/", 1)[-1], seconds) for path, seconds in phases.items()]
    return [f"{'  ' * depth}{name:{30 - 2 * depth}}{1e3 * seconds:>12.3f} ms" for depth, name, seconds in paths]


def _aligned(steps: Sequence[Span], events: Sequence[Span], counts: Sequence[int]) -> tuple[Span, ...]:
    """Steps and engine phases on one clock that begins with the first step. counts: of events after each step from
    "solve" on. Rounding must not push a phase over its step's border: phases are cut there."""
    own_steps = [step for step in steps if step[0] not in ("load", "condition")]
    begins = [0, *counts]
    groups = [events[begin:end] for begin, end in zip(begins, counts, strict=False)]
    offsets = [
        step[2] - max(event[2] for event in group) for step, group in zip(own_steps, groups, strict=True) if group
    ]
    offset, origin = min(offsets, default=0.0), steps[0][1]
    spans = [(name, begin - origin, end - origin) for name, begin, end in steps]
    for (_, low, high), group in zip(own_steps, groups, strict=True):
        for name, begin, end in group:
            inside = (max(begin + offset, low) - origin, min(end + offset, high) - origin)
            spans.append((name, *inside))
    return tuple(sorted(spans, key=lambda span: (span[1], -span[2])))


def _ms(seconds: float | None) -> str:
    return "" if seconds is None else f"{1e3 * seconds:.3f}"

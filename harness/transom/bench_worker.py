"""Times one build of the engine on command: a process that reads JSON lines and answers with JSON lines.

It is started by path, as `python -I -S bench_worker.py SETUP`, so that it can time any revision: of this checkout it is
all that is imported, and of the revision it uses only what every revision has. SETUP is JSON:

    paths           folders to import from, first to last: the revision's harness, then the libraries
    engine_folder   where the compiled module is; empty: beside the revision's sources
    scene           folder of the scene
    patches         wanted patches; 0: the engine's default
    width, height   of frames

Each request is a JSON list of quantities with how often to repeat each, as [["relight", 5]]; the answer gives seconds
by quantity and phase ("relight", "relight/gather"), of several repeats the least, which load disturbs least.
"""

from __future__ import annotations

import dataclasses
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

SENSOR_RAYS = 2048
"""Rays a sensor: enough work to be timed."""

CPU_TIME = "all threads"
"""Name under a quantity of the processor time of all threads: other programs disturb it less than they do the clock."""

Span = tuple[str, float, float]

BESIDE = {"first reflection": "interreflection"}
"""Phases that run beside another one: neither is a part of the other, and their times overlap."""


def phase_seconds(spans: Iterable[Span], prefix: str) -> dict[str, float]:
    """Seconds by path of nested spans (name, begin, end), summed over repeats: "relight/gather" under prefix "relight".

    A span that lies within another is its part, but for those BESIDE each other. Within a step, the engine's "frame" is
    the whole: it adds no level.
    """
    totals: dict[str, float] = {}
    open_spans: list[tuple[str, str, float]] = []  # name, path, end
    for name, begin, end in sorted(spans, key=lambda span: (span[1], -span[2])):
        while open_spans and begin >= open_spans[-1][2]:
            open_spans.pop()
        around = [path for other, path, _ in open_spans if other != BESIDE.get(name)]
        above = around[-1] if around else prefix
        path = above if name == "frame" and above else f"{above}/{name}"
        if name not in BESIDE:
            open_spans.append((name, path, end))
        if path != prefix:
            totals[path] = totals.get(path, 0.0) + end - begin
    return totals


class Timer:
    """One scene in one build, with its engine solved."""

    def __init__(self, setup: dict[str, Any]) -> None:
        from transom.daylight.condition import resolve_condition
        from transom.engine import Engine, SolveOptions
        from transom.scene import load_scene

        self.scene = load_scene(setup["scene"])
        self.conditions = [resolve_condition(spec, self.scene.site) for spec in self.scene.conditions]
        options = SolveOptions(target_patch_count=setup["patches"]) if setup["patches"] else SolveOptions()
        self.view = dataclasses.replace(self.scene.views[0], width=setup["width"], height=setup["height"])
        self._solve: Callable[[], Any] = lambda: Engine.solve(self.scene, options, trace=True)
        self.engine = self._solve()
        self.engine.relight(self.conditions[0])

    def times(self, quantity: str, repeats: int) -> dict[str, float]:
        """Seconds of a quantity and its phases, each the least of `repeats`; nothing for what the build cannot do."""
        least: dict[str, float] = {}
        for _ in range(repeats):
            if quantity == "relight":  # from another hour, so that there is something to do
                self.engine.relight(self.conditions[-1])
            seen = len(self.engine.trace())
            begin, begin_cpu = time.perf_counter(), time.process_time()
            if not self._do(quantity):
                return {}
            seconds, cpu_seconds = time.perf_counter() - begin, time.process_time() - begin_cpu
            spans = self.engine.trace()
            found = {quantity: seconds, f"{quantity}/{CPU_TIME}": cpu_seconds}
            found |= phase_seconds(spans if quantity == "solve" else spans[seen:], quantity)
            least = {path: min(value, least.get(path, value)) for path, value in found.items()}
        if quantity == "solve":
            self.engine.relight(self.conditions[0])
        return least

    def _do(self, quantity: str) -> bool:
        if quantity == "solve":
            self.engine = self._solve()
        elif quantity == "relight":
            self.engine.relight(self.conditions[0])
        elif quantity == "frame_rays":
            self.engine.render(self.view, "rays")
        elif quantity == "frame_volumes":
            try:
                self.engine.render(self.view, "volumes")
            except RuntimeError:  # no OpenGL here
                return False
        elif quantity == "sensors" and self.scene.sensors:
            points, normals = self.scene.sensors[0].points, self.scene.sensors[0].normals
            self.engine.illuminance(points, normals, rays=SENSOR_RAYS, opening_rays=SENSOR_RAYS)
        else:
            return False
        return True


def answer(timer: Timer, request: Sequence[Sequence[Any]]) -> dict[str, float]:
    """Seconds by path of every quantity in the request."""
    result: dict[str, float] = {}
    for quantity, repeats in request:
        result |= timer.times(str(quantity), int(repeats))
    return result


def serve(setup: dict[str, Any]) -> None:
    """Answers requests until its input ends. What libraries print goes to the log, not among the answers."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    sys.path[:] = [*setup["paths"], *(path for path in sys.path if path not in setup["paths"])]
    if setup["engine_folder"]:
        import transom

        transom.__path__.insert(0, setup["engine_folder"])
    timer = Timer(setup)
    facts = timer.engine.facts()
    print(json.dumps({"patches": facts["patches"]}), file=answers, flush=True)
    for line in sys.stdin:
        print(json.dumps(answer(timer, json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    serve(json.loads(sys.argv[1]))

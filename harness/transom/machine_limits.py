"""What the machine can do at best, and how much of it the engine uses: memory for products, rays for visibility."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from transom.engine import Engine

COPY_BYTES = 64 << 20
"""Of each array that is copied: far more than any cache holds."""

COPY_REPEATS, RAY_REPEATS = 9, 5
SPARSE_ENTRY_BYTES = 8
"""A form factor in single precision and its column."""

BENCHMARKS = Path(__file__).resolve().parents[2] / "build" / "release" / "engine_benchmarks"

LimitName = Literal["memory_copy", "embree_rays"]


@dataclass(frozen=True)
class Limit:
    """A rate that this machine reached [1/s]: all samples and their median.

    memory_copy: bytes read and written by a copy of large arrays by all threads (STREAM's Copy, McCalpin 1995).
    embree_rays: rays over a hemisphere to their first surface in a furnished room of about a thousand triangles, by
    Embree alone, sixteen at a time, on all threads.
    """

    name: LimitName
    unit: Literal["B/s", "rays/s"]
    samples: tuple[float, ...]
    median: float

    def giga_unit(self) -> str:
        return f"G{self.unit}"


@dataclass(frozen=True)
class Utilisation:
    """A phase against a limit. rate: what it reached [unit/s]; share: of the limit; counted: what was counted."""

    phase: str
    limit: LimitName
    unit: Literal["B/s", "rays/s"]
    rate: float
    share: float
    counted: str


def memory_copy() -> Limit:
    """Copies large arrays with as many threads as there are processors."""
    threads = os.cpu_count() or 1
    source = [np.ones(COPY_BYTES // threads // 8) for _ in range(threads)]
    target = [np.zeros_like(part) for part in source]
    size = 2 * sum(part.nbytes for part in source)

    with ThreadPoolExecutor(threads) as pool:

        def copy() -> None:
            list(pool.map(np.copyto, target, source))

        copy()
        samples = tuple(size / _seconds(copy) for _ in range(COPY_REPEATS))
    return Limit("memory_copy", "B/s", samples, float(np.median(samples)))


def embree_rays() -> Limit | None:
    """Runs the engine's ray benchmark (engine/bench/ray_benchmark.cpp); None where it is not built or fails."""
    command = [str(BENCHMARKS), "--benchmark_filter=hemisphere_rays", "--benchmark_format=json"]
    try:
        done = subprocess.run([*command, f"--benchmark_repetitions={RAY_REPEATS}"], capture_output=True, check=True)
        runs = json.loads(done.stdout)["benchmarks"]
        samples = tuple(float(run["items_per_second"]) for run in runs if run["run_type"] == "iteration")
    except (OSError, subprocess.CalledProcessError, ValueError, KeyError):
        return None
    return Limit("embree_rays", "rays/s", samples, float(np.median(samples))) if samples else None


def utilisations(
    engine: Engine, phase_medians_s: Mapping[str, float], limits: Sequence[Limit]
) -> tuple[Utilisation, ...]:
    """Interreflection against memory, and the solve's two ray phases against rays. Phases that are not there: none.

    Interreflection reads the form factors once a sweep; what else it reads is not counted, so that its share is a lower
    bound. Matrices that fit into a cache may exceed the limit of memory.
    """
    by_name = {limit.name: limit.median for limit in limits}
    facts, options = engine.facts(), engine.options
    entries = len(engine.form_factors()[1])
    counted: list[tuple[str, LimitName, Literal["B/s", "rays/s"], float, str]] = [
        (
            "relight_hour/interreflection",
            "memory_copy",
            "B/s",
            float(entries * SPARSE_ENTRY_BYTES * engine.sweeps),
            f"{entries} form factors of {SPARSE_ENTRY_BYTES} bytes, {engine.sweeps} sweeps",
        ),
        (
            "solve/patches",
            "embree_rays",
            "rays/s",
            float(facts["patches"] * (options.patch_rays + options.patch_opening_rays)),
            f"{facts['patches']} patches, {options.patch_rays} + {options.patch_opening_rays} rays each",
        ),
        (
            "solve/nodes",
            "embree_rays",
            "rays/s",
            float(facts["nodes"] * (options.node_rays + options.node_opening_rays)),
            f"{facts['nodes']} nodes, {options.node_rays} + {options.node_opening_rays} rays each",
        ),
    ]
    return tuple(
        Utilisation(phase, limit, unit, amount / seconds, amount / seconds / by_name[limit], words)
        for phase, limit, unit, amount, words in counted
        if (seconds := phase_medians_s.get(phase, 0.0)) > 0 and by_name.get(limit, 0.0) > 0
    )


def _seconds(action: Callable[[], object]) -> float:
    begin = time.perf_counter()
    action()
    return time.perf_counter() - begin

"""Speed of one build against another: interleaved rounds in random order, an A/A control, a second fresh build.

What is decided and how is in `transom.judge.decide_speed`; what is estimated and how in `transom.speed_pairs`.
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from pydantic import TypeAdapter

from transom.files import write_atomic
from transom.judge import EXIT_CODES, EXIT_PRIORITY, Outcome, SpeedChange, decide_speed
from transom.progress import CaseProgress
from transom.provenance import Provenance, current_provenance
from transom.revisions import Build, Source, Worker, build, check_out, workshop
from transom.speed_pairs import PairedTimes, speed_change

AGAINST_FORMAT = 1

REQUEST: tuple[tuple[str, int], ...] = (
    ("solve", 1),
    ("relight", 6),
    ("frame_rays", 3),
    ("frame_volumes", 2),
    ("sensors", 2),
)
"""What a round times, and of how many repeats the least counts."""

GENERATION_ROUNDS = 8
"""Processes are started anew after so many rounds: where memory happens to lie makes one faster than another."""

ORDER_SEED = 1
LEAST_WHOLE_MS = 10.0
"""From here on, tenths of a millisecond are enough digits."""


class Timed(Protocol):
    """What `measure` needs of a worker."""

    def times(self, request: Sequence[tuple[str, int]]) -> dict[str, float]: ...


StartGeneration = Callable[[ExitStack], tuple[Timed, Timed, Timed]]
"""Starts base, control and ours, and leaves their ends to the stack."""


@dataclass(frozen=True)
class SpeedRow:
    """One quantity or phase: first measurement, second one where it was asked for, decision, and the raw times."""

    quantity: str
    outcome: Outcome
    first: SpeedChange
    second: SpeedChange | None
    first_times: PairedTimes
    second_times: PairedTimes | None


@dataclass(frozen=True)
class SpeedComparison:
    """The file that `transom bench --against` writes. only_base, only_ours: phases that one build alone has.

    load_average: of the machine before and after [processes over one minute].
    """

    format: int
    created: datetime
    scene: str
    patches: int
    base: str
    ours: str
    rounds: int
    rows: tuple[SpeedRow, ...]
    only_base: tuple[str, ...]
    only_ours: tuple[str, ...]
    load_average: tuple[float, float]
    provenance: Provenance

    def exit_code(self) -> int:
        codes = {EXIT_CODES[row.outcome] for row in self.rows}
        return next((code for code in EXIT_PRIORITY if code in codes), 4)


@dataclass(frozen=True)
class Measured:
    """Rounds of three workers: times by quantity, and quantities that only one build has."""

    times: dict[str, PairedTimes]
    only_base: tuple[str, ...]
    only_ours: tuple[str, ...]


def compare_builds(
    scene: Path,
    against: str,
    of: str | None,
    *,
    rounds: int,
    patches: int,
    size: tuple[int, int],
    only: Sequence[str],
    progress: CaseProgress,
) -> SpeedComparison:
    """Builds revision `against` and `of` (None: the working tree) and compares their speed on a scene folder.

    only: quantities to time; none: all. Raises InputError for what cannot be built or timed.
    """
    load = os.getloadavg()[0]
    setup = {"scene": str(scene), "patches": patches, "width": size[0], "height": size[1]}
    request = [entry for entry in REQUEST if not only or entry[0] in only]
    with workshop() as folder:
        base, ours = check_out(against, folder), check_out(of, folder, "--of")
        first = _fresh_comparison(base, ours, folder / "first", setup, request, rounds, progress)
        changes = {name: speed_change(times, len(first.times)) for name, times in first.times.items()}
        suspects = [name for name, change in changes.items() if change.looks_slower()]
        second, again = None, {}
        if suspects:
            wanted = {name.split("/")[0] for name in suspects}
            again_request = [entry for entry in request if entry[0] in wanted]
            progress.extend(2)
            second = _fresh_comparison(base, ours, folder / "second", setup, again_request, rounds, progress)
            again = {name: speed_change(second.times[name], len(suspects)) for name in suspects if name in second.times}
    rows = [
        SpeedRow(
            name,
            decide_speed(change, again.get(name)),
            change,
            again.get(name),
            first.times[name],
            second.times[name] if second is not None and name in again else None,
        )
        for name, change in changes.items()
    ]
    return SpeedComparison(
        format=AGAINST_FORMAT,
        created=datetime.now(UTC).replace(microsecond=0),
        scene=scene.name,
        patches=patches,
        base=base.name,
        ours=ours.name,
        rounds=rounds,
        rows=tuple(rows),
        only_base=first.only_base,
        only_ours=first.only_ours,
        load_average=(load, os.getloadavg()[0]),
        provenance=current_provenance(),
    )


def measure(
    start: StartGeneration,
    request: Sequence[tuple[str, int]],
    rounds: int,
    note: Callable[[int, int], None],
    rng: random.Random,
) -> Measured:
    """Times base, control and ours in each of `rounds` rounds, in random order, in processes that are renewed.

    Of a quantity's repeats in a round the least counts: load only ever adds.
    """
    samples: list[list[dict[str, float]]] = [[], [], []]
    done = 0
    while done < rounds:
        with ExitStack() as stack:
            workers = start(stack)
            for _ in range(min(GENERATION_ROUNDS, rounds - done)):
                for entries, found in zip(samples, _round(workers, request, rng), strict=True):
                    entries.append(found)
                done += 1
                note(done, rounds)
    base, control, ours = samples
    in_base, in_ours = _always(base + control), _always(ours)
    times = {
        name: PairedTimes(name, *(tuple(entry[name] for entry in entries) for entries in (base, control, ours)))
        for name in in_base
        if name in in_ours
    }
    return Measured(
        times,
        tuple(name for name in in_base if name not in in_ours),
        tuple(name for name in in_ours if name not in in_base),
    )


def write_comparison(path: Path, comparison: SpeedComparison) -> None:
    write_atomic(path, TypeAdapter(SpeedComparison).dump_json(comparison, indent=1) + b"\n")


def comparison_lines(comparison: SpeedComparison) -> list[str]:
    """The comparison as a table for the terminal: slowest change first within each decision, worst decision first."""
    order = list(reversed(Outcome))
    lines = [
        f"{comparison.ours} against {comparison.base}, {comparison.scene}, {comparison.rounds} rounds",
        f"{'':14}{'quantity or phase':32}{'base':>10}{'ours':>10}{'ratio':>8}  {'interval':15}{'A/A':>7}{'limit':>9}",
    ]
    for row in sorted(comparison.rows, key=lambda row: (order.index(row.outcome), -(row.second or row.first).ratio)):
        change = row.second or row.first
        interval = f"{change.low:.3f}-{change.high:.3f}"
        lines.append(
            f"{row.outcome.value:14}{row.quantity:32}{_milliseconds(change.base_s):>10}{_milliseconds(change.ours_s):>10}"
            f"{change.ratio:>8.3f}  {interval:15}{change.control_ratio:>7.3f}{change.threshold:>9.3f}"
        )
    lines += [f"{'':14}{name:32}only in {comparison.base}" for name in comparison.only_base]
    lines += [f"{'':14}{name:32}only in {comparison.ours}" for name in comparison.only_ours]
    return lines


def _fresh_comparison(
    base: Source,
    ours: Source,
    folder: Path,
    setup: Mapping[str, Any],
    request: Sequence[tuple[str, int]],
    rounds: int,
    progress: CaseProgress,
) -> Measured:
    """Builds both from nothing, then measures."""
    progress.begin(f"{folder.name} builds")
    builds = [build(source, folder / name) for name, source in (("base", base), ("ours", ours))]
    progress.finish("built")
    progress.begin(f"{folder.name} rounds")

    def start(stack: ExitStack) -> tuple[Timed, Timed, Timed]:
        return _start_workers(builds[0], builds[1], setup, folder, stack)

    measured = measure(start, request, rounds, progress.update, random.Random(ORDER_SEED))
    progress.finish(f"{rounds} rounds")
    return measured


def _round(
    workers: tuple[Timed, Timed, Timed], request: Sequence[tuple[str, int]], rng: random.Random
) -> list[dict[str, float]]:
    """One time of everything for each worker. They take turns at every repeat, so that what load there is meets all."""
    least: list[dict[str, float]] = [{}, {}, {}]
    for quantity, repeats in request:
        for _ in range(repeats):
            order = [0, 1, 2]
            rng.shuffle(order)
            for which in order:
                found = workers[which].times([(quantity, 1)])
                least[which] |= {name: min(value, least[which].get(name, value)) for name, value in found.items()}
    return least


def _start_workers(
    base: Build, ours: Build, setup: Mapping[str, Any], folder: Path, stack: ExitStack
) -> tuple[Timed, Timed, Timed]:
    workers = []
    for name, built in (("base", base), ("control", base), ("ours", ours)):
        worker = stack.enter_context(Worker(built, dict(setup), folder / f"{name}.log"))
        worker.ready()
        workers.append(worker)
    return workers[0], workers[1], workers[2]


def _always(entries: Sequence[Mapping[str, float]]) -> list[str]:
    """Names that are in every entry, in the order of the first."""
    return [name for name in entries[0] if all(name in entry for entry in entries)]


def _milliseconds(seconds: float) -> str:
    milliseconds = 1e3 * seconds
    return f"{milliseconds:.1f} ms" if milliseconds >= LEAST_WHOLE_MS else f"{milliseconds:.3f} ms"

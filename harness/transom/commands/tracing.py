"""`transom trace`: where the time goes, phase by phase, and what differs between two traces or two revisions."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.choices import checked_output
from transom.errors import InputError

DIFF_ROUNDS = 9
"""Rounds of each revision; the medians are shown."""


def trace(
    scene: Annotated[str | None, typer.Argument(metavar="[SCENE]", help="A scene, or the path of its folder.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="FILE.json, for ui.perfetto.dev.")] = None,
    view: Annotated[str | None, typer.Option(help="A view of the scene; its first if omitted.")] = None,
    condition: Annotated[str | None, typer.Option(help="A condition of the scene; its first if omitted.")] = None,
    diff: Annotated[
        tuple[str, str] | None, typer.Option(metavar="A B", help="Two trace files, or with SCENE two revisions.")
    ] = None,
) -> None:
    """Load, solve, relight, draw and measure a scene, and write when each phase began and ended.

    With --diff: a table of the phases of two traces, largest difference first. Revisions are built beside this one and
    timed in turn; to judge a difference, use `transom bench SCENE --against REV`.

    \b
    Example:  transom trace test_room -o trace.json
              transom trace --diff before.json after.json
              transom trace test_room --diff main HEAD
    """
    from transom.phases import change_lines, phase_changes, phase_lines, read_trace, record_trace, write_trace
    from transom.scene import load_scene

    if diff is not None:
        if output is not None:
            raise InputError("writes no trace file", field="--diff", remedy="Leave -o away")
        if all(Path(name).is_file() for name in diff) or scene is None:
            first, second = (read_trace(Path(name)).phases() for name in diff)
        else:
            first, second = _revision_phases(scene, diff)
        lines = change_lines(phase_changes(first, second), *diff)
    else:
        if scene is None:
            raise InputError("is missing", field="SCENE", remedy="Name a scene: transom list scenes")
        path = checked_output(output or Path("trace.json"), (".json",))
        recorded = record_trace(lambda: load_scene(scene), view, condition)
        write_trace(path, recorded)
        lines = [*phase_lines(recorded.phases()), f"{path}: open it at ui.perfetto.dev"]
    for line in lines:
        typer.echo(line)


def _revision_phases(scene: str, names: tuple[str, str]) -> tuple[dict[str, float], dict[str, float]]:
    """Median seconds by phase of two revisions, timed in turn."""
    from contextlib import ExitStack

    import numpy as np
    from rich.console import Console

    from transom.bench_against import REQUEST
    from transom.progress import CaseProgress
    from transom.revisions import Worker, build, check_out, workshop
    from transom.scene import load_scene

    folder = load_scene(scene).file.resolve().parent
    setup = {"scene": str(folder), "patches": 0, "width": 320, "height": 240}
    with workshop() as place, CaseProgress(3, Console(stderr=True)) as bars:
        builds = []
        for side, name in zip("AB", names, strict=True):
            bars.begin(f"build {name}")
            builds.append(build(check_out(name, place, "--diff"), place / side))
            bars.finish("built")
        bars.begin("rounds")
        with ExitStack() as stack:
            workers = [stack.enter_context(Worker(entry, setup, place / f"{i}.log")) for i, entry in enumerate(builds)]
            for worker in workers:
                worker.ready()
            samples: tuple[list[dict[str, float]], ...] = ([], [])
            for done in range(DIFF_ROUNDS):
                for side_index in (0, 1) if done % 2 == 0 else (1, 0):
                    samples[side_index].append(workers[side_index].times(REQUEST))
                bars.update(done + 1, DIFF_ROUNDS)
        bars.finish(f"{DIFF_ROUNDS} of each")
    medians = [
        {name: float(np.median([entry[name] for entry in entries if name in entry])) for name in entries[0]}
        for entries in samples
    ]
    return medians[0], medians[1]

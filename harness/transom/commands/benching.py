"""`transom bench`: how fast the engine is, against its size, against another revision, and against other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.choices import checked_output
from transom.errors import InputError

FOLDER = Path("build") / "bench"
AGAINST_SIZE = (320, 240)
ROUNDS = 31


def bench(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene, or the path of its folder.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="FILE.json; default build/bench/...")] = None,
    against: Annotated[str | None, typer.Option(metavar="REV", help="Compare with the build of a revision.")] = None,
    of: Annotated[
        str | None, typer.Option(metavar="REV", help="With --against: of this revision, not the working tree.")
    ] = None,
    rounds: Annotated[int, typer.Option(help="With --against: rounds, an odd number from 9.")] = ROUNDS,
    patches: Annotated[int, typer.Option(min=0, help="With --against: patches wanted; 0: the default.")] = 0,
) -> None:
    """Time a scene: load, solve, relight, frame, sensors, memory, by phase.

    --against REV builds that revision and this one from nothing, times them in turn, and judges every phase: exit
    code 1 for one that is slower twice, by more than two processes of one build differ; 3 where more rounds decide.

    \b
    Example:  transom bench test_room --against HEAD~1
    """
    if against is None:
        raise InputError("is missing", field="--against")
    code = _against(scene, output, against, of, rounds, patches)
    if code:
        raise typer.Exit(code)


def _against(scene: str, output: Path | None, against: str, of: str | None, rounds: int, patches: int) -> int:
    from rich.console import Console

    from transom.bench_against import compare_builds, comparison_lines, write_comparison
    from transom.progress import CaseProgress
    from transom.scene import load_scene
    from transom.speed_pairs import LEAST_ROUNDS

    if rounds < LEAST_ROUNDS or rounds % 2 == 0:
        raise InputError(
            f"is not an odd number from {LEAST_ROUNDS}", field="--rounds", value=rounds, remedy=f"Use {ROUNDS}"
        )
    folder = load_scene(scene).file.resolve().parent
    path = _output(output, FOLDER / f"{folder.name}-against.json")
    with CaseProgress(2, Console(stderr=True)) as bars:
        comparison = compare_builds(
            folder, against, of, rounds=rounds, patches=patches, size=AGAINST_SIZE, progress=bars
        )
    write_comparison(path, comparison)
    for line in comparison_lines(comparison):
        typer.echo(line)
    typer.echo(f"{path}: all times")
    return comparison.exit_code()


def _output(chosen: Path | None, default: Path) -> Path:
    if chosen is not None:
        return checked_output(chosen, (".json",))
    default.parent.mkdir(parents=True, exist_ok=True)
    return default

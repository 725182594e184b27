"""`transom bench`: how fast the engine is, against its size, against another revision, and against other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.choices import checked_output
from transom.commands.picture import GlazingOption
from transom.errors import InputError

FOLDER = Path("build") / "bench"
AGAINST_SIZE = (320, 240)
ROUNDS = 31


def bench(
    scene: Annotated[str | None, typer.Argument(metavar="[SCENE]", help="A scene, or its folder's path.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="FILE.json; default build/bench/...")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points of each sweep, in less time.")] = False,
    budget: Annotated[
        float | None, typer.Option(min=1.0, metavar="SECONDS", help="Time to spend; default 240, or 40 with --quick.")
    ] = None,
    growth: Annotated[
        bool, typer.Option("--growth", help="Costs of a hall over patches, openings and triangles; without SCENE.")
    ] = False,
    speed_error: Annotated[
        bool, typer.Option("--speed-error", help="Time and error of the engine, Mitsuba and Radiance.")
    ] = False,
    view: Annotated[str | None, typer.Option(help="With --speed-error: a view; the scene's first if omitted.")] = None,
    condition: Annotated[
        str | None, typer.Option(help="With --speed-error: a condition; the scene's first if omitted.")
    ] = None,
    against: Annotated[str | None, typer.Option(metavar="REV", help="Compare with the build of a revision.")] = None,
    of: Annotated[
        str | None, typer.Option(metavar="REV", help="With --against: of this revision, not the working tree.")
    ] = None,
    rounds: Annotated[int, typer.Option(help="With --against: rounds, an odd number from 9.")] = ROUNDS,
    patches: Annotated[int, typer.Option(min=0, help="With --against: patches wanted; 0: the default.")] = 0,
    glazing: GlazingOption = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="QUANTITY", help="With --against: time this alone; may be repeated.")
    ] = None,
) -> None:
    """Time a scene: load, solve, relight, frame, sensors and memory, by phase, over patches and openings.

    Writes all samples to build/bench/SCENE.json; its fields are in reports/README.md.

    --speed-error renders a view that has a stored reference with each program over its settings, and writes
    build/bench/speed_error.json and .svg: error against time, and the speed-up at equal error.

    --against REV builds that revision and this one from nothing, times them in turn, and judges every phase: exit
    code 1 for one that is slower twice, by more than two processes of one build differ; 3 where more rounds decide.

    --growth measures a hall of its own, up to 30,000 patches, 200 openings and a million triangles, and writes
    build/bench/growth.json and .svg.

    \b
    Example:  transom bench test_room -o bench.json
              transom bench test_room --quick
              transom bench test_room --speed-error
              transom bench test_room --against HEAD~1
              transom bench --growth
    """
    if growth:
        if scene is not None or speed_error or against is not None:
            remedy = "Leave out SCENE, --speed-error and --against"
            raise InputError("makes a hall of its own and answers one question", field="--growth", remedy=remedy)
        _growth(output, quick)
        return
    if scene is None:
        raise InputError("is missing", field="SCENE", remedy="Name a scene, or ask for --growth")
    if against is not None and speed_error:
        raise InputError("and --speed-error are two different questions", field="--against", remedy="Ask one at a time")
    if speed_error:
        _speed_error(scene, output, view, condition, quick, glazing or [])
        return
    if against is not None:
        if glazing:
            remedy = "An earlier revision may know no products: put the glazing into a scene's folder"
            raise InputError("is not possible with --against", field="--glazing", value=glazing, remedy=remedy)
        code = _against(scene, output, against, of, rounds, patches, only or [])
        if code:
            raise typer.Exit(code)
        return
    if of is not None:
        raise InputError("needs --against", field="--of", value=of, remedy="Name the revision to compare with")
    _sizes(scene, output, budget, quick, glazing or [])


def _sizes(scene: str, output: Path | None, budget: float | None, quick: bool, glazings: list[str]) -> None:
    from rich.console import Console

    from transom.bench import DEFAULT_BUDGET_S, QUICK_BUDGET_S, bench_lines, bench_points, bench_scene, write_bench
    from transom.fenestration.reglazing import load_glazed
    from transom.progress import CaseProgress

    loaded = load_glazed(scene, glazings)
    path = _output(output, FOLDER / f"{loaded.name}.json")
    seconds = budget or (QUICK_BUDGET_S if quick else DEFAULT_BUDGET_S)
    with CaseProgress(len(bench_points(loaded, quick)), Console(stderr=True)) as bars:
        measured = bench_scene(scene, bars, budget_s=seconds, quick=quick, glazings=glazings)
    write_bench(path, measured)
    for line in bench_lines(measured):
        typer.echo(line)
    typer.echo(f"{path}: all samples")


def _growth(output: Path | None, quick: bool) -> None:
    from rich.console import Console

    from transom.bench_growth import growth_lines, growth_points, measure_growth, write_growth
    from transom.figures_speed import growth_figure
    from transom.files import write_atomic
    from transom.progress import CaseProgress

    path = _output(output, FOLDER / "growth.json")
    with CaseProgress(len(growth_points(quick)), Console(stderr=True)) as bars:
        found = measure_growth(bars, quick=quick)
    write_growth(path, found)
    write_atomic(path.with_suffix(".svg"), growth_figure(found))
    for line in growth_lines(found):
        typer.echo(line)
    typer.echo(f"{path} and {path.with_suffix('.svg')}")


def _speed_error(
    scene: str, output: Path | None, view: str | None, condition: str | None, quick: bool, glazings: list[str]
) -> None:
    from rich.console import Console

    from transom.figures_speed import speed_error_figure
    from transom.files import write_atomic
    from transom.progress import CaseProgress
    from transom.speed_error import SETTINGS, measure_speed_error, speed_error_lines, write_speed_error

    path = _output(output, FOLDER / "speed_error.json")
    count = sum(entry.quick or not quick for entry in SETTINGS)
    with CaseProgress(count, Console(stderr=True)) as bars:
        found = measure_speed_error(scene, bars, view=view, condition=condition, quick=quick, glazings=glazings)
    write_speed_error(path, found)
    write_atomic(path.with_suffix(".svg"), speed_error_figure(found))
    for line in speed_error_lines(found):
        typer.echo(line)
    typer.echo(f"{path} and {path.with_suffix('.svg')}")


def _against(
    scene: str, output: Path | None, against: str, of: str | None, rounds: int, patches: int, only: list[str]
) -> int:
    from rich.console import Console

    from transom.bench_against import REQUEST, compare_builds, comparison_lines, write_comparison
    from transom.progress import CaseProgress
    from transom.scene import load_scene
    from transom.speed_pairs import LEAST_ROUNDS

    if rounds < LEAST_ROUNDS or rounds % 2 == 0:
        raise InputError(
            f"is not an odd number from {LEAST_ROUNDS}", field="--rounds", value=rounds, remedy=f"Use {ROUNDS}"
        )
    known = [quantity for quantity, _ in REQUEST]
    for name in only:
        if name not in known:
            raise InputError("is not timed", field="--only", value=name, remedy=f"Choose from {', '.join(known)}")
    folder = load_scene(scene).file.resolve().parent
    path = _output(output, FOLDER / f"{folder.name}-against.json")
    with CaseProgress(2, Console(stderr=True)) as bars:
        comparison = compare_builds(
            folder, against, of, rounds=rounds, patches=patches, size=AGAINST_SIZE, only=only, progress=bars
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

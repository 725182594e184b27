"""`transom sensors`: illuminance at points."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.choices import RendererName, checked_output, checked_sun, chosen_condition
from transom.commands.picture import (
    ConditionOption,
    GlazingOption,
    NoiseOption,
    SceneArgument,
    SkyOption,
    SunOption,
    TimeOption,
)
from transom.errors import InputError


def sensors(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="FILE.csv.")],
    points: Annotated[
        Path | None, typer.Option(help="FILE.csv with columns x,y,z,nx,ny,nz [m]; the scene's sensors if omitted.")
    ] = None,
    condition: ConditionOption = None,
    time: TimeOption = None,
    sky: SkyOption = None,
    renderer: Annotated[RendererName, typer.Option(help="Who measures.")] = RendererName.engine,
    noise: NoiseOption = None,
    glazing: GlazingOption = None,
    sun: SunOption = "point",
) -> None:
    """Illuminance [lx] at points, with its standard error.

    Writes x,y,z,nx,ny,nz,illuminance_lx,standard_error_lx (and the set's name first, for a scene's own sensors).

    \b
    Example:  transom sensors desk_office --sky overcast -o desks.csv
    """
    from transom.bundle import make_case
    from transom.daylight.condition import resolve_condition
    from transom.fenestration.reglazing import load_glazed
    from transom.progress import single_progress
    from transom.renderer import load_renderer
    from transom.run import SENSOR_TARGET_PERCENT, Question, Target, render_case
    from transom.sensor_file import read_sensors, scene_sensors, write_sensors

    checked_output(output, (".csv",))
    loaded = load_glazed(scene, glazing or [])
    table = read_sensors(points) if points is not None else scene_sensors(loaded)
    if table is None:
        raise InputError("has no sensors", file=loaded.file, remedy="Give --points FILE.csv")
    resolved = resolve_condition(chosen_condition(loaded, condition, time, sky), loaded.site)
    worker = load_renderer(renderer.value)
    checked_sun(sun, renderer)
    options = {"sun": sun} if renderer is RendererName.engine else {}
    target = None if renderer is RendererName.engine else Target(noise or SENSOR_TARGET_PERCENT)
    case = make_case(loaded, resolved, worker, options, sensors=table)
    with single_progress(case.label) as bars:
        bundle = render_case(worker, Question(case, target), progress=bars.update)
    write_sensors(output, bundle.sensors())
    typer.echo(f"{output}: {len(table.points)} sensors")

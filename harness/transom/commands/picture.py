"""`transom render`: one picture of one scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.choices import (
    Method,
    RendererName,
    Visibility,
    checked_output,
    checked_sun,
    chosen_condition,
    chosen_view,
)

SceneArgument = Annotated[str, typer.Argument(metavar="SCENE", help="Name of a scene, or the path of a scene folder.")]
TimeOption = Annotated[
    str | None, typer.Option(help="Civil standard time at the scene's site, such as 2026-03-21T10:00.")
]
SkyOption = Annotated[
    str | None, typer.Option(help="cie:1 .. cie:16, clear, overcast, uniform, perez:DNI,DHI [W/m²], or none.")
]
ConditionOption = Annotated[str | None, typer.Option(help="A condition of the scene; its first if omitted.")]
NoiseOption = Annotated[
    float | None,
    typer.Option(min=0.01, max=100.0, help="Mitsuba: mean relative standard error to reach [%]."),
]

GlazingOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="OPENING=GLAZING",
        help="Other glazing in an opening (may be repeated): none, clear:0.82, a product such as "
        "'prismatic_panel(angle_low=30)' (transom list products), or a BSDF file.",
    ),
]

SunOption = Annotated[
    str,
    typer.Option(
        metavar="FORM",
        help="Engine: the sun as a point; as sub-suns over its disc of 0.533 degrees: disc (19), or disc:7, 19, 37 ..; "
        "or auto: as few as penumbras indoors allow, a point behind plain windows, more behind louvres.",
    ),
]

DEFAULT_PICTURE_NOISE_PERCENT = 5.0


def render(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="FILE.exr (floats, all layers) or FILE.png.")],
    view: Annotated[str | None, typer.Option(help="A view of the scene; its first if omitted.")] = None,
    condition: ConditionOption = None,
    time: TimeOption = None,
    sky: SkyOption = None,
    renderer: Annotated[RendererName, typer.Option(help="Who renders.")] = RendererName.engine,
    visibility: Annotated[Visibility, typer.Option(help="How the engine finds the direct sun.")] = Visibility.volumes,
    method: Annotated[
        Method, typer.Option(help="How the engine finds light: gather, or classic (the published method).")
    ] = Method.gather,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Pixels; the view's own size if omitted.")] = None,
    noise: NoiseOption = None,
    glazing: GlazingOption = None,
    sun: SunOption = "point",
) -> None:
    """Render a picture: radiance in cd/m² (.exr), or toned on the view's fixed scale (.png).

    \b
    Example:  transom render desk_office --time 2026-06-21T12:00 --sky clear --size 640x480 -o office.exr
              transom render test_room --glazing south_upper=laser_cut_panel -o panel.png
              transom render partition_office --sun disc -o penumbras.png
    """
    from transom.bundle import make_case
    from transom.daylight.condition import resolve_condition
    from transom.fenestration.reglazing import load_glazed
    from transom.images import write_picture
    from transom.progress import single_progress
    from transom.renderer import load_renderer
    from transom.run import Question, Target, render_case

    checked_output(output, (".exr", ".png"))
    loaded = load_glazed(scene, glazing or [])
    chosen = chosen_view(loaded, view, size)
    resolved = resolve_condition(chosen_condition(loaded, condition, time, sky), loaded.site)
    worker = load_renderer(renderer.value)
    checked_sun(sun, renderer)
    is_engine = renderer is RendererName.engine
    options = {"visibility": visibility.value, "method": method.value, "sun": sun} if is_engine else {}
    target = None if is_engine else Target(noise or DEFAULT_PICTURE_NOISE_PERCENT)
    case = make_case(loaded, resolved, worker, options, view=chosen)
    with single_progress(case.label) as bars:
        bundle = render_case(worker, Question(case, target), progress=bars.update)
    write_picture(output, bundle.image(), chosen.display_white_cd_m2)
    typer.echo(f"{output}: {chosen.width}x{chosen.height}, white = {chosen.display_white_cd_m2:g} cd/m² in PNG")

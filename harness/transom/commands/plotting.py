"""`transom plot`: illuminance over hour and day, or over the parameters of a glazing product."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from transom.commands.choices import checked_output, chosen_condition
from transom.commands.picture import ConditionOption, GlazingOption, SceneArgument, SkyOption, TimeOption

DEFAULT_X = "day=15:349:8"
DEFAULT_Y = "hour=9:16:8"


def plot(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", help="FILE.png; FILE.csv is written beside it.")],
    x: Annotated[str, typer.Option(metavar="AXIS", help="NAME=FIRST:LAST:COUNT or NAME=A,B,C; across.")] = DEFAULT_X,
    y: Annotated[str, typer.Option(metavar="AXIS", help="The same; upwards.")] = DEFAULT_Y,
    glazing: GlazingOption = None,
    opening: Annotated[
        str | None, typer.Option(help="Whose product's parameters vary; the only one if omitted.")
    ] = None,
    condition: ConditionOption = None,
    time: TimeOption = None,
    sky: SkyOption = None,
) -> None:
    """Plot the illuminance of a scene's target sensors over two variables; green is light to read by, 200 to 2000 lx.

    A variable is hour (civil standard time), day (of the year), or a parameter of the product in an opening, such as
    the facet angles of a prismatic panel. What is not varied is the condition's. Prints the daylight autonomy: the
    share of cells in which every target has light to read by.

    \b
    Example:  transom plot desk_office -o year.png
              transom plot desk_office --glazing south_transom=prismatic_panel \\
                  --x angle_low=10:80:8 --y angle_high=10:80:8 --time 2026-06-21T12:00 -o angles.png
    """
    from transom.configuration import compute_plot, csv_file, csv_text, read_axis
    from transom.fenestration.reglazing import load_glazed
    from transom.figures_configuration import autonomy_words, configuration_png
    from transom.files import write_atomic
    from transom.progress import single_progress

    checked_output(output, (".png",))
    axes = read_axis(x, "--x"), read_axis(y, "--y")
    loaded = load_glazed(scene, glazing or [])
    spec = chosen_condition(loaded, condition, time, sky)
    with single_progress(f"{loaded.name} over {axes[0].name} and {axes[1].name}") as bars:
        found = compute_plot(loaded, spec, *axes, opening=opening, progress=bars.update)
    write_atomic(csv_file(output), csv_text(found))
    write_atomic(output, configuration_png(found))
    cells = len(axes[0].values) * len(axes[1].values)
    typer.echo(autonomy_words(found))
    typer.echo(
        f"{output} and {csv_file(output).name}: {cells} cells in {found.cells_s:.2f} s, solved in {found.solve_s:.1f} s"
    )

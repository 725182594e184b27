"""`transom lobes`: what the sun becomes behind a product, and how well lobes stand for light."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from transom.errors import InputError

if TYPE_CHECKING:
    from transom.fenestration.evaluation import ProductEvaluation

FIGURES = "represented", "moved", "room"

DEFAULT_OUTPUT = Path("build/lobes/evaluation.json")
"""Where the report looks for it."""


def lobes(
    products: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PRODUCT...]", help="As in scenes: a name, with parameters in brackets, or a file."),
    ] = None,
    sun: Annotated[
        str, typer.Option(metavar="ALT,AZ", help="Altitude, and azimuth from the panel's normal, degrees.")
    ] = "45,0",
    evaluate: Annotated[bool, typer.Option("--evaluate", help="Measure fractions and errors; all products.")] = False,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT.json", help="Of --evaluate: figures go beside it.")
    ] = DEFAULT_OUTPUT,
    rays: Annotated[int, typer.Option(help="Of the second tracer, for each sun.", min=64, max=65536)] = 1024,
    every: Annotated[int, typer.Option(help="Leave out each such incident direction in turn.", min=1)] = 3,
) -> None:
    """Say which beams the sun becomes behind a product, and what is left by bins; or evaluate lobes.

    --evaluate compares them with a second tracer: the fraction of light in k lobes of each width, the light that is put
    elsewhere between measured directions, and floor and desk illuminance under 24 suns and a clear sky. What is in the
    output is not measured again.

    \b
    Example:  transom lobes "prismatic_panel(angle_low=30)" --sun 45,20
              transom lobes --evaluate -o build/lobes/evaluation.json
    """
    if evaluate:
        _evaluate(products or [], output, rays, every)
        return
    if not products:
        raise InputError("is missing", field="PRODUCT", remedy="Name one (transom list products), or use --evaluate")
    for name in products:
        _show(name, sun)


def _show(name: str, sun: str) -> None:
    from transom.fenestration.load import load_fenestration
    from transom.fenestration.reglazing import named_product
    from transom.products.lobe_plot import SunDirection

    altitude, comma, azimuth = sun.partition(",")
    try:
        place = SunDirection(float(altitude), float(azimuth))
    except ValueError:
        raise InputError("is not ALT,AZ", field="--sun", value=sun, remedy="Such as --sun 45,-20") from None
    if not comma or not place.incident[2] > 0:
        raise InputError("is behind the panel", field="--sun", value=sun, remedy="Azimuths are within -90..90 degrees")
    fenestration = load_fenestration(named_product(name))
    through = fenestration.sun(place.incident)
    typer.echo(f"{name}: {100 * through.total:.2f} % of the light is transmitted")
    for lobe in through.lobes:
        x, y, _ = lobe.direction
        typer.echo(
            f"  lobe  {100 * lobe.share:6.2f} %  {math.degrees(math.asin(y)):+6.1f}° up  "
            f"{math.degrees(math.asin(x)):+6.1f}° right  {math.degrees(lobe.width_rad):4.1f}° wide"
        )
    lit = int((through.residual > 0).sum())
    typer.echo(f"  rest  {100 * float(through.residual.sum()):6.2f} %  in {lit} of {fenestration.basis.count} bins")


def _evaluate(products: list[str], output: Path, rays: int, every: int) -> None:
    from transom.commands.choices import checked_output
    from transom.fenestration.evaluation import ProductEvaluation, evaluate
    from transom.fenestration.lobe_figures import moved_figure, represented_figure, room_figure
    from transom.files import write_atomic
    from transom.products import list_products, load_product
    from transom.progress import single_progress

    if output == DEFAULT_OUTPUT:
        output.parent.mkdir(parents=True, exist_ok=True)
    checked_output(output, (".json",))
    names = products or list_products()
    chosen = [load_product(name) for name in names]
    kept = [ProductEvaluation.model_validate(item) for item in _kept(output)]
    found = {result.product: result for result in kept}
    for product in chosen:
        if product.name in found:
            continue
        with single_progress(product.name) as bars:
            found[product.name] = evaluate(product, rays, every, bars.update)
        ordered = [found[name].model_dump() for name in sorted(found)]
        write_atomic(output, json.dumps(ordered, indent=1).encode())
    results = [found[name] for name in sorted(found)]
    for result in results:
        typer.echo(_summary(result))
    for name, draw in zip(FIGURES, (represented_figure, moved_figure, room_figure), strict=True):
        write_atomic(output.with_name(f"{output.stem}_{name}.png"), draw(results))
    typer.echo(f"{output}: {len(results)} products; figures {', '.join(FIGURES)} beside it")


def _kept(output: Path) -> list[dict[str, object]]:
    if not output.is_file():
        return []
    try:
        content = json.loads(output.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(
            f"is not an evaluation ({error})", file=output, remedy="Remove it, or choose another"
        ) from None
    return list(content)


def _summary(result: ProductEvaluation) -> str:
    """One line of a product: room errors, median / p90; light moved between directions; energy."""
    pairs = [
        f"{words} {100 * errors.quantile(0.5):.2f}/{100 * errors.quantile(0.9):.2f} %"
        for words, errors in (("sun", result.traced), ("table", result.tabulated), ("sky", result.sky))
    ]
    moved = (
        f"{100 * result.moved_ours:.1f} % (rank {100 * result.moved_rank:.1f}, paper {100 * result.moved_paper:.1f})"
    )
    energy = f"{result.transmittance_mean_difference:+.1e} ± {result.transmittance_uncertainty:.1e}"
    return f"{result.product:24s} {'  '.join(pairs)}  moved {moved}  energy {energy}"

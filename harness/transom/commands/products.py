"""`transom bsdf` and `transom measure`: what a glazing product's file holds, and how a product scatters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from transom.errors import InputError

if TYPE_CHECKING:
    from transom.products import Product
    from transom.products.lobe_plot import SunDirection

SUN_RAYS = 1024
GRID_RAYS = 256

DEFAULT_SUNS = ("10,0", "25,0", "40,0", "60,0", "10,45", "25,45", "40,45", "60,45")


def bsdf(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="LBNL WINDOW XML, or pab-opto scans of one product."),
    ],
    export: Annotated[
        Path | None, typer.Option("--export", metavar="OUT.xml", help="Write it on the Klems full basis.")
    ] = None,
) -> None:
    """Say what a BSDF file holds and whether physics allows it; with --export, write it as Klems XML.

    Checks energy (no more light leaves than arrived), reciprocity (light turned round takes the same way), and that
    front and back agree. Exit code 1 when a check fails, 2 for a file that cannot be read.

    \b
    Example:  transom bsdf louvre.xml --export louvre_klems.xml
    """
    from transom.bsdf import read_bsdf
    from transom.bsdf.checks import check_bsdf
    from transom.bsdf.window_xml import write_klems_xml
    from transom.commands.choices import checked_output

    if export is not None:
        checked_output(export, (".xml",))
    product = read_bsdf(*files)
    typer.echo(f"{product.name}" + (f", {product.manufacturer}" if product.manufacturer else ""))
    for note in product.notes:
        typer.echo(f"  note: {note}")
    findings = check_bsdf(product)
    for finding in findings:
        word = "ok    " if finding.holds else "broken"
        typer.echo(f"  {word} {finding.check}, {finding.spectrum} {finding.path}: {finding.words}")
    if export is not None:
        write_klems_xml(export, product)
        typer.echo(f"{export}: Klems full basis, 145 x 145")
    if not all(finding.holds for finding in findings):
        raise typer.Exit(1)


def measure(
    product: Annotated[str, typer.Argument(metavar="PRODUCT", help="Name or folder: transom list products.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="OUT", help="Tables: .xml; with --directions: .npz or .csv."),
    ] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Another parameter (can be repeated).")
    ] = None,
    sun: Annotated[
        list[str] | None,
        typer.Option(metavar="ALT,AZ", help="Only light of this sun, in degrees (can be repeated)."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Picture of the lobes, of each --sun or of eight usual ones.")
    ] = None,
    directions: Annotated[
        float | None,
        typer.Option(metavar="STEP", help="Every exit of a grid of incident directions, STEP degrees apart."),
    ] = None,
    rays: Annotated[
        int | None,
        typer.Option(
            help="Rays of each direction, where curves or diffuse parts need them: 1024 of a sun, 256 of a grid; in "
            "tables 32, of unit cells 128, of diffuse products 2048.",
            min=16,
            max=65536,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the random numbers.", min=0)] = 1,
) -> None:
    """Measure a product by tracing light through it: a goniophotometer that needs no laboratory.

    Polarisation is followed inside; all light is accounted for. One of three things, from fast to slow:

    \b
      --sun ALT,AZ     where light of that sun goes: shares and strongest lobes, in milliseconds.
                       ALT above the horizon; AZ from the panel's normal, + to the right seen from the room
      --directions 6   every exit for a regular grid of incident directions, for interpolation
      neither          tables on the Klems full basis, both sides, with energy and reciprocity checked;
                       -o OUT.xml also writes OUT.uncertainty.npz, the standard error of each value

    \b
    Examples:
      transom measure prismatic_panel --set angle_low=30 -o prism.xml
      transom measure laser_cut_panel --sun 45,0 --sun 30,40 --plot lobes.png
      transom measure lumitop_like --directions 6 -o lumitop.npz
    """
    from transom.commands.choices import checked_output
    from transom.products import load_product

    if directions is not None and not 1 <= directions <= 45:
        raise InputError("is outside 1..45 degrees", field="--directions", value=directions)
    if directions is not None and output is None:
        raise InputError("needs a file to write", field="--directions", remedy="Add -o OUT.npz")
    if output is not None:
        checked_output(output, (".xml",) if directions is None else (".npz", ".csv"))
    if plot is not None:
        checked_output(plot, (".png",))
    chosen = load_product(product).with_parameters(dict(_numbers(changes or [])))
    typer.echo(f"{chosen.title} ({chosen.record.status})")
    typer.echo("  " + " ".join(chosen.record.uncertainty.split()))
    if sun or plot is not None:
        _show_suns(chosen, [_sun(text) for text in sun or DEFAULT_SUNS], plot, rays or SUN_RAYS, seed)
    if directions is not None and output is not None:
        _by_direction(chosen, directions, output, rays or GRID_RAYS, seed)
    elif output is not None or not (sun or plot):
        _tables(chosen, output, rays, seed)


def _show_suns(chosen: Product, suns: list[SunDirection], plot: Path | None, rays: int, seed: int) -> None:
    from transom.files import write_atomic
    from transom.products.lobe_plot import plot_lobes, strongest_lobes

    tracer = chosen.tracer()
    traced = [tracer.trace(sun.incident, rays, seed) for sun in suns]
    for sun, light in zip(suns, traced, strict=True):
        typer.echo(
            f"  sun {sun.altitude_deg:g}° high, {sun.azimuth_deg:+g}° aside: transmitted "
            f"{light.transmitted.total:.4f}, reflected {light.reflected.total:.4f}, absorbed {light.absorbed:.4f}"
        )
        for lobe in strongest_lobes(light.transmitted):
            x, y, z = lobe.direction
            typer.echo(
                f"    lobe with {100 * lobe.share:5.1f} % of it: {math.degrees(math.asin(y)):+6.1f}° up, "
                f"{math.degrees(math.atan2(x, z)):+6.1f}° to the right"
            )
    if plot is not None:
        write_atomic(plot, plot_lobes(chosen.title, suns, traced))
        typer.echo(f"{plot}: lobes of {len(suns)} suns")


def _by_direction(chosen: Product, step_deg: float, output: Path, rays: int, seed: int) -> None:
    from transom.products.by_direction import measure_by_direction, write_by_direction
    from transom.progress import single_progress

    with single_progress(chosen.name) as bars:
        found = measure_by_direction(chosen, step_deg, rays, seed, progress=bars.update)
    write_by_direction(output, found)
    typer.echo(f"{output}: {len(found.incident)} incident directions, {len(found.flux)} exits")


def _tables(chosen: Product, output: Path | None, rays: int | None, seed: int) -> None:
    from transom.bsdf.checks import check_bsdf
    from transom.bsdf.window_xml import write_klems_xml
    from transom.products.goniophotometer import measure as measured
    from transom.products.goniophotometer import write_uncertainty
    from transom.progress import single_progress

    with single_progress(chosen.name) as bars:
        result = measured(chosen, rays, seed=seed, progress=bars.update)
    for row, side in enumerate(("outdoors", "the room")):
        normal, error = result.transmittance[row, 0], result.standard_error[row, 0]
        typer.echo(f"  from {side}: transmittance near normal incidence {normal:.4f} +- {error:.4f}")
    typer.echo(f"  energy: 1 = transmitted + reflected + absorbed to {result.worst_balance:.1e} at every incidence")
    for finding in check_bsdf(result.bsdf):
        if finding.check != "energy":
            typer.echo(f"  {finding.check}: {finding.words}")
    if output is not None:
        beside = output.with_suffix(".uncertainty.npz")
        write_klems_xml(output, result.bsdf)
        write_uncertainty(beside, result)
        typer.echo(f"{output}: Klems full basis, 145 x 145\n{beside}: the standard error of each value")


def _sun(text: str) -> SunDirection:
    from transom.products.lobe_plot import SunDirection

    try:
        altitude, azimuth = (float(part) for part in text.split(","))
    except ValueError:
        altitude = azimuth = math.nan
    if not (-90 < altitude < 90 and -90 < azimuth < 90):
        remedy = "Write altitude,azimuth in degrees, such as --sun 45,-30; azimuth within 90 of the panel's normal"
        raise InputError("is not a sun before the panel", field="--sun", value=text, remedy=remedy)
    return SunDirection(altitude, azimuth)


def _numbers(changes: list[str]) -> Iterator[tuple[str, float]]:
    for change in changes:
        name, equals, text = change.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not equals or not math.isfinite(value):
            raise InputError("is not NAME=VALUE", field="--set", value=change, remedy="Such as --set angle_low=30")
        yield name.strip(), value

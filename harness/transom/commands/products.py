"""`transom bsdf` and `transom measure`: what a glazing product's file holds, and how a product scatters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from transom.errors import InputError


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
    product: Annotated[str, typer.Argument(metavar="PRODUCT", help="Name of a product: transom list products.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="OUT.xml", help="Write the tables as Klems XML.")
    ] = None,
    changes: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Another parameter (can be repeated).")
    ] = None,
    rays: Annotated[int, typer.Option(help="Rays over a period, for each direction.", min=16, max=65536)] = 256,
) -> None:
    """Measure a product by tracing light through its section: transmittance, energy, reciprocity; tables as Klems XML.

    Both sides, 145 bins each, eight directions in a bin, unpolarised light with its polarisation followed inside.

    \b
    Example:  transom measure prismatic_panel --set angle_low=30 -o prism.xml
    """
    from transom.bsdf.checks import check_bsdf
    from transom.bsdf.window_xml import write_klems_xml
    from transom.commands.choices import checked_output
    from transom.products import load_product
    from transom.products.goniophotometer import measure as measured
    from transom.progress import single_progress

    if output is not None:
        checked_output(output, (".xml",))
    chosen = load_product(product).with_parameters(dict(_numbers(changes or [])))
    with single_progress(chosen.name) as bars:
        result = measured(chosen, rays, progress=bars.update)
    typer.echo(f"{chosen.title} ({chosen.record.status})")
    typer.echo(f"  {chosen.record.uncertainty}")
    for row, side in enumerate(("outdoors", "the room")):
        normal, error = result.transmittance[row, 0], result.standard_error[row, 0]
        typer.echo(f"  from {side}: transmittance near normal incidence {normal:.4f} +- {error:.4f}")
    typer.echo(f"  energy: 1 = transmitted + reflected + absorbed to {result.worst_balance:.1e} at every incidence")
    for finding in check_bsdf(result.bsdf):
        if finding.check != "energy":
            typer.echo(f"  {finding.check}: {finding.words}")
    if output is not None:
        write_klems_xml(output, result.bsdf)
        typer.echo(f"{output}: Klems full basis, 145 x 145")


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

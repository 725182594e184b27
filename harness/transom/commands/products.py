"""`transom bsdf`: what a file of a glazing product holds, and whether physics allows it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


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

"""`transom referees`: references of rooms with glazing products against each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def referees(
    products: Annotated[list[str] | None, typer.Argument(metavar="[PRODUCT...]", help="Names; all without.")] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT.json", help="Comparisons; what is in it is kept.")
    ] = Path("build/referees.json"),
    table: Annotated[Path, typer.Option(metavar="TABLE.json", help="The same as a table of the report.")] = Path(
        "build/lobes/cfs_references.json"
    ),
    geometry: Annotated[bool, typer.Option("--geometry", help="Section tracers alone: seconds.")] = False,
    convergence: Annotated[
        str, typer.Option(metavar="PRODUCT", help="Measure error against paths for this product too.")
    ] = "",
) -> None:
    """Compare portals, Mitsuba's volpath and Radiance through one file, and the section tracer with particles.

    In the test room, with the product in its upper panes and the lower ones closed. Some minutes a product.

    \b
    Example:  transom referees prismatic_panel laser_cut_panel
    """
    from transom.product_referees import (
        measure_convergence,
        measure_microgeometry,
        measure_rooms,
        read_convergence,
        read_rows,
        write_rows,
        write_table,
    )
    from transom.products import list_products

    rows, points = read_rows(output), read_convergence(output)
    parts = [measure_microgeometry] if geometry else [measure_microgeometry, measure_rooms]
    for measured in parts:
        is_room = measured is measure_rooms
        there = {row.product for row in rows if (row.quantity == "illuminance") == is_room}
        for product in products or list_products():
            if product in there:
                continue
            typer.echo(f"{product}: {'rooms' if is_room else 'geometry'}")
            rows += measured(product)
            write_rows(output, rows, points)
            write_table(table, rows, str(output))
    if convergence:
        points = measure_convergence(convergence)
        write_rows(output, rows, points)

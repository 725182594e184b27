"""`transom list` and `transom doctor`: what there is, and whether it can run."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

GLAZING = (
    ("clear", "one pane of clear or tinted float glass, by its visible transmittance at normal incidence"),
    ("none", "an unglazed hole"),
)


class Kind(StrEnum):
    """What can be listed."""

    scenes = "scenes"
    views = "views"
    suites = "suites"
    products = "products"


def list_names(
    kind: Annotated[Kind, typer.Argument(metavar="scenes|views|suites|products", help="What to list.")],
    scene: Annotated[str | None, typer.Argument(metavar="[SCENE]", help="For views: only this scene's.")] = None,
) -> None:
    """List scenes, views (with conditions, regions and sensors), suites, or glazing products.

    \b
    Example:  transom list views partition_office
    """
    lines = {Kind.scenes: _scenes, Kind.suites: _suites, Kind.products: _products}
    for line in _views(scene) if kind is Kind.views else lines[kind]():
        typer.echo(line)


def doctor() -> None:
    """Versions, tools, processor, GL and LLVM back ends, and what to do about each thing that is wrong.

    \b
    Example:  transom doctor
    """
    from transom.doctor import print_report

    code = print_report()
    if code:
        raise typer.Exit(code)


def _scenes() -> list[str]:
    from transom.scene import list_scenes, load_scene

    return _aligned([(name, load_scene(name).title) for name in list_scenes()])


def _views(only: str | None) -> list[str]:
    from transom.scene import list_scenes, load_scene

    lines: list[str] = []
    for name in [only] if only else list_scenes():
        scene = load_scene(name)
        rows = [(f"view {view.name}", f"{view.width}x{view.height}") for view in scene.views]
        rows += [(f"condition {spec.name}", f"{spec.time}, sky {spec.sky}") for spec in scene.conditions]
        rows += [(f"region {region.name}", ", ".join(region.objects)) for region in scene.regions]
        rows += [(f"sensors {sensors.name}", f"{len(sensors.points)} points") for sensors in scene.sensors]
        lines += [scene.name, *(f"  {line}" for line in _aligned(rows))]
    return lines


def _suites() -> list[str]:
    from transom.suite import read_suites

    return _aligned([(name, suite.title) for name, suite in read_suites().items()])


def _products() -> list[str]:
    from transom.products import list_products, load_product

    records = [(name, load_product(name).record) for name in list_products()]
    return _aligned([*GLAZING, *((name, f"{record.description} [{record.status}]") for name, record in records)])


def _aligned(rows: list[tuple[str, str]]) -> list[str]:
    width = max((len(name) for name, _ in rows), default=0)
    return [f"{name:<{width}}  {text}".rstrip() for name, text in rows]

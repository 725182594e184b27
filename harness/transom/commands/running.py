"""`transom run`: renders a suite, or the published references."""

from __future__ import annotations

from typing import Annotated

import typer

REFERENCES = "references"


def run(
    suite: Annotated[str, typer.Argument(metavar="SUITE", help="Name of a suite, or `references`.")],
    only: Annotated[
        list[str] | None, typer.Option("--scene", help="Only cases of this scene (can be repeated).")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Render again what is already there.")] = False,
) -> None:
    """Render, compare and judge every case of a suite; resumable, and nothing is rendered twice.

    `transom run references` renders the published references of all suites into reference/store/: hours of work,
    done once; stopped and started again it goes on where it was.

    \b
    Example:  transom run rooms
    """
    from transom.references import run_references
    from transom.workflow import run_suite

    scenes = frozenset(only or ())
    if suite == REFERENCES:
        run_references(scenes, fresh=fresh)
        return
    code = run_suite(suite, scenes, fresh=fresh)
    if code:
        raise typer.Exit(code)

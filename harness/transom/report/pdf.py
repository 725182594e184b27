"""The report as PDF: the same tables and pictures, set by typst from reports/templates/report.typ."""

from __future__ import annotations

import io
import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import typst
from PIL import Image

from transom.errors import InputError
from transom.figures import DIFFERENCE_SCALE, NOISE_SCALE, scale_svg
from transom.files import write_atomic
from transom.report.content import REPRODUCE, Content
from transom.report.pictures import Picture
from transom.report.table import Table

TEMPLATE = Path(__file__).resolve().parents[3] / "reports" / "templates" / "report.typ"

JPEG_QUALITY = 92

MOST_ROWS = 160
"""Rows of one table that are printed; longer ones are for reading by machines, and are whole in the other formats."""

NOT_PRINTED = ("verdicts", "matrix")
"""Printed by sections of their own: the matrix in colours, and of the list of verdicts what did not pass."""


def write_pdf(path: Path, content: Content) -> None:
    """Writes the PDF. Raises InputError where the template is missing or refuses the content."""
    if not TEMPLATE.is_file():
        raise InputError("does not exist", file=TEMPLATE, remedy="Run the report from a checkout of the project")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "report.typ").write_bytes(TEMPLATE.read_bytes())
        record = _record(content, folder)
        (folder / "report.json").write_text(json.dumps(record, ensure_ascii=False), encoding="utf-8")
        try:
            document = typst.compile(
                folder / "report.typ", root=folder, timestamp=int(content.results.created.timestamp())
            )
        except typst.TypstError as error:
            raise InputError(f"cannot be set ({error})", file=TEMPLATE) from error
    if not isinstance(document, bytes):
        raise InputError("gave no single document", file=TEMPLATE)
    write_atomic(path, document)


def _record(content: Content, folder: Path) -> dict[str, Any]:
    """What the template prints; pictures are files in `folder`."""
    tables = content.tables
    every_room = [*content.pictures.rooms, *content.pictures.fenestration.rooms]
    groups = {view.group for room in every_room for view in room.views}
    return {
        "created": f"{content.results.created:%-d %B %Y}",
        "reproduce": REPRODUCE,
        "headline": [asdict(figure) for figure in content.headline],
        "counts": [{"name": name.replace("_", " "), "count": count} for name, count in content.verdict_counts],
        "absent": [asdict(part) for part in content.absent],
        "matrix": asdict(content.matrix),
        "open": _table(_open(tables["verdicts"])),
        "tables": {name: _table(table) for name, table in tables.items() if name not in NOT_PRINTED},
        "regions": {group: _table(tables["regions"].part(group)) for group in sorted(groups)},
        "rooms": [
            {
                "title": room.title,
                "description": room.description,
                "views": [
                    {
                        "title": view.title,
                        "condition": view.condition,
                        "group": view.group,
                        "source": view.viewer.source if view.viewer else "",
                        "pictures": [_picture(picture, folder) for picture in (view.viewer or view).pictures],
                    }
                    for view in room.views
                ],
            }
            for room in content.pictures.rooms
        ],
        "scales": {
            "difference": _drawing(_standalone(scale_svg(DIFFERENCE_SCALE)), "difference", folder),
            "noise": _drawing(_standalone(scale_svg(NOISE_SCALE)), "noise", folder),
        },
        "drawings": {
            name: {
                "file": _drawing(entry.svg, f"drawing-{name}", folder),
                "caption": entry.caption,
                "source": entry.source,
            }
            for name, entry in content.drawings.items()
        },
        "day": [_picture(frame, folder) for frame in (content.pictures.day.frames if content.pictures.day else [])],
        "figure_13": [
            {
                "title": strip.title,
                "white": strip.white,
                "pictures": [_picture(item, folder) for item in strip.pictures],
            }
            for strip in content.pictures.figure_13
        ],
        "products": [
            {"title": room.title, "condition": view.condition, "group": view.group, "source": view.viewer.source}
            for room in content.pictures.fenestration.rooms
            for view in room.views
            if view.viewer
        ],
        "plots": [
            _picture(plot, folder)
            for plot in (
                *(plot for _, plot in content.pictures.fenestration.plots),
                *content.pictures.fenestration.lobes,
            )
            if plot
        ],
        "galleries": [
            {
                "title": gallery.title,
                "condition": gallery.condition,
                "white": gallery.white,
                "pictures": [
                    _picture(item, folder) for cell in gallery.cells for item in (cell.ours, cell.reference) if item
                ],
            }
            for gallery in content.pictures.fenestration.galleries
        ],
        "notes": [asdict(section) for section in content.notes],
        "provenance": [{"name": name, "text": text} for name, text in content.provenance],
    }


def _table(table: Table) -> dict[str, Any]:
    rows = [
        {
            "group": row.group,
            "source": row.source,
            "cells": [{"text": cell.text, "kind": cell.kind, "number": cell.value is not None} for cell in row.cells],
        }
        for row in table.rows[:MOST_ROWS]
    ]
    head = list(table.head)
    title = table.title
    if len(table.rows) > MOST_ROWS:
        title += f" (the first {MOST_ROWS} of {len(table.rows)}; all are in tables/{table.name}.csv)"
    return {"name": table.name, "title": title, "head": head, "rows": rows, "command": table.command}


def _open(verdicts: Table) -> Table:
    """The verdicts that are not PASS; the list is sorted worst first."""
    passed = [index for index, row in enumerate(verdicts.rows) if row.tags.startswith("PASS|")]
    return verdicts.first_rows(passed[0] if passed else len(verdicts.rows))


def _picture(picture: Picture, folder: Path) -> dict[str, Any]:
    """Writes a picture as the PDF holds it (toned ones as JPEG, maps without loss) and says where it is."""
    suffix = "png" if picture.scale else "jpg"
    name = f"picture-{len(list(folder.glob('picture-*')))}.{suffix}"
    Image.open(io.BytesIO(picture.content)).save(folder / name, quality=JPEG_QUALITY)
    return {"file": name, "caption": picture.caption, "source": picture.source}


def _drawing(svg: str, name: str, folder: Path) -> str:
    (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
    return f"{name}.svg"


def _standalone(svg: str) -> str:
    """The page's scale outside of the page: with a namespace, a size and a font of its own."""
    return svg.replace(
        "<svg ", '<svg xmlns="http://www.w3.org/2000/svg" font-size="8.5" font-family="DejaVu Sans" fill="#615d55" ', 1
    )

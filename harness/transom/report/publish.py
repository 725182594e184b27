"""Publishing: what of a finished report becomes part of the repository, in reports/published/."""

from __future__ import annotations

import shutil
from pathlib import Path

from transom.errors import InputError
from transom.files import write_atomic

PUBLISHED = Path(__file__).resolve().parents[3] / "reports" / "published"

FILES = ("report.pdf", "results.json", "junit.xml", "index.html")

LARGEST_BYTES = 32_000_000
"""Of a published report: it stays in the repository's history for ever."""


def publish(report: Path, folder: Path | None = None) -> list[Path]:
    """Copies a report's files to `folder`, in place of what was there; gives their paths.

    Raises InputError for a report that is not whole, or too large to be kept.
    """
    folder = folder or PUBLISHED
    sources = [report / name for name in FILES] + sorted((report / "tables").glob("*.csv"))
    for source in sources:
        if not source.is_file():
            raise InputError("does not exist", file=source, remedy="Write the report first: transom report")
    size = sum(source.stat().st_size for source in sources)
    if size > LARGEST_BYTES:
        raise InputError(
            f"is too large to be published: {size / 1e6:.1f} MB of {LARGEST_BYTES / 1e6:.0f} MB",
            file=report,
            remedy="Report fewer views, or smaller ones, in scenes/suites.toml",
        )
    shutil.rmtree(folder / "tables", ignore_errors=True)
    written = [folder / source.relative_to(report) for source in sources]
    for source, target in zip(sources, written, strict=True):
        write_atomic(target, source.read_bytes())
    return written

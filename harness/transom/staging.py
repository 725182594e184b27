"""Replacing the files of a folder as one, so that a crash at any moment leaves either the old answer or the new one.

New files are written into a folder of their own (`.stage-*`), which is then renamed to `.next`: from this moment on the
new answer counts. What is left to do, moving its files over the old ones with the record last, anybody can finish:
`settle` does, for every reader and writer, however often, and also when two processes do so at once.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from transom.files import ASIDE_SUFFIX, storage_error

RECORD = "run.json"
NEXT = ".next"
STAGE = ".stage-"


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """An empty folder to write new files into, RECORD among them; on leaving, they replace those of `folder` as one.

    Left by an exception, everything is as it was. Raises StorageError when the disk is full or read-only.
    """
    stage = folder / f"{STAGE}{os.getpid()}-{secrets.token_hex(4)}"
    try:
        try:
            stage.mkdir(parents=True)
        except OSError as error:
            raise storage_error(stage, error) from error
        yield stage
        settle(folder)
        try:
            stage.rename(folder / NEXT)
        except OSError as error:
            raise storage_error(folder / NEXT, error) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    settle(folder)


def settle(folder: Path) -> None:
    """Finishes a replacement that was begun, if there is one: moves the files, the record last."""
    ready = folder / NEXT
    try:
        names = os.listdir(ready)  # noqa: PTH208
    except (FileNotFoundError, NotADirectoryError):
        return
    for name in sorted(names, key=lambda name: (name == RECORD, name)):
        # Another process may be doing the same: a file that is gone has been moved already.
        with suppress(FileNotFoundError):
            (ready / name).replace(folder / name)
    shutil.rmtree(ready, ignore_errors=True)


def sweep(folder: Path) -> None:
    """Removes what killed processes left behind. Only for the one who has claimed the case."""
    with suppress(OSError):
        for path in folder.glob(f"{STAGE}*"):
            shutil.rmtree(path, ignore_errors=True)
        for path in [*folder.glob(f".*{ASIDE_SUFFIX}"), *folder.glob(f"batches/.*{ASIDE_SUFFIX}")]:
            path.unlink(missing_ok=True)

"""Writing files so that nobody ever sees half of one, and saying what to do when a disk does not take them."""

from __future__ import annotations

import errno
import json
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any

from transom.errors import StorageError

ASIDE_SUFFIX = ".tmp"
"""Files are written under such a name first; one that is left over is of a process that was killed."""

FULL = frozenset({errno.ENOSPC, errno.EDQUOT})
READ_ONLY = frozenset({errno.EROFS, errno.EACCES, errno.EPERM})


def write_atomic(path: Path, content: bytes | str) -> None:
    """Writes a file aside, then renames it: a reader sees the old file or the whole new one. Makes its folder.

    Raises StorageError when the disk is full or read-only; the old file is then as it was.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}{ASIDE_SUFFIX}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with aside.open("wb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
            stream.flush()
            os.fsync(stream.fileno())
        aside.replace(path)
    except OSError as error:
        raise storage_error(path, error) from error
    finally:
        with suppress(OSError):
            aside.unlink(missing_ok=True)


def storage_error(path: Path, error: OSError) -> StorageError:
    """What a file system's refusal to write `path` means, and what to do."""
    if error.errno in FULL:
        return StorageError(
            "cannot be written: the disk is full",
            file=path,
            remedy="Free some space, or choose a folder on another disk (TRANSOM_CACHE for renderings), and run the "
            "same command again: what is finished is kept",
        )
    if error.errno in READ_ONLY:
        return StorageError(
            "cannot be written: it is read-only here",
            file=path,
            remedy="Make the folder writable, or choose another one (TRANSOM_CACHE for renderings, TRANSOM_REFERENCES "
            "for references)",
        )
    return StorageError(f"cannot be written ({error.strerror or error})", file=path)


def require_writable(folder: Path) -> None:
    """Raises StorageError if files cannot be made in `folder` (or, while it does not exist, in what would hold it)."""
    place = folder
    while not place.exists() and place != place.parent:
        place = place.parent
    if not os.access(place, os.W_OK | os.X_OK):
        raise storage_error(folder, OSError(errno.EROFS, os.strerror(errno.EROFS)))


def json_text(value: Any) -> str:
    """JSON for people and for diffs: indented, keys as given, NaN refused (ValueError)."""
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

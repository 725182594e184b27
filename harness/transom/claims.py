"""Claims: which process works on which case. A claim is a lock on a file, and the system drops it with its process.

<cache>/.claims/<key>.lock            held while a case is rendered; says by whom, for people
<cache>/.claims/queue-<process>.json  held while a suite is run: the keys that it will come to
"""

from __future__ import annotations

import fcntl
import json
import os
import secrets
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from transom.errors import StorageError
from transom.files import storage_error

FOLDER = ".claims"


class CaseBusyError(Exception):
    """Another process is rendering the case."""


@dataclass(frozen=True)
class Holder:
    """Who holds a claim: the process, when it took it (UTC, ISO 8601), and its command."""

    pid: int
    since: str
    command: str


def running_command() -> str:
    """The command of this process, as somebody would type it."""
    program = Path(sys.argv[0]).name if sys.argv and sys.argv[0] else "python"
    return shlex.join([program, *sys.argv[1:]])


@contextmanager
def claimed(root: Path, key: str, *, wait: bool = True) -> Iterator[None]:
    """Holds the claim on a case. root: the cache. wait: until whoever has it is done; else raises CaseBusyError.

    Raises StorageError where the cache cannot be written or its file system has no locks.
    """
    path = root / FOLDER / f"{key}.lock"
    handle = _lock(path, wait)
    try:
        holder = Holder(os.getpid(), datetime.now(UTC).isoformat(timespec="seconds"), running_command())
        with suppress(OSError):  # for people alone: a full disk shows itself where it matters
            os.ftruncate(handle, 0)
            os.pwrite(handle, json.dumps(asdict(holder)).encode(), 0)
        yield
    finally:
        # Removed while still held; whoever waits notices that its file is gone, and makes a new one.
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def holder(root: Path, key: str) -> Holder | None:
    """Who is rendering a case now, or None."""
    text = _text_if_locked(root / FOLDER / f"{key}.lock")
    if text is None:
        return None
    try:
        return Holder(**json.loads(text))
    except (ValueError, TypeError):
        return Holder(0, "", "")  # between taking the lock and writing the name


@contextmanager
def announced(root: Path, keys: Iterable[str]) -> Iterator[None]:
    """Says, for `queued`, that this process will come to these cases."""
    path = root / FOLDER / f"queue-{os.getpid()}-{secrets.token_hex(4)}.json"
    handle = _lock(path, wait=True)
    try:
        with suppress(OSError):
            os.pwrite(handle, json.dumps(sorted(set(keys))).encode(), 0)
        yield
    finally:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        os.close(handle)


def queued(root: Path) -> frozenset[str]:
    """Keys of all cases that some process will come to."""
    found: set[str] = set()
    for path in (root / FOLDER).glob("queue-*.json"):
        text = _text_if_locked(path)
        if text is None:
            with suppress(OSError):  # its process was killed
                path.unlink(missing_ok=True)
            continue
        with suppress(ValueError):
            found.update(json.loads(text))
    return frozenset(found)


def _lock(path: Path, wait: bool) -> int:
    """An open, locked file, which is still the one at `path`."""
    mode = fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as error:
            raise storage_error(path, error) from error
        try:
            fcntl.flock(handle, mode)
        except BlockingIOError as error:
            os.close(handle)
            raise CaseBusyError(path.stem) from error
        except OSError as error:
            os.close(handle)
            remedy = "Point TRANSOM_CACHE at a folder on a local disk"
            raise StorageError(f"cannot be locked ({error.strerror})", file=path, remedy=remedy) from error
        except BaseException:
            os.close(handle)
            raise
        if _is_at(path, handle):
            return handle
        os.close(handle)


def _is_at(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(handle))
    except FileNotFoundError:
        return False


def _text_if_locked(path: Path) -> str | None:
    try:
        with path.open("rb") as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return stream.read().decode(errors="replace")
    except OSError:
        pass
    return None

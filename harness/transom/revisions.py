"""Other revisions of this project: checked out beside this one, built, and timed in processes of their own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from transom.errors import InputError

PROJECT = Path(__file__).resolve().parents[2]
WORKER = Path(__file__).with_name("bench_worker.py")

LOG_LINES = 15
"""Of a failed build, so many of its last lines are shown."""

PRESENT = "the working tree"


@dataclass(frozen=True)
class Source:
    """Sources to build. name: for people. folder: their root. commit: of a revision, or None for the working tree."""

    name: str
    folder: Path
    commit: str | None


@dataclass(frozen=True)
class Build:
    """A built source: what a worker imports. engine_folder: of the compiled module."""

    source: Source
    engine_folder: Path


@contextmanager
def workshop() -> Iterator[Path]:
    """A temporary folder for checkouts and builds, removed at the end with the worktrees in it."""
    folder = Path(tempfile.mkdtemp(prefix="transom-bench-"))
    try:
        yield folder
    finally:
        for checkout in (folder / "source").glob("*"):
            _git("worktree", "remove", "--force", str(checkout), check=False)
        shutil.rmtree(folder, ignore_errors=True)


def resolve_revision(revision: str, field: str) -> str:
    """The full hash of a revision. Raises InputError for a folder without git history or an unknown revision."""
    if _git("rev-parse", "--git-dir", check=False).returncode != 0:
        remedy = "Clone the project with git, or time one build alone with `transom bench SCENE`"
        raise InputError("needs a git repository, and this project is not in one", field=field, remedy=remedy)
    found = _git("rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}", check=False)
    if found.returncode != 0:
        remedy = "Name a commit, branch or tag: git log --oneline"
        raise InputError("is not a revision of this repository", field=field, value=revision, remedy=remedy)
    return found.stdout.strip()


def check_out(revision: str | None, folder: Path, field: str = "--against") -> Source:
    """The sources of a revision in a git worktree under `folder`; for None the working tree as it is."""
    if revision is None:
        return Source(PRESENT, PROJECT, None)
    commit = resolve_revision(revision, field)
    place = folder / "source" / commit[:12]
    if not place.is_dir():
        place.parent.mkdir(parents=True, exist_ok=True)
        done = _git("worktree", "add", "--detach", str(place), commit, check=False)
        if done.returncode != 0:
            raise InputError(f"cannot be checked out: {_last_line(done.stderr)}", field=field, value=revision)
    return Source(f"{revision} ({commit[:12]})", place, commit)


def build(source: Source, folder: Path) -> Build:
    """Builds the engine of a source from nothing into `folder`. Raises InputError with the log's last lines."""
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "build.log"
    configure = ["cmake", "-S", str(source.folder), "-B", str(folder), "-G", "Ninja"]
    settings = {
        "CMAKE_BUILD_TYPE": "Release",
        "TRANSOM_INPLACE": "OFF",
        "TRANSOM_TESTS": "OFF",
        "TRANSOM_BENCHMARKS": "OFF",
        "Python_EXECUTABLE": sys.executable,
    }
    configure += [f"-D{name}={value}" for name, value in settings.items()]
    for command in (configure, ["cmake", "--build", str(folder), "--target", "_engine"]):
        with log.open("a", encoding="utf-8") as stream:
            try:
                status = subprocess.run(command, stdout=stream, stderr=subprocess.STDOUT).returncode
            except FileNotFoundError as error:
                raise InputError(
                    "was not found", field=command[0], remedy="Run `make setup`, which installs it"
                ) from error
        if status != 0:
            lines = log.read_text(encoding="utf-8", errors="replace").splitlines()[-LOG_LINES:]
            ending = "".join(f"\n  {line}" for line in lines)
            raise InputError(f"does not build; its log ends:{ending}", field=source.name)
    return Build(source, folder / "python" / "transom")


def present_build() -> Build:
    """The working tree with the engine as it is built already."""
    return Build(Source(PRESENT, PROJECT, None), PROJECT / "harness" / "transom")


class Worker:
    """A process that times one build; see bench_worker.py for what it is told and what it answers."""

    def __init__(self, built: Build, setup: dict[str, Any], log: Path) -> None:
        self.name = built.source.name
        self._log_path = log
        root = built.source.folder
        libraries = dict.fromkeys(sysconfig.get_paths()[kind] for kind in ("purelib", "platlib"))
        paths = [str(root / "harness"), str(root / "reference"), *libraries]
        setup = {**setup, "paths": paths, "engine_folder": str(built.engine_folder)}
        self._log = log.open("ab")
        # -I -S: neither the user's folders nor an editable install of this checkout come in between.
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(WORKER), json.dumps(setup)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            text=True,
            env={**os.environ, "PYTHONHASHSEED": "0"},
        )

    def ready(self) -> dict[str, Any]:
        """Waits until the scene is solved; what the build says of it."""
        return self._read()

    def times(self, request: Sequence[tuple[str, int]]) -> dict[str, float]:
        """Seconds by quantity and phase."""
        if self._process.stdin is None:
            raise RuntimeError("the worker was started without a pipe")
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # reading says why
        return self._read()

    def close(self) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._log.close()

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self) -> dict[str, Any]:
        line = self._process.stdout.readline() if self._process.stdout is not None else ""
        if not line:
            text = self._log_path.read_text(encoding="utf-8", errors="replace")
            raise InputError(f"cannot be timed: {_last_line(text) or 'its process ended'}", field=self.name)
        found: dict[str, Any] = json.loads(line)
        return found


def _git(*arguments: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    command = ["git", "-C", str(PROJECT), *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=check)
    except FileNotFoundError as error:
        raise InputError("was not found", field="git", remedy="Install git") from error


def _last_line(text: str) -> str:
    return next((line for line in reversed(text.splitlines()) if line.strip()), "")

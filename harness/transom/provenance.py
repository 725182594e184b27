"""Where a number comes from: versions, machine and source revision. Holds no path and no name of a person or host."""

from __future__ import annotations

import os
import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

from pydantic import BaseModel, ConfigDict

PACKAGES = ("transom", "numpy", "scipy", "mitsuba", "drjit", "pvlib", "colour-science", "OpenEXR", "trimesh")


class Provenance(BaseModel):
    """What produced a result. memory_gib: of the machine. commit: of the source tree, with "+" if it was modified."""

    model_config = ConfigDict(frozen=True)

    python: str
    packages: dict[str, str]
    system: str
    processor: str
    logical_cores: int
    memory_gib: float
    commit: str | None = None


@cache
def current_provenance() -> Provenance:
    """This process's machine, package versions and source revision."""
    return Provenance(
        python=platform.python_version(),
        packages={name: version for name in PACKAGES if (version := _version(name))},
        system=f"{platform.system()} {platform.machine()}, {_distribution()}",
        processor=_processor(),
        logical_cores=os.cpu_count() or 1,
        memory_gib=round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30, 1),
        commit=_commit(),
    )


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def _distribution() -> str:
    try:
        return platform.freedesktop_os_release().get("PRETTY_NAME", "unknown")
    except OSError:
        return "unknown"


def _commit() -> str | None:
    """The revision of the repository that holds this package, or None outside one."""
    folder = Path(__file__).resolve().parents[2]
    try:
        revision = _git(folder, "rev-parse", "--short=12", "HEAD")
        changed = _git(folder, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return None
    return revision + ("+" if changed else "")


def _git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=20).stdout.strip()

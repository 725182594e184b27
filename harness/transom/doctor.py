"""What the set-up looks like, and what to do about each thing that is wrong: the `transom doctor` command."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata, util
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.table import Table

State = Literal["ok", "warn", "fail"]

RADIANCE_PROGRAMS = ("oconv", "rtrace", "rpict", "rcontrib", "gensky", "gendaylit", "gendaymtx")
PACKAGES = ("numpy", "scipy", "pvlib", "colour-science", "trimesh", "OpenEXR", "OpenImageIO", "pydantic", "plotly")
SIMD_FEATURES = ("sse4_2", "avx", "avx2", "fma", "avx512f")
SETUP = "Run `make setup`"
PROBE_TIMEOUT_S = 120


@dataclass(frozen=True)
class Check:
    """One thing that was looked at. state: ok; warn (some things will not work, or are untested); fail (unusable)."""

    name: str
    state: State
    found: str
    remedy: str = ""


def diagnose() -> list[Check]:
    """Looks at everything that Transom needs, in the order in which it is needed. Raises nothing."""
    return [
        _system(),
        _processor(),
        _memory(),
        _python(),
        _packages(),
        _tool("C++ compiler", os.environ.get("CXX", "c++"), (10, 0)),
        _tool("CMake", "cmake", (3, 25)),
        _tool("Ninja", "ninja", (1, 10)),
        _engine(),
        _gl(),
        *_mitsuba(),
        _radiance(),
        _scenes(),
        _references(),
    ]


def print_report() -> int:
    """Prints the table of checks and what to do. Returns 1 if anything failed, else 0."""
    console = Console(highlight=False)
    checks = diagnose()
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("", "What", "Found"):
        table.add_column(heading, overflow="fold")
    colours = {"ok": "green", "warn": "yellow", "fail": "red"}
    for check in checks:
        table.add_row(f"[{colours[check.state]}]{check.state}[/]", check.name, check.found)
    console.print(table)
    wrong = [check for check in checks if check.state != "ok"]
    if wrong:
        console.print("\n[bold]What to do[/]")
        for check in wrong:
            console.print(f"  {check.name}: {check.remedy}", soft_wrap=True)
    failed = sum(check.state == "fail" for check in checks)
    console.print(f"\n{len(checks) - len(wrong)} ok, {len(wrong) - failed} to know about, {failed} to repair")
    return 1 if failed else 0


def _system() -> Check:
    try:
        name = platform.freedesktop_os_release().get("PRETTY_NAME", "unknown")
    except OSError:
        name = "unknown"
    found = f"{name}, {platform.system()} {platform.release()}, {platform.machine()}"
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return Check("System", "warn", found, "Only Linux on x86-64 is tested")
    return Check("System", "ok", found)


def _processor() -> Check:
    model, features = "unknown", set[str]()
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    for line in lines:
        key, _, value = line.partition(":")
        if key.strip() == "model name":
            model = value.strip()
        elif key.strip() == "flags":
            features = set(value.split())
            break
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    simd = " ".join(feature for feature in SIMD_FEATURES if feature in features)
    found = f"{model}, {os.cpu_count()} logical cores ({usable} usable here), {simd or 'no SIMD features known'}"
    if features and "avx2" not in features:
        return Check("Processor", "warn", found, "Without AVX2 the engine works, but slower, and this is untested")
    return Check("Processor", "ok", found)


def _memory() -> Check:
    gib = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30
    found = f"{gib:.1f} GiB"
    if gib < 4:
        return Check("Memory", "warn", found, "References of the larger rooms want 4 GiB")
    return Check("Memory", "ok", found)


def _python() -> Check:
    found = f"{platform.python_version()}{'' if sys.prefix != sys.base_prefix else ', not in a virtual environment'}"
    if sys.version_info < (3, 11):  # noqa: UP036  a wrong Python is what this looks for
        return Check("Python", "fail", found, "Python 3.11 or newer is needed: install one, and set PYTHON to it")
    if sys.version_info >= (3, 12):
        return Check("Python", "warn", found, "The lock file has packages for this version, but only 3.11 is tested")
    return Check("Python", "ok", found)


def _packages() -> Check:
    found, missing = [], []
    for name in PACKAGES:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            missing.append(name)
    if missing:
        return Check("Python packages", "fail", f"missing: {', '.join(missing)}", SETUP)
    return Check("Python packages", "ok", ", ".join(found))


def _tool(name: str, program: str, oldest: tuple[int, int]) -> Check:
    """A program of the build: its version, which must be at least `oldest`."""
    wanted = ".".join(map(str, oldest))
    path = shutil.which(program)
    if path is None:
        return Check(name, "fail", f"no {program}", f"Install it ({wanted} or newer), for example with `make setup`")
    lines = _output([path, "--version"]).splitlines() or ["unknown version"]
    version = re.search(r"(\d+)\.(\d+)", re.sub(r"\([^)]*\)", "", lines[0]))
    if version is not None and (int(version[1]), int(version[2])) < oldest:
        return Check(name, "fail", lines[0], f"{wanted} or newer is needed")
    return Check(name, "ok", lines[0] if name in lines[0] or "C++" in name else f"{name} {lines[0]}")


def _engine() -> Check:
    if util.find_spec("transom._engine") is None:
        return Check("Engine", "fail", "not built", SETUP)
    facts = _probe(
        "import json, transom._engine as e\n"
        "print(json.dumps({'build': e.build_description() if hasattr(e, 'build_description') else 'built'}))"
    )
    if isinstance(facts, str):
        return Check("Engine", "fail", f"does not load: {facts}", "Run `make clean setup`: was it built elsewhere?")
    return Check("Engine", "ok", facts["build"])


def _gl() -> Check:
    name = "OpenGL without a screen"
    facts = _probe("import json, transom._engine as e\nprint(json.dumps({'name': e.gl_backend()}))")
    if isinstance(facts, str):
        return Check(name, "warn", facts, "Shadow volumes will not work; `--visibility rays` does. " + _install("GL"))
    return Check(name, "ok", facts["name"])


def _mitsuba() -> list[Check]:
    """LLVM and Mitsuba, tried in a process of their own: an unsuitable LLVM aborts the process that uses it."""
    facts = _probe(
        "import json, os\n"
        "from transom_reference.mitsuba_setup import VARIANT, dr, mi\n"
        "total = float(dr.sum(dr.minimum(dr.arange(mi.Float, 16), 3))[0])\n"
        "print(json.dumps({'mitsuba': mi.__version__, 'drjit': dr.__version__, 'variant': VARIANT,\n"
        "                  'llvm': os.environ.get('DRJIT_LIBLLVM_PATH', 'as Dr.Jit found it'), 'total': total}))"
    )
    if isinstance(facts, str):
        remedy = _install("LLVM") + " Or set DRJIT_LIBLLVM_PATH to a libLLVM of version 17 or newer."
        return [Check("Mitsuba", "warn", facts, "The engine works without; new references cannot be made. " + remedy)]
    versions = f"{facts['mitsuba']}, Dr.Jit {facts['drjit']}, variant {facts['variant']}"
    if facts["total"] != 42:
        return [
            Check("Mitsuba", "fail", f"{versions}: min(0..15, 3) sums to {facts['total']}, not 42", _install("LLVM"))
        ]
    llvm = Check("LLVM", "ok", facts["llvm"])
    if "19" not in Path(facts["llvm"]).name:
        llvm = Check("LLVM", "warn", facts["llvm"], "Only LLVM 19 is tested. " + _install("LLVM"))
    return [llvm, Check("Mitsuba", "ok", versions)]


def _radiance() -> Check:
    spec = util.find_spec("pyradiance")
    if spec is None or spec.origin is None:
        return Check(
            "Radiance", "warn", "pyradiance is not installed", f"Checks against Radiance are left out. {SETUP}"
        )
    folder = Path(spec.origin).parent
    missing = [program for program in RADIANCE_PROGRAMS if not (folder / "bin" / program).exists()]
    calculations = (folder / "lib" / "rayinit.cal").exists()
    if missing or not calculations:
        found = f"pyradiance {metadata.version('pyradiance')} without {', '.join(missing) or 'its lib folder'}"
        return Check("Radiance", "warn", found, f"Checks against Radiance are left out. {SETUP}")
    version = _output([str(folder / "bin" / "rtrace"), "-version"], {"RAYPATH": str(folder / "lib")}).strip()
    found = f"pyradiance {metadata.version('pyradiance')}, {version or 'version unknown'}"
    raypath = os.environ.get("RAYPATH")
    if raypath and str(folder / "lib") not in raypath.split(os.pathsep):
        remedy = f"It hides the files of the programs used here: unset it, or add {folder / 'lib'}"
        return Check("Radiance", "warn", f"{found}; RAYPATH is set to {raypath}", remedy)
    return Check("Radiance", "ok", f"{found}; RAYPATH {'is right' if raypath else 'is set at each run'}")


def _scenes() -> Check:
    from transom.errors import InputError
    from transom.scene import list_scenes

    try:
        names = list_scenes()
    except InputError as error:
        return Check("Scenes", "fail", str(error), "Work inside the project, or set TRANSOM_SCENES")
    if not names:
        return Check("Scenes", "fail", "none", "Set TRANSOM_SCENES to the folder of scenes")
    return Check("Scenes", "ok", f"{len(names)}: {', '.join(names)}")


def _references() -> Check:
    from transom.bundle import repository_store

    count = len(list(repository_store().root.glob("*/run.json")))
    if count == 0:
        return Check("Reference store", "fail", "empty", "`make references` renders them, which takes hours")
    return Check("Reference store", "ok", f"{count} references")


def _install(what: Literal["GL", "LLVM"]) -> str:
    """The line that installs a missing library on Debian or Ubuntu."""
    packages = {"GL": "libegl1 libgl1-mesa-dri (and libosmesa6 where it exists)", "LLVM": "libllvm19"}
    return f"Install {packages[what]}; `make setup` does."


def _output(command: list[str], variables: Mapping[str, str] | None = None) -> str:
    """What a program prints, or nothing if it cannot be run. variables: added to the environment."""
    environment = {**os.environ, **(variables or {})}
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False, env=environment)
        return run.stdout
    except (OSError, subprocess.TimeoutExpired):
        return ""


def _probe(code: str) -> dict[str, Any] | str:
    """Runs Python code in a process of its own. Gives the JSON object that it prints last, or how it failed."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-c", code]
    try:
        run = subprocess.run(
            command, capture_output=True, text=True, timeout=PROBE_TIMEOUT_S, check=False, env=environment
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    if run.returncode != 0:
        lines = [line for line in run.stderr.splitlines() if line.strip()]
        ended = f"signal {-run.returncode}" if run.returncode < 0 else f"exit code {run.returncode}"
        return lines[-1] if lines else ended
    facts: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return facts

"""The dependency rules of ARCHITECTURE.md, read off the sources: who may import, include, decide and compute what."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import jinja2
import jinja2.nodes
import pytest

ROOT = Path(__file__).parents[2]
HARNESS = ROOT / "harness" / "transom"
REFERENCE = ROOT / "reference" / "transom_reference"
ENGINE = ROOT / "engine"

TOP_LEVEL = {
    ".ci",
    ".clang-format",
    ".clang-tidy",
    ".gitattributes",
    ".github",
    ".gitignore",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "CMakeLists.txt",
    "CMakePresets.json",
    "CONTRIBUTING.md",
    "DECISIONS.md",
    "GLOSSARY.md",
    "LICENSE",
    "Makefile",
    "README.md",
    "btdf_measurements",
    "engine",
    "harness",
    "pyproject.toml",
    "reference",
    "reports",
    "requirements.in",
    "requirements.lock",
    "scenes",
    "tests",
    "tools",
}

REFERENCE_MAY_IMPORT = (
    *("bsdf", "bundle", "colour", "daylight", "errors", "fenestration", "glass", "products", "renderer", "scene"),
)
"""Modules of transom that references share with the engine's side: one scene, one sky, one glass, one product."""

ENGINE_MAY_INCLUDE = {
    *(
        "algorithm",
        "array",
        "atomic",
        "bit",
        "cassert",
        "chrono",
        "cmath",
        "concepts",
        "condition_variable",
        "cstddef",
        "cstdint",
        "cstdio",
        "cstdlib",
    ),
    *("cstring", "exception", "functional", "initializer_list", "iomanip", "iterator", "limits", "map", "memory"),
    *("mutex", "new", "numbers", "numeric", "optional", "queue", "ranges", "set", "span", "sstream", "stdexcept"),
    *("string", "string_view", "thread", "tuple", "type_traits", "unordered_map", "unordered_set", "utility"),
    *("variant", "vector", "dlfcn.h", "immintrin.h", "pmmintrin.h", "xmmintrin.h", "sanitizer/tsan_interface.h"),
}
ENGINE_MAY_INCLUDE_UNDER = ("Eigen/", "embree3/", "embree4/", "glad/", "glm/", "oneapi/tbb/", "tbb/")
"""With the standard headers above, all that the engine may know: no files, no Python, no calendar."""

VERDICTS = {"PASS", "FAIL", "INCONCLUSIVE", "NO_REFERENCE", "CRASHED"}

TEMPLATES_MAY_NOT_FILTER = {"sum", "round", "int", "float", "abs", "max", "min", "sort"}
COMPUTING_NODES = (
    jinja2.nodes.Add,
    jinja2.nodes.Sub,
    jinja2.nodes.Mul,
    jinja2.nodes.Div,
    jinja2.nodes.FloorDiv,
    jinja2.nodes.Mod,
    jinja2.nodes.Pow,
    jinja2.nodes.Neg,
)

MACHINE_PATH = re.compile(r"(?<![\w.~/-])/(?:home|root|work|Users|mnt|tmp/[a-z_]+)/[\w.-]")
MAXIMUM_LINES = 450


def python_files(*folders: Path) -> list[Path]:
    return sorted(file for folder in folders for file in folder.rglob("*.py"))


def cpp_files() -> list[Path]:
    """The engine's own sources and headers: not the bindings, and not what a generator wrote."""
    files = [file for suffix in ("*.h", "*.cpp") for file in ENGINE.rglob(suffix)]
    return sorted(file for file in files if "bindings" not in file.parts and "gl" not in file.parts)


def tracked_files() -> list[Path]:
    """Files that are, or would be, in the repository. Skips the test outside of one."""
    command = ["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    try:
        listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listing.split("\0") if name and (ROOT / name).is_file()]


def imports(file: Path) -> Iterator[str]:
    """Full names of all modules that a file imports anywhere, also inside functions."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}:{node.lineno}: imports are absolute"
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def names(files: list[Path]) -> list[str]:
    return [str(file.relative_to(ROOT)) for file in files]


def test_harness_never_imports_a_reference_renderer() -> None:
    forbidden = {"mitsuba", "drjit", "pyradiance", "transom_reference"}
    found = [file for file in python_files(HARNESS) if any(name.split(".")[0] in forbidden for name in imports(file))]
    assert names(found) == []


def test_reference_imports_only_the_shared_modules_of_the_harness() -> None:
    allowed = tuple(f"transom.{module}" for module in REFERENCE_MAY_IMPORT)
    found = [
        f"{file.relative_to(ROOT)} imports {name}"
        for file in python_files(REFERENCE)
        for name in imports(file)
        if name.split(".")[0] == "transom"
        and not any(name == module or name.startswith(f"{module}.") for module in allowed)
    ]
    assert found == []


def test_only_the_engine_modules_import_the_compiled_module() -> None:
    of_products = {"section.py", "unit_cell.py"}
    allowed = {"engine.py", "engine_renderer.py", "engine_scene.py"} | of_products
    found = [
        file
        for file in python_files(HARNESS, REFERENCE)
        if file.name not in allowed and any(name.startswith("transom._engine") for name in imports(file))
    ]
    assert names(found) == []


def test_engine_includes_no_file_format_no_calendar_and_no_python() -> None:
    include = re.compile(r'^\s*#\s*include\s+([<"])([^>"]+)[>"]', re.MULTILINE)
    found = []
    for file in cpp_files():
        for bracket, header in include.findall(file.read_text(encoding="utf-8")):
            if bracket == '"':
                known = (ENGINE / "include" / header).exists() or (file.parent / header).exists()
            else:
                known = header in ENGINE_MAY_INCLUDE or header.startswith(ENGINE_MAY_INCLUDE_UNDER)
                known = known or ("bench" in file.parts and header == "benchmark/benchmark.h")
            if not known:
                found.append(f"{file.relative_to(ROOT)} includes {header}")
    opens = re.compile(r"\b(?:fopen|open|popen|system|[io]?fstream)\s*[({<]")
    found += [f"{name} opens a file" for name in names([f for f in cpp_files() if opens.search(f.read_text("utf-8"))])]
    assert found == []


def test_headers_are_listed_in_an_order_in_which_they_can_be_read() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    table = text.partition("| header | idea |")[2].partition("\n\n")[0]
    row_of = {
        name: row
        for row, line in enumerate(table.splitlines())
        for name in re.findall(r"`(\w+\.h)`", line.partition(" | ")[0])
    }
    headers = {file.name: file for file in (ENGINE / "include" / "transom").glob("*.h")}
    assert sorted(row_of) == sorted(headers)
    for name, file in headers.items():
        for needed in re.findall(r'#include "transom/(\w+\.h)"', file.read_text(encoding="utf-8")):
            assert row_of[needed] <= row_of[name], f"{name} needs {needed}, which comes after it"


def test_only_judge_decides() -> None:
    """Elsewhere a verdict may be compared with, be the key of a table, or say why there is nothing to judge."""
    found = []
    for file in python_files(HARNESS):
        if file.name == "judge.py":
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        harmless: set[ast.AST] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare):
                harmless.update(ast.walk(node))
            elif isinstance(node, ast.Dict):
                harmless.update(key for key in node.keys if key is not None)
            elif isinstance(node, ast.Subscript):
                harmless.update(ast.walk(node.slice))
            elif isinstance(node, ast.Call) and ast.unparse(node.func) == "Missing":
                harmless.update(node.args)
        for node in ast.walk(tree):
            is_verdict = (
                isinstance(node, ast.Attribute) and node.attr in VERDICTS and ast.unparse(node.value) == "Outcome"
            )
            is_name = isinstance(node, ast.Constant) and node.value in VERDICTS
            is_made = isinstance(node, ast.Call) and ast.unparse(node.func) == "Outcome"
            if (is_verdict or is_name or is_made) and node not in harmless:
                found.append(f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)} {ast.unparse(node)}")
    assert found == []


def test_templates_format_and_never_compute() -> None:
    environment = jinja2.Environment(autoescape=True)
    found = []
    for folder in (ROOT / "reports", HARNESS / "report"):
        for file in sorted(folder.rglob("*.html*")):
            if "published" in file.parts or "baselines" in file.parts:
                continue
            tree = environment.parse(file.read_text(encoding="utf-8"))
            place = file.relative_to(ROOT)
            found += [f"{place}:{node.lineno} computes" for node in tree.find_all(COMPUTING_NODES)]
            found += [
                f"{place}:{node.lineno} filters with {node.name}"
                for node in tree.find_all(jinja2.nodes.Filter)
                if node.name in TEMPLATES_MAY_NOT_FILTER
            ]
    assert found == []


def test_top_level_is_fixed() -> None:
    assert {file.relative_to(ROOT).parts[0] for file in tracked_files()} - TOP_LEVEL == set()


def test_no_file_names_a_place_on_somebodys_machine() -> None:
    found = []
    for file in tracked_files():
        if file == Path(__file__) or file.suffix in {".exr", ".png", ".npz", ".glb", ".lock", ".obj"}:
            continue
        try:
            text = file.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        found += [f"{file.relative_to(ROOT)}: {match.group()}" for match in MACHINE_PATH.finditer(text)]
    assert found == []


def test_python_files_open_with_one_sentence_and_stay_readable() -> None:
    silent, long = [], []
    for file in python_files(HARNESS, REFERENCE, ROOT / "tests", ROOT / "scenes", ROOT / "tools"):
        text = file.read_text(encoding="utf-8")
        if text.strip() and ast.get_docstring(ast.parse(text)) is None:
            silent.append(file)
        if len(text.splitlines()) > MAXIMUM_LINES:
            long.append(file)
    assert names(silent) == []
    assert names(long) == []


def test_headers_open_with_one_sentence_and_files_stay_readable() -> None:
    files = cpp_files()
    silent = [file for file in files if file.suffix == ".h" and not file.read_text(encoding="utf-8").startswith("//")]
    long = [file for file in files if len(file.read_text(encoding="utf-8").splitlines()) > MAXIMUM_LINES]
    assert names(silent) == []
    assert names(long) == []


def test_nothing_is_left_to_do_in_the_sources() -> None:
    marks = re.compile(r"\b(?:" + "|".join(("TO" + "DO", "FIX" + "ME", "XX" + "X")) + r")\b")
    files = python_files(HARNESS, REFERENCE, ROOT / "tests") + cpp_files()
    assert names([file for file in files if marks.search(file.read_text(encoding="utf-8"))]) == []

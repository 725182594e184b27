"""Mitsuba and Dr.Jit, ready for use: import `mi` and `dr` from here and nowhere else.

Importing this module finds a libLLVM that Dr.Jit can use (LLVM 14 to 16 abort on processors with AVX-512),
selects the variant and limits the threads. Environment: DRJIT_LIBLLVM_PATH (the library, when set nothing is
searched), TRANSOM_REFERENCE_THREADS (default 2).
"""

from __future__ import annotations

import ctypes.util
import os
from pathlib import Path
from typing import Any

import numpy as np

VARIANT = "llvm_ad_rgb"
LLVM_VERSIONS = (19, 20, 21, 18, 17)
"""Major versions that work with Dr.Jit 1.5, in order of preference."""

LIBRARY_FOLDERS = (
    Path("/usr/lib/x86_64-linux-gnu"),
    Path("/usr/lib/aarch64-linux-gnu"),
    Path("/usr/lib64"),
    Path("/usr/lib"),
    Path("/usr/local/lib"),
)


def find_llvm() -> str | None:
    """Path of the libLLVM to load, or None when no suitable version is installed."""
    for version in LLVM_VERSIONS:
        names = (f"libLLVM.so.{version}.1", f"libLLVM-{version}.so", f"libLLVM-{version}.so.1")
        folders = (*LIBRARY_FOLDERS, Path(f"/usr/lib/llvm-{version}/lib"))
        for path in (folder / name for folder in folders for name in names):
            if path.exists():
                return str(path)
        found = ctypes.util.find_library(f"LLVM-{version}")
        if found is not None:
            return found
    return None


def _thread_count() -> int:
    return max(1, int(os.environ.get("TRANSOM_REFERENCE_THREADS", "2")))


if "DRJIT_LIBLLVM_PATH" not in os.environ and (_library := find_llvm()) is not None:
    os.environ["DRJIT_LIBLLVM_PATH"] = _library

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

mi.set_variant(VARIANT)
dr.set_thread_count(_thread_count())


def floats(array: Any) -> Any:
    """A Dr.Jit array of float32 in memory of its own.

    A plain conversion borrows NumPy's memory, whose alignment goes into the compiled kernel: it would be compiled
    again for every array that happens to lie elsewhere.
    """
    borrowed = mi.Float(np.ascontiguousarray(array, dtype=np.float32).ravel())
    owned = dr.empty(mi.Float, dr.width(borrowed))
    dr.scatter(owned, borrowed, dr.arange(mi.UInt32, dr.width(borrowed)))
    dr.eval(owned)
    return owned


def points(array: Any) -> list[Any]:
    """Three Dr.Jit arrays of float32 from rows (N, 3): the arguments of mi.Point3f and its like."""
    return [floats(array[:, column]) for column in range(3)]


__all__ = ["LLVM_VERSIONS", "VARIANT", "dr", "find_llvm", "floats", "mi", "points"]

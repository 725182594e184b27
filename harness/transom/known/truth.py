"""Closed forms belong to the references, which the harness loads by name."""

from __future__ import annotations

import importlib
from typing import Any


def analytic(module: str) -> Any:
    """A module of closed forms: "analytic", "analytic_sky", "analytic_openings" or "analytic_sphere"."""
    return importlib.import_module(f"transom_reference.{module}")

"""Scenes whose answer is known: the engine's luminances and illuminances beside closed forms."""

from __future__ import annotations

from transom.comparison import AnalyticComparison
from transom.suite import Suite


def compare_known_answers(suite: Suite) -> tuple[AnalyticComparison, ...]:
    """Every known quantity of the suite's scenes."""
    return ()

"""The suite of hard cases: every claim about them tried, and what was seen."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from rich.console import Console

from transom.comparison import COMPARISON_FORMAT, Comparison, HardCase
from transom.errors import InputError
from transom.hard.camera_cases import camera_cases
from transom.hard.claims import Case, Claim, Seen
from transom.hard.disc_cases import disc_cases
from transom.hard.limit_cases import limit_cases
from transom.hard.rooms import without_folder
from transom.hard.shape_cases import shape_cases
from transom.hard.sun_cases import sun_cases
from transom.hard.table_cases import table_cases
from transom.progress import CaseProgress
from transom.suite import Suite

GROUPS: dict[str, Callable[[], list[Case]]] = {
    "sun": lambda: [*sun_cases(), *disc_cases()],
    "shape": shape_cases,
    "camera": camera_cases,
    "limit": limit_cases,
    "table": table_cases,
}


def compare_hard_cases(suite: Suite) -> Comparison:
    """A row for every claim of the suite's groups. Raises InputError for a group that there is not."""
    cases = list(chosen_cases(suite))
    rows: list[HardCase] = []
    with CaseProgress(len(cases), Console(stderr=True)) as bars:
        for case in cases:
            bars.begin(case.name)
            tried = [try_claim(case, claim) for claim in case.claims]
            broken = sum(not row.holds for row in tried)
            bars.finish(f"{len(tried)} claims" + (f", {broken} broken" if broken else " hold"))
            rows += tried
    return Comparison(COMPARISON_FORMAT, suite.name, suite.title, hard_cases=tuple(rows))


def chosen_cases(suite: Suite) -> Iterator[Case]:
    for group in suite.known:
        if group not in GROUPS:
            remedy = f"Choose from {', '.join(GROUPS)}"
            raise InputError(
                "is no group of hard cases", field=f"suites.{suite.name}.known", value=group, remedy=remedy
            )
        yield from GROUPS[group]()


def try_claim(case: Case, claim: Claim) -> HardCase:
    """Whether a claim holds. One that cannot be tried is broken, and its error is what was seen."""
    started = time.perf_counter()
    try:
        seen = claim.check()
    except Exception as error:
        seen = Seen(False, f"{type(error).__name__}: {' '.join(str(error).split())}")
    seconds = round(time.perf_counter() - started, 3)
    text = without_folder(seen.text)
    return HardCase(case.name, case.group, claim.name, claim.expectation, seen.holds, text, seconds)

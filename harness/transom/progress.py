"""Progress of long work on the terminal: what is being done, how much is left, and for how long."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import TimeRemainingColumn as TimeRemaining

LEAST_LINE_SECONDS = 20.0
"""Where the output is no terminal, a line is printed at most this often."""


class CaseProgress:
    """Two bars: all cases, and the work of the current one. On no terminal: a line now and then."""

    def __init__(self, total_cases: int, console: Console) -> None:
        self.console = console
        self.done_cases, self.total_cases = 0, total_cases
        self._last_line = -LEAST_LINE_SECONDS
        self._label = ""
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemaining(compact=False),
        )
        self._bars = Progress(*columns, console=console, disable=not console.is_terminal, speed_estimate_period=600)
        self._all: TaskID = self._bars.add_task("all cases", total=total_cases)
        self._case: TaskID | None = None

    def begin(self, label: str) -> None:
        """A case begins."""
        self._label = label
        if self._case is not None:
            self._bars.remove_task(self._case)
        self._case = self._bars.add_task(label, total=None)

    def update(self, done: int, total: int) -> None:
        """Progress of the current case in units of equal work; `total` may grow while a reference learns its noise."""
        share = min(done / total, 1.0) if total else 0.0
        if self._case is not None:
            self._bars.update(self._case, completed=done, total=total)
        self._bars.update(self._all, completed=self.done_cases + share)
        self._print_line(f"{self._label}: {done} of {total}")

    def finish(self, note: str) -> None:
        """The current case is done; `note` says with what result."""
        self.done_cases += 1
        self._bars.update(self._all, completed=self.done_cases)
        self._print(f"{self._label}  {note}")

    def _print_line(self, text: str) -> None:
        now = self._bars.get_time()
        if not self.console.is_terminal and now - self._last_line >= LEAST_LINE_SECONDS:
            self._last_line = now
            self._print(text)

    def _print(self, text: str) -> None:
        self.console.print(
            f"[{self.done_cases}/{self.total_cases}] {text}", highlight=False, markup=False, soft_wrap=True
        )

    def __enter__(self) -> CaseProgress:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()


@contextmanager
def single_progress(label: str) -> Iterator[CaseProgress]:
    """Progress of one case, on standard error, so that it mixes with no output."""
    with CaseProgress(1, Console(stderr=True)) as bars:
        bars.begin(label)
        yield bars

"""Progress of long work on the terminal: what is being done, how much is left, and for how long."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn

LEAST_LINE_SECONDS = 20.0
"""Where the output is no terminal, a line is printed at most this often."""

SPEED_WINDOW_SECONDS = 900.0
"""Remaining time is told from the speed over so long: cases found finished must not count as fast ones for ever."""


class CaseProgress:
    """Two bars: all cases, and the work of the current one. On no terminal: a line now and then.

    total_weight: work of all cases in any unit; `begin` says how much of it a case is.
    """

    def __init__(self, total_cases: int, console: Console, total_weight: float | None = None) -> None:
        self.console = console
        self.done_cases, self.total_cases = 0, total_cases
        self._done_weight, self._total_weight = 0.0, float(total_weight or total_cases)
        self._weight, self._label = 1.0, ""
        self._history: deque[tuple[float, float]] = deque([(time.monotonic(), 0.0)])
        self._last_line = time.monotonic() - LEAST_LINE_SECONDS
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
        )
        self._bars = Progress(*columns, console=console, disable=not console.is_terminal)
        self._all: TaskID = self._bars.add_task(f"0 of {total_cases} cases", total=self._total_weight, left="")
        self._case: TaskID | None = None

    def extend(self, cases: int) -> None:
        """So many more cases have turned up, each of weight 1."""
        self.total_cases += cases
        self._total_weight += cases
        self._bars.update(self._all, total=self._total_weight)

    def begin(self, label: str, weight: float = 1.0) -> None:
        """A case begins, which is `weight` of all the work."""
        self._label, self._weight = label, weight
        if self._case is not None:
            self._bars.remove_task(self._case)
        self._case = self._bars.add_task(label, total=None, left="")

    def update(self, done: int, total: int) -> None:
        """Progress of the current case in units of equal work; `total` may grow while a reference learns its noise."""
        share = min(done / total, 1.0) if total else 0.0
        if self._case is not None:
            self._bars.update(self._case, completed=done, total=total)
        self._show(self._done_weight + share * self._weight)
        self._print_line(f"{self._label}: {done} of {total}{self._left_words(', ')}")

    def finish(self, note: str) -> None:
        """The current case is done; `note` says with what result."""
        self.done_cases += 1
        self._done_weight += self._weight
        self._show(self._done_weight)
        self._print(f"{self._label}  {note}")

    def remaining_seconds(self) -> float | None:
        """Time left by the speed of the last minutes, or None before anything was done."""
        (begin, first), (end, last) = self._history[0], self._history[-1]
        if end <= begin or last <= first:
            return None
        return (self._total_weight - last) * (end - begin) / (last - first)

    def _show(self, weight: float) -> None:
        now = time.monotonic()
        self._history.append((now, weight))
        while len(self._history) > 2 and now - self._history[0][0] > SPEED_WINDOW_SECONDS:
            self._history.popleft()
        words = f"{self.done_cases} of {self.total_cases} cases"
        self._bars.update(self._all, completed=weight, description=words, left=self._left_words(""))

    def _left_words(self, before: str) -> str:
        seconds = self.remaining_seconds()
        return "" if seconds is None else f"{before}{duration_words(seconds)} left"

    def _print_line(self, text: str) -> None:
        now = time.monotonic()
        if not self.console.is_terminal and now - self._last_line >= LEAST_LINE_SECONDS:
            self._last_line = now
            self._print(text)

    def _print(self, text: str) -> None:
        line = f"[{self.done_cases}/{self.total_cases}] {text}"
        self.console.print(line, highlight=False, markup=False, soft_wrap=True)

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


def duration_words(seconds: float) -> str:
    """A time as people say it: 40 s, 12 min, 3 h 20 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"

"""The summary of a check as Markdown, fit for a pull request: what failed, by how much, and what shows it again."""

from __future__ import annotations

import math
from collections.abc import Sequence

from transom.baseline import Drift
from transom.check import Checked, outcome_counts
from transom.diagnosis import diagnose
from transom.judge import Outcome, Verdict

HEADINGS = {0: "passed", 1: "failed", 2: "wrong use", 3: "undecided", 4: "not answered"}

SHOWN_ROWS = 12
"""So many verdicts against references are listed; the others are counted."""

UNITS = {"percent": "%", "mm": "mm", "claims": ""}


def summary(checked: Sequence[Checked], exit_code: int) -> str:
    """Markdown of some checks, what did not pass first."""
    lines = [f"# transom check: {HEADINGS[exit_code]} (exit code {exit_code})", ""]
    lines += ["| suite | against | " + " | ".join(Outcome) + " |", "|---|---|" + "---:|" * len(Outcome)]
    for entry in checked:
        for side, verdicts in (("references", entry.verdicts), ("baseline", entry.baseline_verdicts)):
            counts = outcome_counts(verdicts)
            lines.append(f"| {entry.suite} | {side} | " + " | ".join(str(counts[kind]) for kind in Outcome) + " |")
    for entry in checked:
        lines += ["", *_baseline_lines(entry), *_reference_lines(entry), *_missing_lines(entry)]
    lines += ["", *_reproduce_lines(checked)]
    return "\n".join(lines).rstrip() + "\n"


def failed_drifts(entry: Checked) -> list[Drift]:
    """The judged drifts that did not pass."""
    return [row for row, verdict in _pairs(entry) if verdict.outcome != Outcome.PASS]


def diagnoses(entry: Checked) -> list[str]:
    """What the drifts of a check point to."""
    return diagnose(failed_drifts(entry), entry.drifts)


def _pairs(entry: Checked) -> list[tuple[Drift, Verdict]]:
    return list(zip(entry.drifts, entry.baseline_verdicts, strict=False))


def _baseline_lines(entry: Checked) -> list[str]:
    """By category the largest drift that did not pass, and what all of them point to."""
    worst: dict[str, tuple[float, Drift, Verdict]] = {}
    count: dict[str, int] = {}
    for row, verdict in _pairs(entry):
        if verdict.outcome == Outcome.PASS:
            continue
        size = abs(row.difference) / (verdict.tolerance or 1.0) if math.isfinite(row.difference) else math.inf
        count[row.category] = count.get(row.category, 0) + 1
        if row.category not in worst or size > worst[row.category][0]:
            worst[row.category] = (size, row, verdict)
    if not worst:
        return [f"**{entry.suite}**: as blessed ({entry.blessed})."] if entry.blessed else []
    lines = [f"## {entry.suite}: drifted from its baseline ({entry.blessed})", ""]
    lines += [f"- {text}" for text in diagnoses(entry)]
    lines += ["", "| category | moved | where most | blessed | now | change | tolerance | seeds alone |"]
    lines += ["|---|---:|---|---:|---:|---:|---:|---:|"]
    for category, (_, row, verdict) in sorted(worst.items(), key=lambda item: -item[1][0]):
        unit = UNITS.get(row.quantity.rpartition("_")[2], "")
        change = f"{row.difference:+.3g} {unit}" if math.isfinite(row.difference) else "came or went"
        cells = [
            category,
            str(count[category]),
            f"{row.place} ({row.case})",
            _number(row.before),
            _number(row.now),
            change.strip(),
            f"{verdict.tolerance:g} {unit}".strip() if verdict.tolerance is not None else "",
            "" if row.spread_share is None else f"{row.spread_share:.1f} σ",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _reference_lines(entry: Checked) -> list[str]:
    order = list(reversed(Outcome))
    rows = [verdict for verdict in entry.verdicts if verdict.outcome != Outcome.PASS and verdict.quantity]
    if not rows:
        return []
    rows.sort(key=lambda verdict: order.index(verdict.outcome))
    lines = ["", f"## {entry.suite}: against its references", ""]
    lines += ["| verdict | quantity | where | difference | k u | b | tolerance |", "|---|---|---|---:|---:|---:|---:|"]
    for verdict in rows[:SHOWN_ROWS]:
        unit = UNITS.get(verdict.quantity.rpartition("_")[2], "")
        names = (verdict.scene, verdict.view, verdict.region, verdict.condition, verdict.method)
        place = " / ".join(name for name in names if name)
        numbers = (verdict.difference, verdict.expanded_uncertainty, verdict.numerical_bias, verdict.tolerance)
        cells = [str(verdict.outcome), verdict.quantity, place]
        cells += ["" if number is None else f"{number:.3g} {unit}".strip() for number in numbers]
        lines.append("| " + " | ".join(cells) + " |")
    if len(rows) > SHOWN_ROWS:
        lines.append(f"\nand {len(rows) - SHOWN_ROWS} more.")
    return lines


def _missing_lines(entry: Checked) -> list[str]:
    rows = [verdict for verdict in (*entry.verdicts, *entry.baseline_verdicts) if not verdict.quantity]
    if not rows:
        return []
    lines = ["", f"## {entry.suite}: without an answer", ""]
    for verdict in rows:
        names = (verdict.scene, verdict.view, verdict.condition, verdict.method)
        lines.append(f"- {verdict.outcome}: {' / '.join(name for name in names if name)}: {verdict.reason}")
    return lines


def _reproduce_lines(checked: Sequence[Checked]) -> list[str]:
    lines = ["Shown again by:", "", "```"]
    for entry in checked:
        seed = "" if entry.seed is None else f" --seed {entry.seed}"
        lines.append(f"make setup && .venv/bin/transom check --suite {entry.suite}{seed}")
    lines += ["```", ""]
    lines.append("New values that are meant are accepted, in a commit of their own, by ")
    lines[-1] += ", ".join(f"`transom bless {entry.suite} --reason ...`" for entry in checked) + "."
    seconds = sum(entry.seconds for entry in checked)
    return [*lines, "", f"{seconds:.0f} s."]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.5g}"

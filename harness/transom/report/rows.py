"""The report's tables: rows of text, ready to print."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from transom.judge import Outcome, Verdict
from transom.report.numbers import decimals_of, fixed, rounded, seconds, signed, words
from transom.timing import Timing

HEADLINE_METHOD = "volumes"
"""Errors are headlined for the paper's own way of finding shadows; the other way is in the complete table."""


@dataclass(frozen=True)
class Cell:
    """A table cell. kind: "" plain, "verdict" (its text is the verdict), "good" or "bad" for emphasis."""

    text: str
    kind: str = ""
    title: str = ""


@dataclass(frozen=True)
class TableRow:
    """Cells under the table's head. group: True for a line that names the rows below it."""

    cells: tuple[Cell, ...]
    group: bool = False


PAPER_TABLE_1 = (
    ("14a) entire image", 916.40, 861.35, 8.2),
    ("14a) desks only", 1858.06, 1748.75, 7.4),
    ("14b) entire image", 1414.77, 1320.76, 8.6),
    ("14b) area of interest", 946.51, 828.62, 8.8),
)
"""Table 1 of Cutler et al. 2008: average pixel luminance by Radiance and by HRSV [cd/m²], average error [%]."""

PAPER_RANGES_S: dict[str, tuple[float, float]] = {
    "solve": (10.0, 10.0),
    "relight": (1.0, 3.0),
    "frame_volumes": (1 / 30, 1 / 30),
    "plot_8x8": (60.0, 180.0),
}
"""Section 4.3.1 of the same, on a 2.13 GHz Core 2 Duo: "approximately 10 seconds", "1-3 seconds", "> 30 frames per
second" and "1-3 minutes"."""

TIMING_WORDS = {
    "solve": "Solve (geometry and reflectance)",
    "relight": "Relight (a new sun and sky)",
    "frame_volumes": "Frame, shadow volumes",
    "frame_rays": "Frame, shadow rays",
    "plot_8x8": "Plot of 8 x 8 moments",
    "peak_memory": "Peak memory",
}


def table_1(images: Iterable[Any]) -> list[TableRow]:
    """The paper's rows, then ours in the same columns with bias, reference noise and verdict."""
    rows = [_group("Cutler et al. 2008: Radiance, and HRSV")]
    for place, reference, ours, error in PAPER_TABLE_1:
        bias = 100 * (ours / reference - 1)
        plain = (fixed(reference, 2), fixed(ours, 2), fixed(error, 1), signed(bias, 1), "not given", "")
        rows.append(TableRow((Cell(place), *(Cell(text) for text in plain))))
    ours_rows = [row for row in images if row.method == HEADLINE_METHOD and row.region != "exterior"]
    for (scene, view, condition), entries in groupby(ours_rows, lambda row: (row.scene, row.view, row.condition)):
        rows.append(_group(f"{words(scene)}, {words(view).lower()}, {condition}: Mitsuba 3, and Transom"))
        rows += [TableRow((Cell(_region_words(row.region)), *_image_cells(row))) for row in entries]
    return rows


def region_rows(images: Iterable[Any]) -> list[TableRow]:
    """Every region of one view, by both visibility methods, with all error measures."""
    return [
        TableRow(
            (
                Cell(_region_words(row.region)),
                Cell(row.method),
                Cell(fixed(row.pixel_count, 0)),
                Cell(_mean(row.reference_mean_cd_m2, row.reference_mean_standard_error_cd_m2)),
                Cell(_mean(row.engine_mean_cd_m2, row.reference_mean_standard_error_cd_m2)),
                Cell(_error(row)),
                Cell(fixed(row.mean_relative_error_raw_percent, 2)),
                Cell(signed(row.bias_percent, 2)),
                Cell("below noise" if row.relative_rmse_percent is None else fixed(row.relative_rmse_percent, 2)),
                Cell(_several(row, "block_{}_percent", ("p50", "p95", "p99"), 1)),
                Cell(_several(row, "share_within_{}_percent", ("2", "5", "10"), 0)),
                Cell(fixed(row.reference_standard_error_percent, 2)),
                Cell(fixed(row.bias_numerical_percent, 2)),
                _worst([row.mean_relative_error_verdict, row.bias_verdict]),
            )
        )
        for row in images
    ]


def sensor_rows(sensors: Iterable[Any]) -> list[TableRow]:
    """One line a sensor set and condition: means, mean and worst error, the reference's noise."""
    rows: list[TableRow] = []
    last = ""
    for (_, scene, condition, name), entries in groupby(
        sensors, lambda row: (row.suite, row.scene, row.condition, row.set)
    ):
        group = list(entries)
        errors = np.array([row.error_percent for row in group])
        noise = float(np.mean([row.error_standard_error_percent for row in group]))
        worst = max(group, key=lambda row: abs(row.error_percent))
        heading = f"{words(scene)}, {condition}"
        if heading != last:
            rows.append(_group(heading))
            last = heading
        reference, ours = (
            float(np.mean([getattr(row, field) for row in group])) for field in ("reference_lx", "engine_lx")
        )
        uncertainty = float(np.mean([row.reference_standard_error_lx for row in group])) / max(len(group), 1) ** 0.5
        rows.append(
            TableRow(
                (
                    Cell(words(name)),
                    Cell(str(len(group))),
                    Cell(rounded(reference, uncertainty, 1)),
                    Cell(rounded(ours, uncertainty, 1)),
                    Cell(signed(100 * (ours / reference - 1) if reference else 0.0, 2)),
                    Cell(fixed(float(np.mean(np.abs(errors))), 2)),
                    Cell(signed(worst.error_percent, 2), title=f"at ({worst.x_m:g}, {worst.y_m:g}, {worst.z_m:g}) m"),
                    Cell(fixed(noise, 2)),
                    _worst([row.verdict for row in group]),
                )
            )
        )
    return rows


def timing_rows(timings: Iterable[Timing]) -> list[TableRow]:
    """Every timing: first, median and p95 of how many, beside the paper's."""
    rows: list[TableRow] = []
    for scene, entries in groupby(timings, lambda timing: timing.scene):
        group = list(entries)
        counts = f"{fixed(group[0].triangles, 0)} triangles, {fixed(group[0].patches, 0)} patches"
        rows.append(_group(f"{words(scene)}: {counts}"))
        for timing in group:
            if timing.unit == "s":
                values = [seconds(value) for value in (timing.first, timing.median, timing.p95)]
            else:
                values = ["", f"{fixed(timing.median, 0)} {timing.unit}", ""]
            label = TIMING_WORDS[timing.quantity] + (f", {timing.width}x{timing.height}" if timing.width else "")
            cells = (label, *values, str(timing.count), _paper_words(timing.quantity))
            rows.append(TableRow(tuple(Cell(text) for text in cells)))
    return rows


def analytic_rows(entries: Iterable[Any]) -> list[TableRow]:
    """Scenes with a known answer."""
    rows: list[TableRow] = []
    for scene, group in groupby(entries, lambda row: row.scene):
        rows.append(_group(words(scene)))
        for row in group:
            digits = decimals_of(row.truth_uncertainty or abs(row.truth) * 1e-5, 4)
            cells = (
                Cell(row.quantity, title=row.source),
                Cell(row.unit),
                Cell(fixed(row.truth, digits)),
                Cell(fixed(row.value, digits)),
                Cell(signed(row.error_percent, 3)),
                _worst([row.verdict]),
            )
            rows.append(TableRow(cells))
    return rows


def agreement_rows(entries: Iterable[Any]) -> list[TableRow]:
    """Shadow volumes against shadow rays."""
    return [
        TableRow(
            (
                Cell(words(row.scene)),
                Cell(row.view),
                Cell(row.condition),
                Cell(fixed(row.pixel_count, 0)),
                Cell(fixed(row.differing_count, 0)),
                Cell(fixed(row.differing_percent, 3)),
                Cell(fixed(row.away_from_edges_count, 0)),
                _worst([row.verdict]),
            )
        )
        for row in entries
    ]


def verdict_rows(verdicts: Sequence[Verdict]) -> list[TableRow]:
    """Everything that did not pass, worst first."""
    order = list(reversed(Outcome))
    rows = []
    for verdict in sorted(verdicts, key=lambda entry: order.index(entry.outcome)):
        if verdict.outcome is Outcome.PASS:
            continue
        place = (words(verdict.scene), verdict.view, verdict.region, verdict.condition, verdict.method)
        what = verdict.quantity.replace("_percent", "").replace("_", " ") or verdict.reason
        needed = "" if verdict.batches_needed is None else f"{fixed(verdict.batches_needed, 0)} batches would decide"
        cells = (
            Cell(verdict.outcome, "verdict"),
            Cell(what),
            Cell(", ".join(part for part in place if part)),
            Cell(signed(verdict.difference, 2) if verdict.difference is not None else ""),
            Cell(fixed(verdict.expanded_uncertainty, 2) if verdict.expanded_uncertainty is not None else ""),
            Cell(fixed(verdict.numerical_bias, 2) if verdict.numerical_bias is not None else ""),
            Cell(fixed(verdict.tolerance, 1) if verdict.tolerance is not None else ""),
            Cell(needed),
        )
        rows.append(TableRow(cells))
    return rows


def _image_cells(row: Any) -> tuple[Cell, ...]:
    return (
        Cell(_mean(row.reference_mean_cd_m2, row.reference_mean_standard_error_cd_m2)),
        Cell(_mean(row.engine_mean_cd_m2, row.reference_mean_standard_error_cd_m2)),
        Cell(_error(row), title=f"raw, against the noisy reference: {fixed(row.mean_relative_error_raw_percent, 2)} %"),
        Cell(signed(row.bias_percent, 2)),
        Cell(fixed(row.reference_standard_error_percent, 2)),
        _worst([row.mean_relative_error_verdict, row.bias_verdict]),
    )


def _error(row: Any) -> str:
    return rounded(row.mean_relative_error_percent, row.mean_relative_error_standard_error_percent, 2)


def _several(row: Any, field: str, names: Sequence[str], digits: int) -> str:
    return " / ".join(fixed(getattr(row, field.format(name)), digits) for name in names)


def _mean(value: float, uncertainty: float) -> str:
    return rounded(value, uncertainty, 2)


def _region_words(region: str) -> str:
    return "Entire image (interior)" if region == "interior" else words(region)


def _paper_words(quantity: str) -> str:
    return {
        "solve": "about 10 s",
        "relight": "1 to 3 s",
        "frame_volumes": "above 30 frames per second",
        "plot_8x8": "1 to 3 min",
    }.get(quantity, "")


def _worst(outcomes: Iterable[Outcome | None]) -> Cell:
    known = [outcome for outcome in outcomes if outcome is not None]
    if not known:
        return Cell("not judged", "muted")
    return Cell(max(known, key=list(Outcome).index), "verdict")


def _group(text: str) -> TableRow:
    return TableRow((Cell(text),), group=True)

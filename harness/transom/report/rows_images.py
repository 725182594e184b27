"""Tables of what was compared with the reference: Table 1, regions, sensors, and the two ways of finding shadows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from transom.comparison import reference_kind
from transom.judge import Outcome
from transom.report.numbers import fixed, words
from transom.report.table import Cell, Row, Table, known_number, number, signed_number, texts

HEADLINE_METHOD = "volumes"
"""Errors are headlined for the paper's own way of finding shadows; the other way is in the complete table."""

PAPER = "Cutler et al. 2008, Table 1"

PAPER_TABLE_1 = (
    ("14a) entire image", 916.40, 861.35, 8.2),
    ("14a) desks only", 1858.06, 1748.75, 7.4),
    ("14b) entire image", 1414.77, 1320.76, 8.6),
    ("14b) area of interest", 946.51, 828.62, 8.8),
)
"""Table 1 of Cutler et al. 2008: average pixel luminance by Radiance and by HRSV [cd/m²], average error [%]."""

OFTEN_RUN = "transom run rooms"


def table_1(images: Iterable[Any]) -> Table:
    """The paper's rows, then ours in the same columns with bias, reference noise and verdict."""
    rows = []
    for place, reference, ours, error in PAPER_TABLE_1:
        bias = 100 * (ours / reference - 1)
        cells = (Cell(place), number(reference, 2), number(ours, 2), number(error, 1), signed_number(bias, 1))
        rows.append(
            Row((*cells, Cell("not given", kind="muted"), Cell("")), PAPER, "Cutler et al. 2008: Radiance, and HRSV")
        )
    for row in images:
        if row.method != HEADLINE_METHOD or row.region == "exterior":
            continue
        group = f"{words(row.scene)}, {words(row.view).lower()}, {row.condition}: Mitsuba 3, and Transom"
        rows.append(Row((Cell(region_words(row.region)), *_image_cells(row)), row.origin, group))
    head = (
        "",
        "Reference, average pixel luminance [cd/m²]",
        "Ours, average pixel luminance [cd/m²]",
        "Average error [%]",
        "Bias [%]",
        "Reference's noise per pixel [%]",
        "Verdict",
    )
    return Table("table_1", "Table 1 of the paper, and ours in its columns", head, tuple(rows), OFTEN_RUN)


def view_group(scene: str, view: str, condition: str) -> str:
    """The heading of a view's rows."""
    return f"{words(scene)}, {words(view).lower()}, {condition}"


def regions(images: Iterable[Any]) -> Table:
    """Every region of each view, by both visibility methods, with all error measures."""
    rows = [
        Row(
            (
                Cell(region_words(row.region)),
                Cell(row.method),
                Cell(f"{row.physics}: {reference_kind(row.physics)}"),
                number(row.pixel_count, 0),
                known_number(row.reference_mean_cd_m2, row.reference_mean_standard_error_cd_m2),
                known_number(row.engine_mean_cd_m2, row.reference_mean_standard_error_cd_m2),
                _error(row),
                number(row.mean_relative_error_raw_percent, 2),
                signed_number(row.bias_percent, 2),
                Cell("below noise") if row.relative_rmse_percent is None else number(row.relative_rmse_percent, 2),
                Cell(_several(row, "block_{}_percent", ("p50", "p95", "p99"), 1)),
                Cell(_several(row, "share_within_{}_percent", ("2", "5", "10"), 0)),
                number(row.reference_standard_error_percent, 2),
                number(row.bias_numerical_percent, 2),
                verdict_cell([row.mean_relative_error_verdict, row.bias_verdict, row.block_verdict]),
            ),
            row.origin,
            view_group(row.scene, row.view, row.condition),
        )
        for row in images
    ]
    head = (
        "Region",
        "Sun by",
        "Reference's physics",
        "Pixels",
        "Mitsuba 3 [cd/m²]",
        "Transom [cd/m²]",
        "Mean error [%]",
        "raw [%]",
        "Bias [%]",
        "RMSE [%]",
        "4×4 blocks p50 / p95 / p99 [%]",
        "Pixels within 2 / 5 / 10 % [%]",
        "Noise [%]",
        "b [%]",
        "Verdict",
    )
    return Table("regions", "Every region of every view", head, tuple(rows), OFTEN_RUN)


def sensors(entries: Iterable[Any]) -> Table:
    """One line a sensor set and condition: means, mean and worst error, the reference's noise."""
    rows = []
    for (_, scene, condition, name, _), members in groupby(
        entries, lambda row: (row.suite, row.scene, row.condition, row.set, row.physics)
    ):
        group = list(members)
        errors = np.array([row.error_percent for row in group])
        noise = float(np.mean([row.error_standard_error_percent for row in group]))
        worst = max(group, key=lambda row: abs(row.error_percent))
        reference, ours = (
            float(np.mean([getattr(row, field) for row in group])) for field in ("reference_lx", "engine_lx")
        )
        uncertainty = float(np.mean([row.reference_standard_error_lx for row in group])) / max(len(group), 1) ** 0.5
        place = f"at ({worst.x_m:g}, {worst.y_m:g}, {worst.z_m:g}) m"
        cells = (
            Cell(words(name)),
            Cell(f"{group[0].physics}: {reference_kind(group[0].physics)}"),
            number(len(group), 0),
            known_number(reference, uncertainty, 1),
            known_number(ours, uncertainty, 1),
            signed_number(100 * (ours / reference - 1) if reference else 0.0, 2),
            number(float(np.mean(np.abs(errors))), 2),
            signed_number(worst.error_percent, 2, title=place),
            number(noise, 2),
            verdict_cell([row.verdict for row in group]),
        )
        rows.append(Row(cells, group[0].origin, f"{words(scene)}, {condition}"))
    head = (
        "Set",
        "Reference's physics",
        "Sensors",
        "Mitsuba 3, mean [lx]",
        "Transom, mean [lx]",
        "Bias [%]",
        "Mean |error| [%]",
        "Worst error [%]",
        "Noise [%]",
        "Verdict",
    )
    return Table("sensors", "Illuminance at sensors", head, tuple(rows), OFTEN_RUN)


def agreements(entries: Iterable[Any]) -> Table:
    """Shadow volumes against shadow rays."""
    rows = [
        Row(
            (
                *texts(words(row.scene), row.view, row.condition),
                number(row.pixel_count, 0),
                number(row.differing_count, 0),
                number(row.differing_percent, 3),
                number(row.away_from_edges_count, 0),
                verdict_cell([row.verdict]),
            ),
            row.origin,
        )
        for row in entries
    ]
    head = (
        "Scene",
        "View",
        "Condition",
        "Pixels",
        "Differ by more than 1 %",
        "of all [%]",
        "of those, away from sun edges",
        "Verdict",
    )
    return Table("agreement", "Shadow volumes against shadow rays", head, tuple(rows), OFTEN_RUN)


def verdict_cell(outcomes: Sequence[Outcome | None], link: str = "") -> Cell:
    """The worst of some verdicts."""
    known = [outcome for outcome in outcomes if outcome is not None]
    if not known:
        return Cell("not judged", kind="muted")
    return Cell(max(known, key=list(Outcome).index), kind="verdict", link=link)


def region_words(region: str) -> str:
    return "Entire image (interior)" if region == "interior" else words(region)


def _image_cells(row: Any) -> tuple[Cell, ...]:
    error = _error(row)
    raw = f"raw, against the noisy reference: {fixed(row.mean_relative_error_raw_percent, 2)} %"
    return (
        known_number(row.reference_mean_cd_m2, row.reference_mean_standard_error_cd_m2),
        known_number(row.engine_mean_cd_m2, row.reference_mean_standard_error_cd_m2),
        Cell(error.text, error.value, title=raw),
        signed_number(row.bias_percent, 2),
        number(row.reference_standard_error_percent, 2),
        verdict_cell([row.mean_relative_error_verdict, row.bias_verdict, row.block_verdict]),
    )


def _error(row: Any) -> Cell:
    return known_number(row.mean_relative_error_percent, row.mean_relative_error_standard_error_percent, 2)


def _several(row: Any, field: str, names: Sequence[str], digits: int) -> str:
    return " / ".join(fixed(getattr(row, field.format(name)), digits) for name in names)

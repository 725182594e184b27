"""growth.json: costs of a growing hall, printed, plotted, and described by a schema."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from transom.bench_growth import (
    SCHEMA_FILE,
    SWEEPS,
    Growth,
    GrowthPoint,
    GrowthRow,
    growth_lines,
    growth_points,
    growth_schema,
    measure_growth_point,
    write_growth,
)
from transom.cli import WRONG_USE, run_command
from transom.figures_speed import growth_figure
from transom.provenance import current_provenance


def growth() -> Growth:
    """Times in proportion to the size, memory to its square root."""
    rows = []
    for point in growth_points(quick=False):
        size = getattr(point, point.axis)
        row = (point.patches, 2 * point.patches, point.openings, point.triangles)
        rows.append(GrowthRow(point.axis, *row, size, size, 2 * size, size, size, size**0.5))
    return Growth(1, datetime(2026, 1, 1, tzinfo=UTC), "build", (1.0, 1.0), tuple(rows), current_provenance())


def test_sweeps_reach_the_sizes_that_are_promised() -> None:
    largest = {axis: max(getattr(point, axis) for point in growth_points(quick=False)) for axis in SWEEPS}
    assert largest == {"patches": 30_000, "openings": 200, "triangles": 1_000_000}


def test_the_table_says_with_which_power_costs_grow() -> None:
    lines = list(growth_lines(growth()))
    assert "patches to the power: load_s 1.00, solve_s 1.00" in lines[-3]
    assert lines[-1].endswith("peak_memory_mib 0.50")


def test_the_figure_shows_all_axes() -> None:
    figure = growth_figure(growth()).decode()
    assert all(f">{axis}<" in figure for axis in SWEEPS)
    assert "peak memory [MiB]" in figure


def test_the_file_has_the_published_schema(tmp_path: Path) -> None:
    write_growth(tmp_path / "growth.json", growth())
    assert SCHEMA_FILE.read_text(encoding="utf-8") == growth_schema()


def test_a_point_is_measured_in_all_its_costs() -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    row = measure_growth_point(GrowthPoint("patches", patches=200, openings=2, triangles=400))
    assert row.triangles == pytest.approx(400, rel=0.3)
    assert min(row.load_s, row.solve_s, row.solve_processor_s, row.relight_s, row.frame_s, row.peak_memory_mib) > 0


def test_growth_takes_no_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["bench", "test_room", "--growth"]) == WRONG_USE
    assert "--growth" in capsys.readouterr().err
    assert run_command(["bench"]) == WRONG_USE
    assert "SCENE" in capsys.readouterr().err

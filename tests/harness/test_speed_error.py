"""Speed against error: speed-ups of programs whose behaviour is known, and what is missing said plainly."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness_fakes import grey, small_scene
from matplotlib.figure import Figure

from transom import speed_error
from transom.bench import Bench, Measurement, PhaseTimes
from transom.cli import WRONG_USE, run_command
from transom.compare import CaseNames
from transom.errors import InputError
from transom.figures_speed import scaling_figure, separate_labels, speed_error_figure
from transom.provenance import current_provenance
from transom.renderer import ImageResult
from transom.speed_error import (
    SCHEMA_FILE,
    Setting,
    SpeedError,
    SpeedErrorRow,
    Timed,
    make_task,
    read_speed_error,
    setting_rows,
    speed_error_lines,
    speed_error_schema,
    write_speed_error,
)
from transom.speed_ratio import dominated, speed_ups, time_at_error


def row(program: str, setting: str, seconds: float, error: float, **fields: Any) -> SpeedErrorRow:
    values: dict[str, Any] = {
        "phase": "hour",
        "seconds": (seconds,) * 3,
        "error_uncertainty_percent": 0.02 * error,
        "error_bias_percent": 0.0,
        **fields,
    }
    return SpeedErrorRow("room", "view", "noon", program, setting, error_percent=error, **values)


ENGINE = row("engine", "default", 0.1, 2.0)
MITSUBA = [row("mitsuba", f"{4**k} paths", 0.5 * 4**k, 16.0 / 2**k) for k in range(5)]


def test_equal_error_speed_up_of_a_path_tracer_is_found_exactly() -> None:
    (found,) = speed_ups([ENGINE, *MITSUBA], "engine", "default")
    assert found.ratio == pytest.approx(320.0)  # 16 % after 0.5 s is 2 % after 32 s
    assert found.kind == "interpolated"
    assert found.low < 320 < found.high
    assert math.log(found.high / found.low) == pytest.approx(2 * 1.96 * 2 * math.hypot(0.02, 0.02), rel=0.25)


def test_beyond_its_best_setting_a_path_tracer_is_extrapolated_without_its_set_up() -> None:
    times = np.array([1.5 * 1.0 + 0.5, 6.0 + 0.5])  # half a second to set up
    seconds, kind = time_at_error(times, np.array([8.0, 4.0]), 2.0, can_extrapolate=True)
    assert kind == "extrapolated"
    assert seconds <= 24.5
    assert seconds == pytest.approx(2.0 + 4.5 * 4)


def test_other_programs_are_never_extrapolated() -> None:
    rows = [ENGINE, row("radiance", "fast", 3.0, 9.0), row("radiance", "accurate", 30.0, 4.0)]
    (found,) = speed_ups(rows, "engine", "default")
    assert (found.kind, found.ratio) == ("at_least", pytest.approx(300.0))
    assert "never so right" in found.sentence()


def test_a_program_that_is_right_at_once_is_given_its_fastest_time() -> None:
    assert time_at_error(np.array([3.0, 9.0]), np.array([1.0, 0.5]), 2.0, False) == (3.0, "interpolated")


def test_a_slower_setting_that_is_no_better_does_not_bend_the_frontier() -> None:
    times, errors = np.array([1.0, 2.0, 4.0]), np.array([8.0, 9.0, 2.0])
    seconds, kind = time_at_error(times, errors, 4.0, False)
    assert kind == "interpolated"
    assert 2.0 < seconds < 4.0


def test_phases_are_kept_apart() -> None:
    cold = [row("engine", "default", 3.0, 2.0, phase="cold"), row("mitsuba", "1 path", 9.0, 2.0, phase="cold")]
    found = speed_ups([ENGINE, *MITSUBA, *cold], "engine", "default")
    assert {entry.phase: entry.ratio for entry in found} == {"cold": pytest.approx(3.0), "hour": pytest.approx(320.0)}


def test_dominated_settings_name_a_better_one() -> None:
    rows = dominated([ENGINE, *MITSUBA, row("engine", "slow", 0.2, 3.0)])
    by_setting = {(entry.program, entry.setting): entry.dominated_by for entry in rows}
    assert by_setting["engine", "default"] == ""
    assert by_setting["engine", "slow"] == "engine, default"
    assert by_setting["mitsuba", "1 paths"] == "engine, default"
    assert by_setting["mitsuba", "256 paths"] == ""


def test_error_of_a_setting_is_the_mean_over_its_runs_and_knows_their_spread() -> None:
    reference = ImageResult(grey(np.full((48, 64), 100.0)))
    pictures = [ImageResult(grey(np.full((48, 64), level))) for level in (103.0, 105.0)]
    runs = [Timed(2.0 + k, (0.5, 0.6), picture) for k, picture in enumerate(pictures)]
    names = CaseNames("room", "noon", "", "mitsuba", "view")
    cold, hour = setting_rows(runs, Setting("mitsuba", "2 paths", {}), reference, np.ones((48, 64), bool), names)
    assert cold.seconds == (2.0, 3.0)
    assert hour.seconds == (0.5, 0.6, 0.5, 0.6)
    assert cold.error_percent == pytest.approx(100 * 4 / 101, rel=1e-4)
    assert cold.error_uncertainty_percent == pytest.approx(100 / 101, rel=1e-3)


class Task:
    """Stands in for the pool of processes: every program answers at once, but for one that fails."""

    @staticmethod
    def runs(name: str, task: speed_error.Task, setting: Setting, *_: object) -> list[Timed]:  # noqa: ARG004
        if setting.program == "radiance":
            raise InputError("is not installed", field="pyradiance")
        level = {"engine": 101.0, "mitsuba": 110.0}[setting.program]
        picture = ImageResult(grey(np.full((task.view.height, task.view.width), level)))
        return [Timed(1.0, (0.1, 0.1), picture), Timed(1.1, (0.1, 0.1), picture)]


def measured(monkeypatch: pytest.MonkeyPatch) -> SpeedError:
    from rich.console import Console

    from transom.progress import CaseProgress

    scene = small_scene()

    def with_reference(task: speed_error.Task) -> tuple[speed_error.Task, ImageResult, str, Mapping[str, Any]]:
        return task, ImageResult(grey(np.full((task.view.height, task.view.width), 100.0))), "abc", {}

    monkeypatch.setattr(speed_error, "load_scene", lambda _: scene)
    monkeypatch.setattr(speed_error, "_with_reference", with_reference)
    monkeypatch.setattr(speed_error, "_runs", Task.runs)
    monkeypatch.setattr(
        speed_error,
        "region_masks",
        lambda *_: {"interior": np.ones((scene.views[0].height, scene.views[0].width), bool)},
    )
    settings = [
        Setting("engine", "default", {}),
        Setting("mitsuba", "2 paths", {}),
        Setting("radiance", "fast", {}),
        Setting("classic_of_another_age", "default", {}),
    ]
    with CaseProgress(4, Console(quiet=True)) as bars:
        return speed_error.measure_speed_error("small", bars, settings=settings)


def test_programs_that_are_not_there_are_missing_and_never_dropped(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = measured(monkeypatch)
    assert {(entry.program, entry.reason) for entry in found.missing} == {
        ("radiance", "pyradiance is not installed."),
        ("classic_of_another_age", "there is no such renderer here"),
    }
    assert {entry.program for entry in found.rows} == {"engine", "mitsuba"}
    assert any(line.startswith("missing: radiance") for line in speed_error_lines(found))
    write_speed_error(tmp_path / "a.json", found)
    assert read_speed_error(tmp_path / "a.json") == found
    assert json.loads((tmp_path / "a.json").read_text())["rows"][0]["seconds"] == [1.0, 1.1]
    assert found.provenance == current_provenance()


def test_figure_is_vector_or_pixels_and_names_every_program(monkeypatch: pytest.MonkeyPatch) -> None:
    found = measured(monkeypatch)
    text = speed_error_figure(found).decode()
    assert text.startswith("<svg")
    assert all(word in text for word in ("engine", "mitsuba", "time [s]", "error"))
    assert speed_error_figure(found, "png").startswith(b"\x89PNG")


def test_labels_of_points_that_lie_together_stand_apart() -> None:
    figure = Figure()
    axes = figure.subplots()
    places = [(0.5, 0.5), (0.5, 0.5), (0.51, 0.505), (0.1, 0.9)]
    labels = [
        axes.annotate(f"setting {k}", place, (6, 5), textcoords="offset points") for k, place in enumerate(places)
    ]
    separate_labels(figure)
    figure.draw_without_rendering()
    boxes = [label.get_window_extent() for label in labels]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    assert (labels[3].xyann, labels[0].xyann) == ((6, 5), (6, 5))


def test_scaling_figure_has_sizes_and_phases() -> None:
    def solve(sweep: Any, patches: int, seconds: float) -> Measurement:
        phases = (PhaseTimes("solve/patches", (seconds,), 0.2 * seconds), PhaseTimes("solve/nodes", (seconds,), 0.8))
        sizes = (patches, 10, 20, 1, 1, 0, 0, 0)
        return Measurement("solve", "s", sweep, *sizes, seconds, seconds, seconds, (seconds,), phases)

    rows = (solve("default", 3000, 1.0), solve("patches", 10000, 4.0))
    bench = Bench(1, datetime.now(UTC), "room", "gcc", 1.0, (0, 0), rows, (), (), (), (), current_provenance())
    text = scaling_figure(bench).decode()
    assert all(word in text for word in ("patches", "nodes", "time [s]"))
    assert scaling_figure(bench, "png").startswith(b"\x89PNG")


def test_another_hour_differs_from_the_first() -> None:
    task = make_task(speed_error.load_scene("test_room"), None, None)
    assert task.condition.key() != task.other.key()


def test_a_view_without_a_reference_says_how_to_get_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed")
    arguments = ["bench", "test_room", "--speed-error", "-o", str(tmp_path / "a.json")]
    assert run_command(arguments) == WRONG_USE
    assert "transom run references" in capsys.readouterr().err
    assert run_command([*arguments, "--against", "HEAD"]) == WRONG_USE


def test_published_schema_is_that_of_the_file() -> None:
    assert SCHEMA_FILE.read_text(encoding="utf-8") == speed_error_schema()

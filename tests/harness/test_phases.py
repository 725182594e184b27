"""Traces: valid for Perfetto, nested rightly, and their difference by phase."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scene_writing import write_scene

from transom.bench_worker import BESIDE, phase_seconds
from transom.cli import WRONG_USE, run_command
from transom.errors import InputError
from transom.phases import Trace, change_lines, phase_changes, phase_lines, read_trace, record_trace, write_trace
from transom.scene import load_scene

SPANS = (
    ("solve", 0.0, 2.0),
    ("nodes", 0.5, 2.0),
    ("relight", 2.0, 2.4),
    ("gather", 2.1, 2.3),
    ("relight", 2.4, 2.9),
    ("gather", 2.5, 2.9),
)


def test_phases_within_others_are_their_parts_and_repeats_add_up() -> None:
    phases = Trace("room", SPANS, {}).phases()
    assert list(phases) == ["solve", "solve/nodes", "relight", "relight/gather"]
    assert phases["relight"] == pytest.approx(0.9)
    assert phases["relight/gather"] == pytest.approx(0.6)
    assert phases["solve/nodes"] == pytest.approx(1.5)


def test_the_engines_frame_is_the_whole_of_a_frame() -> None:
    spans = [("volumes", 1.0, 1.5), ("frame", 1.0, 3.0)]
    assert phase_seconds(spans, "frame_volumes") == {"frame_volumes/volumes": pytest.approx(0.5)}


@pytest.mark.parametrize("begin", [1.1, 1.3])
def test_phases_beside_each_other_are_parts_of_the_same(begin: float) -> None:
    """Whichever begins first, and whichever ends within the other."""
    beside = [("first reflection", begin, 1.8), ("interreflection", 1.2, 2.5)]
    spans = [("relight", 1.0, 3.0), *beside, ("gather", 2.5, 2.9)]
    assert phase_seconds(spans, "") == {
        "/relight": pytest.approx(2.0),
        "/relight/first reflection": pytest.approx(1.8 - begin),
        "/relight/interreflection": pytest.approx(1.3),
        "/relight/gather": pytest.approx(0.4),
    }


def test_a_trace_that_was_written_reads_back_the_same(tmp_path: Path) -> None:
    write_trace(tmp_path / "a.json", Trace("room", SPANS, {"patches": 3}))
    found = read_trace(tmp_path / "a.json")
    assert found.name == "room"
    assert found.facts == {"patches": 3}
    assert [name for name, _, _ in found.spans] == [name for name, _, _ in SPANS]
    assert found.phases() == pytest.approx(Trace("room", SPANS, {}).phases(), abs=1e-8)


def test_written_trace_is_in_the_trace_event_format(tmp_path: Path) -> None:
    write_trace(tmp_path / "a.json", Trace("room", SPANS, {}))
    content = json.loads((tmp_path / "a.json").read_text())
    assert {event["ph"] for event in content["traceEvents"]} == {"M", "X"}
    for event in content["traceEvents"]:
        assert {"name", "ph", "pid", "tid"} <= event.keys()
        assert event["ph"] == "M" or (event["ts"] >= 0 and event["dur"] >= 0)


def test_differences_come_largest_first_and_missing_phases_are_shown() -> None:
    changes = phase_changes({"solve": 2.0, "relight": 0.1, "old": 0.3}, {"solve": 1.9, "relight": 0.6, "new": 0.2})
    assert [row.path for row in changes] == ["relight", "old", "new", "solve"]
    assert [row.ratio for row in changes] == [pytest.approx(6), None, None, pytest.approx(0.95)]
    text = "\n".join(change_lines(changes, "a.json", "b.json"))
    assert "+500.000" in text
    assert "6.000" in text
    assert "B: b.json" in text


@pytest.mark.parametrize("content", ["", "[]", '{"traceEvents": []}', '{"traceEvents": [{"ph": "X"}]}', "{"])
def test_a_file_that_is_no_trace_is_refused_by_name(content: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(InputError, match=r"a\.json"):
        read_trace(tmp_path / "a.json")


def test_command_shows_the_difference_of_two_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = tmp_path / "a.json", tmp_path / "b.json"
    write_trace(first, Trace("room", SPANS, {}))
    write_trace(second, Trace("room", (*SPANS, ("frame", 3.0, 3.5)), {}))
    assert run_command(["trace", "--diff", str(first), str(second)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[3].startswith("relight") or "frame" in lines[3]
    assert run_command(["trace", "--diff", str(first), "missing.json"]) == WRONG_USE
    assert "missing.json" in capsys.readouterr().err
    assert run_command(["trace"]) == WRONG_USE
    assert "SCENE" in capsys.readouterr().err


def test_recorded_phases_lie_within_their_steps_and_do_not_overlap(tmp_path: Path) -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    folder = write_scene(tmp_path / "room")
    trace = record_trace(lambda: load_scene(folder))
    phases = trace.phases()
    assert [path for path in phases if "/" not in path] == [
        "load",
        "condition",
        "solve",
        "relight",
        "relight again",
        "frame rays",
        "frame volumes",
        "sensors",
    ]
    assert {"solve/patches", "solve/nodes", "relight/gather", "relight again/gather"} <= phases.keys()
    for step in ("solve", "relight"):
        parts = sum(
            seconds
            for path, seconds in phases.items()
            if path.startswith(f"{step}/") and path.rsplit("/", 1)[-1] not in BESIDE
        )
        assert 0 < parts <= phases[step] + 1e-6
    open_ends: list[float] = []
    steps = [(begin, end) for name, begin, end in trace.spans if name.startswith("relight")]
    for name, begin, end in trace.spans:
        if name in BESIDE:  # it overlaps others, but for its step's borders
            assert any(first - 1e-9 <= begin <= end <= last + 1e-9 for first, last in steps)
            continue
        while open_ends and begin >= open_ends[-1] - 1e-9:
            open_ends.pop()
        assert end >= begin >= 0
        assert not open_ends or end <= open_ends[-1] + 1e-9
        open_ends.append(end)
    assert any(line.strip().startswith("gather") for line in phase_lines(phases))

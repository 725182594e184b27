"""Two builds in turn: fair order, renewed processes, raw times kept, and clear words when a build cannot be had."""

from __future__ import annotations

import json
import random
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import pytest
from scene_writing import write_scene

from transom import bench_against, revisions
from transom.bench_against import (
    GENERATION_ROUNDS,
    Measured,
    SpeedComparison,
    SpeedRow,
    comparison_lines,
    measure,
    write_comparison,
)
from transom.cli import WRONG_USE, run_command
from transom.commands import tracing
from transom.errors import InputError
from transom.judge import Outcome, SpeedChange
from transom.provenance import current_provenance
from transom.speed_pairs import PairedTimes


class FakeWorker:
    """Answers with a constant time, writes down that it was asked, and knows a phase that no other build has."""

    def __init__(self, name: str, seconds: float, calls: list[str]) -> None:
        self.name, self.seconds, self.calls = name, seconds, calls

    def times(self, request: Sequence[tuple[str, int]]) -> dict[str, float]:
        self.calls.append(self.name)
        return {quantity: self.seconds for quantity, _ in request} | {f"solve/{self.name[0]}": 1.0}


def measured(rounds: int) -> tuple[Measured, list[str], int]:
    calls: list[str] = []
    starts = 0

    def start(_: ExitStack) -> tuple[FakeWorker, FakeWorker, FakeWorker]:
        nonlocal starts
        starts += 1
        return FakeWorker("base", 1.0, calls), FakeWorker("base again", 1.01, calls), FakeWorker("ours", 2.0, calls)

    result = measure(start, [("solve", 1)], rounds, lambda *_: None, random.Random(3))
    return result, calls, starts


def test_every_round_times_each_build_once_in_an_order_of_its_own() -> None:
    result, calls, _ = measured(21)
    rounds = [calls[3 * index : 3 * index + 3] for index in range(21)]
    assert all(sorted(entry) == ["base", "base again", "ours"] for entry in rounds)
    assert len({tuple(entry) for entry in rounds}) == 6
    assert result.times["solve"] == PairedTimes("solve", (1.0,) * 21, (1.01,) * 21, (2.0,) * 21)


def test_repeats_take_turns_and_the_least_of_each_build_counts() -> None:
    calls: list[str] = []

    class Slowing(FakeWorker):
        def times(self, request: Sequence[tuple[str, int]]) -> dict[str, float]:
            self.seconds += 1.0
            return super().times(request)

    def start(_: ExitStack) -> tuple[Slowing, Slowing, Slowing]:
        return Slowing("base", 0.0, calls), Slowing("base again", 0.0, calls), Slowing("ours", 4.0, calls)

    result = measure(start, [("relight", 3)], 1, lambda *_: None, random.Random(3))
    assert all(sorted(calls[3 * turn : 3 * turn + 3]) == ["base", "base again", "ours"] for turn in range(3))
    assert result.times["relight"] == PairedTimes("relight", (1.0,), (1.0,), (5.0,))


def test_processes_are_renewed_so_that_no_lucky_layout_decides() -> None:
    assert measured(2 * GENERATION_ROUNDS + 1)[2] == 3


def test_a_phase_of_one_build_alone_is_named_and_not_compared() -> None:
    result, _, _ = measured(9)
    assert result.only_base == ("solve/b",)
    assert result.only_ours == ("solve/o",)
    assert list(result.times) == ["solve"]


def comparison() -> SpeedComparison:
    times = PairedTimes("relight/gather", (0.1,) * 9, (0.1,) * 9, (0.11,) * 9)
    slow = SpeedChange("relight/gather", 9, 0.1, 0.11, 1.1, 1.08, 1.12, 1.0, 1.02)
    same = SpeedChange("solve", 9, 1.0, 1.0, 1.0, 0.99, 1.01, 1.0, 1.02)
    return SpeedComparison(
        format=1,
        created=datetime.now(UTC),
        scene="room",
        patches=0,
        base="main",
        ours="the working tree",
        rounds=9,
        rows=(
            SpeedRow("solve", Outcome("PASS"), same, None, times, None),
            SpeedRow("relight/gather", Outcome("FAIL"), slow, slow, times, times),
        ),
        only_base=(),
        only_ours=("relight/new",),
        load_average=(0.1, 0.2),
        provenance=current_provenance(),
    )


def test_the_slower_phase_comes_first_in_the_table_and_sets_the_exit_code(tmp_path: Path) -> None:
    lines = comparison_lines(comparison())
    assert "FAIL" in lines[2]
    assert "relight/gather" in lines[2]
    assert "only in the working tree" in lines[-1]
    assert comparison().exit_code() == 1
    write_comparison(tmp_path / "a.json", comparison())
    assert '"ours_s":[0.11' in (tmp_path / "a.json").read_text().replace("\n", "").replace(" ", "")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--against", "no_such_revision"], ["no_such_revision", "git log"]),
        (["--against", "--output"], ["--output"]),
        (["--against", "HEAD", "--of", "nothing"], ["--of", "nothing"]),
        (["--against", "HEAD", "--rounds", "10"], ["--rounds", "10", "odd"]),
        (["--against", "HEAD", "--only", "paint"], ["--only", "paint", "relight"]),
        (["--against", "HEAD", "-o", "a.txt"], ["a.txt", ".json"]),
    ],
)
def test_wrong_revisions_are_one_clear_line(
    arguments: list[str],
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = write_scene(tmp_path / "room")
    assert run_command(["bench", str(folder), *arguments]) == WRONG_USE
    message = next(line for line in capfd.readouterr().err.splitlines() if line.startswith("transom: "))
    assert all(word in message for word in words)


def test_outside_a_git_repository_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(revisions, "PROJECT", tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    with pytest.raises(InputError, match="git repository"):
        revisions.resolve_revision("HEAD", "--against")


def test_a_build_that_fails_shows_the_end_of_its_log(tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text('message(FATAL_ERROR "the roof is missing")')
    source = revisions.Source("abc", tmp_path, "abc")
    with pytest.raises(InputError, match="the roof is missing"):
        revisions.build(source, tmp_path / "out")


def test_a_worker_times_the_present_build_and_its_phases(tmp_path: Path) -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    folder = write_scene(tmp_path / "room")
    setup = {"scene": str(folder), "patches": 300, "width": 32, "height": 24}
    with revisions.Worker(revisions.present_build(), setup, tmp_path / "log") as worker:
        assert worker.ready()["patches"] > 0
        times = worker.times([("solve", 1), ("relight", 2), ("frame_rays", 1), ("sensors", 1), ("unknown", 1)])
    assert {"solve", "solve/nodes", "relight", "relight/gather", "frame_rays", "sensors"} <= times.keys()
    assert "unknown" not in times
    assert all(seconds > 0 for seconds in times.values())


def test_a_worker_that_cannot_start_says_why(tmp_path: Path) -> None:
    setup = {"scene": str(tmp_path / "no_room"), "patches": 0, "width": 32, "height": 24}
    with (
        revisions.Worker(revisions.present_build(), setup, tmp_path / "log") as worker,
        pytest.raises(InputError, match="no_room"),
    ):
        worker.ready()


@pytest.fixture
def prebuilt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every revision is the working tree as it is built: nothing is checked out and compiled."""
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    for module in (bench_against, revisions):
        monkeypatch.setattr(module, "check_out", lambda *_: revisions.present_build().source)
        monkeypatch.setattr(module, "build", lambda _, folder: folder.mkdir(parents=True) or revisions.present_build())


@pytest.mark.slow
@pytest.mark.usefixtures("prebuilt")
def test_a_build_against_itself_is_timed_judged_and_kept_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, output = write_scene(tmp_path / "room"), tmp_path / "against.json"
    arguments = ["--against", "HEAD", "--rounds", "9", "--patches", "200", "--only", "relight", "-o", str(output)]
    code = run_command(["bench", str(folder), *arguments])
    rows = json.loads(output.read_text())["rows"]
    assert {"relight", "relight/gather", "relight/all threads"} <= {row["quantity"] for row in rows}
    assert all(len(row["first_times"][side]) == 9 for row in rows for side in ("base_s", "control_s", "ours_s"))
    assert code == (3 if any(row["outcome"] == "INCONCLUSIVE" for row in rows) else 0)
    assert "relight/gather" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.usefixtures("prebuilt")
def test_phases_of_two_revisions_stand_beside_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tracing, "DIFF_ROUNDS", 2)
    folder = write_scene(tmp_path / "room")
    assert run_command(["trace", str(folder), "--diff", "HEAD~1", "HEAD"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["A: HEAD~1", "B: HEAD"]
    assert any(line.startswith("solve/nodes") for line in lines)


def test_worktrees_and_builds_are_gone_afterwards() -> None:
    before = subprocess.run(["git", "-C", str(revisions.PROJECT), "worktree", "list"], capture_output=True, text=True)
    if before.returncode != 0:
        pytest.skip("not a git checkout")
    with revisions.workshop() as folder:
        source = revisions.check_out("HEAD", folder)
        assert (source.folder / "CMakeLists.txt").is_file()
    after = subprocess.run(["git", "-C", str(revisions.PROJECT), "worktree", "list"], capture_output=True, text=True)
    assert not folder.exists()
    assert str(folder) not in after.stdout

"""The state of every case: what a killed, concurrent, failed or outdated run leaves for the next, by real processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
from harness_fakes import CheapEngine, NoisyRenderer, small_condition, small_scene
from scene_writing import ROOM_OBJ, ROOM_TOML, write_scene

from transom import states
from transom.bundle import cache_store, make_case
from transom.claims import CaseBusyError, announced, claimed, holder, queued
from transom.run import Question, render_case
from transom.states import State, case_states, changed_inputs, suite_questions
from transom.suite import load_suite

TESTS = Path(__file__).resolve().parent
HARNESS = TESTS.parents[1] / "harness"

SCRIPT = """
import sys
sys.path[:0] = sys.argv[1:3]
from transom import cli, renderer
renderer.RENDERERS.update(engine="harness_fakes:CheapEngine", mitsuba="harness_fakes:NoisyRenderer")
sys.argv = ["transom", *sys.argv[3:]]
sys.exit(cli.run_command(sys.argv[1:]))
"""
"""The transom command with renderers that do no light transport."""

HOURS = 6
CASES = 3 * HOURS
"""Sensors, and one view by two visibility methods, in each condition of the suite."""


@pytest.fixture
def scenes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two rooms with some conditions each, suites of them, and renderers that take no time."""
    root = tmp_path / "scenes"
    hours = "".join(
        f'\n[[conditions]]\nname = "hour_{hour}"\ntime = "2026-03-21T{10 + hour}:00"\nsky = "cie:12"\n'
        for hour in range(1, HOURS)
    )
    small = ROOM_TOML.replace("display_white", "width = 12\nheight = 8\ndisplay_white")
    write_scene(root / "room", small + hours)
    write_scene(root / "other", small.replace("reflectance = 0.5", "reflectance = 0.6") + hours)
    (root / "suites.toml").write_text(
        'format = 1\n[suites.room]\ntitle = "Room"\nlayout = "hours"\n'
        'cases = [{ scene = "room", conditions = ["*"] }]\n'
        '[suites.both]\ntitle = "Both"\nlayout = "hours"\ncases = [{ scene = "room" }, { scene = "other" }]\n'
    )
    (root / "tolerances.toml").write_text(
        'format = 1\n[[tolerances]]\nquantity = "bias_percent"\ntolerance = 3.0\nreason = "test"\n'
    )
    monkeypatch.setenv("TRANSOM_SCENES", str(root))
    monkeypatch.setenv("CHEAP_ENGINE_LOG", str(tmp_path / "rendered.txt"))
    monkeypatch.setattr(
        "transom.renderer.RENDERERS", {"engine": "harness_fakes:CheapEngine", "mitsuba": "harness_fakes:NoisyRenderer"}
    )
    return root


def transom(*arguments: str, seconds: float = 0.0, cwd: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", SCRIPT, str(HARNESS), str(TESTS), *arguments]
    environment = {**os.environ, "CHEAP_ENGINE_SECONDS": str(seconds)}
    return subprocess.Popen(
        command, cwd=cwd, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def finish(process: subprocess.Popen[str]) -> str:
    output, errors = process.communicate(timeout=120)
    assert "Traceback" not in errors, errors
    return output


def renderings(tmp_path: Path) -> Counter[str]:
    path = tmp_path / "rendered.txt"
    return Counter(path.read_text().splitlines()) if path.exists() else Counter()


def engine_states(suite: str) -> list[State]:
    questions = suite_questions(load_suite(suite))
    return [entry.state for entry in case_states(questions) if entry.question.case.renderer == "engine"]


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, "nothing happened"
        if process.poll() is not None and not condition():
            pytest.fail(f"ended early: {process.communicate()}")
        time.sleep(0.005)


@pytest.mark.usefixtures("scenes")
def test_killed_at_any_moment_a_run_goes_on_and_repeats_nothing(tmp_path: Path) -> None:
    killed = 0
    for count in (1, 4, 9, 13):
        process = transom("run", "room", seconds=0.02, cwd=tmp_path)
        wait_for(lambda: sum(renderings(tmp_path).values()) >= count, process)  # noqa: B023
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += 1
        assert State.RUNNING not in engine_states("room"), "the claim of a killed process is gone with it"
    finish(transom("run", "room", cwd=tmp_path))
    assert engine_states("room") == [State.DONE] * CASES
    repeated = sum(renderings(tmp_path).values()) - CASES
    assert 0 <= repeated <= killed, "only what was being written when the process was killed may be rendered again"
    before = renderings(tmp_path)
    finish(transom("run", "room", cwd=tmp_path))
    assert renderings(tmp_path) == before


@pytest.mark.usefixtures("scenes")
def test_two_runs_at_once_share_the_cases_between_them(tmp_path: Path) -> None:
    first = transom("run", "room", seconds=0.05, cwd=tmp_path)
    second = transom("run", "room", seconds=0.05, cwd=tmp_path)
    wait_for(lambda: bool(renderings(tmp_path)), first)
    seen = set(engine_states("room"))
    finish(first)
    finish(second)
    assert sum(renderings(tmp_path).values()) == CASES, "each case is rendered once"
    assert engine_states("room") == [State.DONE] * CASES
    assert {State.DONE, State.RUNNING, State.QUEUED} & seen
    assert not list((cache_store().root / ".claims").iterdir()), "claims are given back"


@pytest.mark.usefixtures("scenes")
def test_running_and_queued_cases_are_told_with_their_process(tmp_path: Path) -> None:
    process = transom("run", "room", seconds=60.0, cwd=tmp_path)  # longer than it is looked at, also on a busy machine
    try:
        wait_for(lambda: State.RUNNING in engine_states("room"), process)
        found = engine_states("room")
        assert found.count(State.RUNNING) == 1
        assert found.count(State.QUEUED) == CASES - 1
        output = finish(transom("status", "room", cwd=tmp_path))
        assert f"process {process.pid} since" in output
        assert "transom run room" in output
    finally:
        process.kill()
        process.communicate()
    assert engine_states("room") == [State.MISSING] * CASES


@pytest.mark.usefixtures("scenes")
def test_failed_case_is_told_apart_and_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CHEAP_ENGINE_FAILS", "hour_2")
    process = transom("run", "room", cwd=tmp_path)
    finish(process)
    assert process.returncode == 4
    assert Counter(engine_states("room")) == {State.DONE: CASES - 3, State.FAILED: 3}
    output = finish(transom("status", "room", cwd=tmp_path))
    assert "ArithmeticError: light went backwards" in output
    assert "transom run room --scene room" in output
    monkeypatch.delenv("CHEAP_ENGINE_FAILS")
    finish(transom("run", "room", cwd=tmp_path))
    assert engine_states("room") == [State.DONE] * CASES


@pytest.mark.usefixtures("scenes")
def test_changed_tolerance_judges_again_without_rendering(tmp_path: Path, scenes: Path) -> None:
    finish(transom("run", "both", cwd=tmp_path))
    before = renderings(tmp_path)
    (scenes / "tolerances.toml").write_text((scenes / "tolerances.toml").read_text().replace("3.0", "0.1"))
    begin = time.monotonic()
    process = transom("judge", "both", cwd=tmp_path)
    finish(process)
    assert process.returncode == 4, "the fake references were never rendered"
    assert time.monotonic() - begin < 60
    assert renderings(tmp_path) == before


def test_changed_mesh_byte_makes_exactly_the_affected_runs_stale(tmp_path: Path, scenes: Path) -> None:
    finish(transom("run", "both", cwd=tmp_path))
    assert engine_states("both") == [State.DONE] * 6
    (scenes / "other" / "mesh.obj").write_text(ROOM_OBJ.replace("v 4 5 3", "v 4 5 3.5").replace("v 0 5 3", "v 0 5 3.5"))
    found = [entry for entry in case_states(suite_questions(load_suite("both"))) if entry.state is not State.MISSING]
    assert {(entry.question.case.scene.name, entry.state) for entry in found} == {
        ("room", State.DONE),
        ("other", State.STALE),
    }
    assert {entry.note for entry in found if entry.state is State.STALE} == {"changed since: scene content"}
    finish(transom("run", "both", cwd=tmp_path))
    assert engine_states("both") == [State.DONE] * 6
    assert renderings(tmp_path) == {"room morning": 3, "other morning": 6}


def test_claim_is_held_by_one_and_dropped_with_its_holder(tmp_path: Path) -> None:
    with claimed(tmp_path, "key"):
        found = holder(tmp_path, "key")
        assert found is not None and found.pid == os.getpid()
        with pytest.raises(CaseBusyError), claimed(tmp_path, "key", wait=False):
            pytest.fail("claimed twice")
    assert holder(tmp_path, "key") is None
    with pytest.raises(ValueError, match="any"), claimed(tmp_path, "key"):
        raise ValueError("any")
    with claimed(tmp_path, "key", wait=False):
        pass


def test_queue_of_a_dead_process_is_no_queue(tmp_path: Path) -> None:
    with announced(tmp_path, ["a", "b"]):
        assert queued(tmp_path) == {"a", "b"}
    (tmp_path / ".claims" / "queue-1-dead.json").write_text('["a"]')
    assert queued(tmp_path) == frozenset()
    assert not list((tmp_path / ".claims").iterdir())


def test_what_changed_is_named() -> None:
    scene = small_scene()
    engine = CheapEngine()
    now = make_case(scene, small_condition(), engine, {}, view=scene.views[0]).inputs()
    assert changed_inputs({**now, "renderer_version": "older"}, now) == ["engine build"]
    assert changed_inputs({**now, "condition": "other", "scene": "other"}, now) == ["scene content", "condition"]
    assert changed_inputs({**now, "options": {**now["options"], "seed": 7}}, now) is None
    assert changed_inputs({**now, "options": {**now["options"], "extra": 7}}, now) is None
    older = {**now, "renderer_version": "older", "options": {**now["options"], "extra": 7}}
    assert changed_inputs(older, now) == ["engine build", "option extra 7 → (none)"]
    assert changed_inputs({**now, "view": {**now["view"], "size": [6, 4]}}, now) is None
    assert changed_inputs({**now, "view": {**now["view"], "up": [1, 0, 0]}}, now) == ["camera"]
    reference = make_case(scene, small_condition(), NoisyRenderer(), {}, view=scene.views[0]).inputs()
    assert changed_inputs({**reference, "options": {"seed": 1, "depth": 3}}, reference) == ["option depth 3 → (none)"]


def test_bundle_of_another_format_is_stale_by_name() -> None:
    scene = small_scene()
    case = make_case(scene, small_condition(), CheapEngine(), {}, view=scene.views[0])
    record = render_case(CheapEngine(), Question(case)).folder / "run.json"
    record.write_text(record.read_text().replace('"format": 1', '"format": 0', 1))
    (found,) = case_states([Question(case)])
    assert (found.state, found.note) == (State.STALE, "changed since: format of bundles, now 1")


def test_damaged_answer_is_told_as_failed() -> None:
    scene = small_scene()
    case = make_case(scene, small_condition(), CheapEngine(), {}, view=scene.views[0])
    folder = render_case(CheapEngine(), Question(case)).folder
    (folder / "image.exr").write_bytes(b"cut short")
    assert [entry.state for entry in states.case_states([Question(case)])] == [State.FAILED]

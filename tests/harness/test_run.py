"""Running suites and references: stages, progress and remaining time."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from harness_fakes import NoisyRenderer, small_scene
from rich.console import Console

from transom import progress
from transom.bundle import cache_store, repository_store
from transom.progress import CaseProgress, duration_words
from transom.references import STAGES, _work, published_questions, run_references
from transom.run import Target, render_case
from transom.scene.model import Scene, View
from transom.visible import FirstSurfaces

SUITES = """
format = 1
[suites.rooms]
title = "Rooms"
target_percent = 2.0
cases = [{ scene = "small", views = ["*"] }]
[suites.loose]
title = "The same case, less exactly"
target_percent = 9.0
cases = [{ scene = "small" }]
[suites.analytic]
title = "Known answers"
reference = "closed_form"
cases = [{ scene = "small" }]
"""


@pytest.fixture
def renderer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> NoisyRenderer:
    (tmp_path / "suites.toml").write_text(SUITES)
    fake = NoisyRenderer(relative_noise=0.2)

    def surfaces(_: Scene, view: View) -> FirstSurfaces:
        shape = (view.height, view.width)
        return FirstSurfaces(np.zeros(shape, np.int32), np.zeros((*shape, 3), np.float32), np.ones(shape, bool))

    monkeypatch.setattr("transom.suite.load_scene", lambda _: small_scene())
    monkeypatch.setattr("transom.suite.scene_root", lambda: tmp_path)
    monkeypatch.setattr("transom.references.load_renderer", lambda _: fake)
    # Known answers have references of their own, tested apart.
    monkeypatch.setattr("transom.references.run_known_references", lambda *_, **__: None)
    monkeypatch.setattr("transom.run.first_surfaces", surfaces)
    monkeypatch.setattr("transom.visible.first_surfaces", surfaces)
    monkeypatch.setattr("transom.run.SENSOR_TARGET_PERCENT", 2.0)
    return fake


@pytest.mark.usefixtures("renderer")
def test_each_reference_is_wanted_once_at_the_strictest_noise() -> None:
    questions = published_questions()
    assert [(question.case.kind, question.target.percent if question.target else 0) for question in questions] == [
        ("sensors", 2.0),
        ("image", 2.0),
    ]
    assert published_questions({"other_scene"}) == []


def test_references_reach_their_noise_in_stages_and_leave_no_batches(renderer: NoisyRenderer) -> None:
    run_references(())
    for question in published_questions():
        bundle = repository_store().find(question.case)
        assert bundle is not None
        assert bundle.record.facts["relative_standard_error_percent"] <= 2.0
        assert not cache_store().batches(question.case).folder.exists()
    count = len(renderer.rendered)
    run_references(())
    assert len(renderer.rendered) == count, "finished references are not rendered again"


def test_stopped_after_the_first_stage_every_case_has_a_reference(renderer: NoisyRenderer) -> None:
    renderer.stop_after = 70
    with pytest.raises(KeyboardInterrupt):
        run_references(())
    assert all(repository_store().find(question.case) is not None for question in published_questions())


def test_what_needs_least_comes_first_and_what_is_stored_is_not_needed(renderer: NoisyRenderer) -> None:
    picture = next(question for question in published_questions() if question.case.kind == "image")
    render_case(renderer, replace(picture, target=Target(1.5)), repository_store())
    renderer.rendered.clear()
    renderer.stop_after = 1
    with pytest.raises(KeyboardInterrupt):
        run_references(())
    assert renderer.rendered == [0], "nothing of what is stored"
    finished = repository_store().find(picture.case)
    assert finished is not None
    assert _work(picture, 1.0, 1.5) == 0.0 < _work(picture, 1.0, 2.1) < _work(picture, 1.0, 3.0)
    assert _work(picture, 1.0, 3.0) < _work(picture, 1.0, None) == _work(picture, 1.0, 8.0)
    assert sum(_work(picture, stage, None) for stage in STAGES) == pytest.approx(8 * 12 / 2.0**2)


def test_remaining_time_follows_the_weights_of_the_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    stream = io.StringIO()
    bars = CaseProgress(2, Console(file=stream), total_weight=10.0)
    assert bars.remaining_seconds() is None
    bars.begin("small", weight=1.0)
    clock[0] += 30
    bars.update(1, 2)
    assert bars.remaining_seconds() == pytest.approx(30 * 9.5 / 0.5)
    clock[0] += 30
    bars.finish("done")
    assert bars.remaining_seconds() == pytest.approx(540)
    assert "[1/2] small  done" in stream.getvalue()


@pytest.mark.parametrize(("seconds", "words"), [(40, "40 s"), (720, "12 min"), (12_000, "3 h 20 min")])
def test_durations_in_words(seconds: float, words: str) -> None:
    assert duration_words(seconds) == words

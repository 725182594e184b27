"""The published references: rendered once, kept in the repository (reference/store/)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial

from rich.console import Console

from transom.bundle import Store, cache_store, repository_store
from transom.known.suite import run_known_references
from transom.progress import CaseProgress
from transom.renderer import Renderer, load_renderer
from transom.run import Question, free_first, reference_questions, render_case
from transom.suite import is_of_scenes, load_suite, read_suites

REFERENCE_RENDERER = "mitsuba"

SENSOR_WORK_PIXELS = 4000
"""A scene's sensors take about the time of so many pixels to 1 %; used for the remaining time alone."""

STAGES = (4.0, 2.0, 1.0)
"""Multiples of the wanted noise, in the order in which all cases are brought to them."""


def published_questions(scenes: Collection[str] = ()) -> list[Question]:
    """Every reference that reports need, each once, over all suites that are judged against Mitsuba."""
    renderer = load_renderer(REFERENCE_RENDERER)
    questions: dict[str, Question] = {}
    for name, entry in read_suites().items():
        if entry.reference != REFERENCE_RENDERER:
            continue
        for question in reference_questions(load_suite(name), renderer, {}):
            known = questions.get(question.case.key)
            if is_of_scenes(question.case.scene, scenes) and (known is None or _stricter(question, known)):
                questions[question.case.key] = question
    return list(questions.values())


def run_references(scenes: Collection[str], *, fresh: bool = False) -> None:
    """Renders what is missing or too noisy into the repository's store; stopped, it goes on where it was.

    It goes over all cases in stages, each twice as quiet as the one before: stopped early, every case has a reference.
    """
    renderer = load_renderer(REFERENCE_RENDERER)
    questions = published_questions(scenes)
    store = repository_store()
    total = sum(_work(question, stage) for stage in STAGES for question in questions)
    with CaseProgress(len(STAGES) * len(questions), Console(stderr=True), total) as bars:
        for stage in STAGES:
            free_first(questions, partial(_run_stage, renderer, store, bars, stage, fresh and stage == STAGES[0]))
    for question in questions:
        cache_store().drop_batches(question.case)
    for name, entry in read_suites().items():
        if entry.reference == "closed_form":
            run_known_references(load_suite(name), scenes, fresh=fresh)


def _run_stage(
    renderer: Renderer, store: Store, bars: CaseProgress, stage: float, fresh: bool, question: Question, wait: bool
) -> None:
    target = replace(question.target, percent=stage * question.target.percent) if question.target else None
    words = f"{question.case.label} to {target.percent:g} %" if target else question.case.label
    bars.begin(words, _work(question, stage))
    step = replace(question, target=target, command=f"transom run references --scene {question.case.scene.name}")
    bundle = render_case(renderer, step, store, bars.update, fresh=fresh, keep_batches=True, wait=wait)
    facts, size = bundle.record.facts, sum(file.bytes for file in bundle.record.files.values())
    noise = float(facts["relative_standard_error_percent"])
    bars.finish(f"has {noise:.3f} %, {facts['batches']} batches, {size / 1e6:.2f} MB")


def _work(question: Question, stage: float) -> float:
    """Work of a step relative to others: paths, by pixels and wanted noise, after what the stage before has done."""
    places = SENSOR_WORK_PIXELS if question.case.view is None else question.case.view.width * question.case.view.height
    wanted = 1.0 if question.case.view is None or question.target is None else question.target.percent
    position = STAGES.index(stage)
    before = 1 / STAGES[position - 1] ** 2 if position else 0.0
    return places / wanted**2 * (1 / stage**2 - before)


def _stricter(question: Question, known: Question) -> bool:
    return question.target is not None and (known.target is None or question.target.percent < known.target.percent)

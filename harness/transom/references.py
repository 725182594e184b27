"""The published references: rendered once, kept in the repository (reference/store/)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial

from rich.console import Console

from transom.bundle import Store, repository_store
from transom.known.suite import run_known_references
from transom.progress import CaseProgress
from transom.renderer import Renderer, load_renderer
from transom.run import Question, free_first, reference_questions, render_case, usable_answer
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
    Within a stage, what needs least comes first: stopped early, most of them are as quiet as is wanted.
    """
    renderer = load_renderer(REFERENCE_RENDERER)
    store = repository_store()
    wanted = [(question, None if fresh else _stored_noise(store, question)) for question in published_questions(scenes)]
    total = sum(_work(question, stage, noise) for stage in STAGES for question, noise in wanted)
    with CaseProgress(len(STAGES) * len(wanted), Console(stderr=True), total) as bars:
        for stage in STAGES:
            work = {question.case.key: _work(question, stage, noise) for question, noise in wanted}
            least_first = sorted((question for question, _ in wanted), key=lambda question: work[question.case.key])
            again = fresh and stage == STAGES[0]
            free_first(least_first, partial(_run_stage, renderer, store, bars, stage, work, again))
    for name, entry in read_suites().items():
        if entry.reference == "closed_form":
            run_known_references(load_suite(name), scenes, fresh=fresh)


def _run_stage(
    renderer: Renderer,
    store: Store,
    bars: CaseProgress,
    stage: float,
    work: Mapping[str, float],
    fresh: bool,
    question: Question,
    wait: bool,
) -> None:
    target = replace(question.target, percent=stage * question.target.percent) if question.target else None
    words = f"{question.case.label} to {target.percent:g} %" if target else question.case.label
    bars.begin(words, work[question.case.key])
    step = replace(question, target=target, command=f"transom run references --scene {question.case.scene.name}")
    bundle = render_case(renderer, step, store, bars.update, fresh=fresh, wait=wait)
    facts, size = bundle.record.facts, sum(file.bytes for file in bundle.record.files.values())
    noise = float(facts["relative_standard_error_percent"])
    bars.finish(f"has {noise:.3f} %, {facts['batches']} batches, {size / 1e6:.2f} MB")


def _stored_noise(store: Store, question: Question) -> float | None:
    """Relative standard error [%] of the answer that is stored, or None without one that is whole."""
    found = usable_answer(question, store)
    return None if found is None else found.record.facts.get("relative_standard_error_percent")


def _work(question: Question, stage: float, stored_percent: float | None) -> float:
    """Work of a step relative to others: paths, by pixels and wanted noise, after what is stored and what the stage
    before has done."""
    places = SENSOR_WORK_PIXELS if question.case.view is None else question.case.view.width * question.case.view.height
    target = question.target.percent if question.target is not None else 1.0
    wanted = 1.0 if question.case.view is None else target
    position = STAGES.index(stage)
    before = 1 / STAGES[position - 1] ** 2 if position else 0.0
    if stored_percent is not None:
        before = max(before, (target / max(stored_percent, 1e-3 * target)) ** 2)
    return places / wanted**2 * max(1 / stage**2 - before, 0.0)


def _stricter(question: Question, known: Question) -> bool:
    return question.target is not None and (known.target is None or question.target.percent < known.target.percent)

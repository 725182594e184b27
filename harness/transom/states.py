"""The state of every case of a suite, read from the stores: nothing is rendered, nothing remembered elsewhere."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from transom.bundle import BUNDLE_FORMAT, Bundle, Case, OtherVersionError, cache_store, find_bundle, read_bundle, stores
from transom.claims import holder, queued
from transom.errors import InputError
from transom.failures import FailureRecord, read_failure
from transom.renderer import load_renderer
from transom.run import Question, engine_questions, is_done, is_good_enough, reference_questions
from transom.suite import Suite
from transom.workflow import ENGINE, VISIBILITIES

STORED_REFERENCES = ("mitsuba",)
"""Suites judged against these have cases in the stores; those with known answers are computed when compared."""

QUESTION_OPTIONS = ("visibility", "target_patch_count", "method", "seed", "sensor_rays", "sun")
"""Options that make another question of a case, and not an outdated answer to the same one."""

INPUT_WORDS = {
    "scene": "scene content",
    "condition": "condition",
    "view": "camera",
    "sensors": "places of the sensors",
    "renderer_version": "declared version",
    "format": "format of bundles",
}


class State(StrEnum):
    """What is known of a case. stale: there is an answer to what it used to be. missing: there never was one."""

    DONE = "done"
    RUNNING = "running"
    QUEUED = "queued"
    FAILED = "failed"
    STALE = "stale"
    MISSING = "missing"


@dataclass(frozen=True)
class CaseState:
    """A case, its state, and why."""

    question: Question
    state: State
    note: str = ""


def suite_questions(suite: Suite) -> list[Question]:
    """Every case of a suite that has an answer in a store: the engine's, then the references."""
    if suite.reference not in STORED_REFERENCES:
        return []
    references = reference_questions(suite, load_renderer(suite.reference), {})
    return [*engine_questions(suite, load_renderer(ENGINE), VISIBILITIES), *references]


def case_states(questions: Iterable[Question]) -> list[CaseState]:
    """The present state of each question. Raises nothing for a damaged bundle: it is told as a failure."""
    coming = queued(cache_store().root)
    return [_state(question, coming) for question in questions]


def state_counts(states: Iterable[CaseState]) -> dict[State, int]:
    """How many cases are in each state, in the order of State; those without a case left out."""
    counts = Counter(entry.state for entry in states)
    return {state: counts[state] for state in State if counts[state]}


def _state(question: Question, coming: frozenset[str]) -> CaseState:
    case = question.case
    busy = holder(cache_store().root, case.key)
    if busy is not None:
        return CaseState(question, State.RUNNING, f"process {busy.pid} since {busy.since}: {busy.command}")
    try:
        found = find_bundle(case)
    except InputError as error:
        return CaseState(question, State.FAILED, str(error))
    failure = read_failure(case)
    if failure is not None and (found is None or failure.failed >= found.record.finished):
        return CaseState(question, State.FAILED, _failure_words(failure))
    if found is not None and not found.is_whole():
        return CaseState(question, State.FAILED, f"{found.folder.name} is damaged; the next run renders it again")
    if found is not None and (case.key not in coming or is_done(found, question)):
        return CaseState(question, State.DONE, _answer_words(found, question))
    if case.key in coming:
        return CaseState(question, State.QUEUED)
    return _outdated(question)


def _failure_words(failure: FailureRecord) -> str:
    return f"{failure.error} Shown again by: {failure.command}"


def _answer_words(bundle: Bundle, question: Question) -> str:
    noise = bundle.record.facts.get("relative_standard_error_percent")
    words = f"{bundle.record.finished:%Y-%m-%d %H:%M} UTC"
    if noise is None or question.target is None:
        return words
    words += f", noise {float(noise):.2g} %"
    return words if is_good_enough(bundle, question) else f"{words} where {question.target.percent:g} % is wanted"


def _outdated(question: Question) -> CaseState:
    """Stale when some store has the answer to what this case used to be, else missing."""
    nearest: list[str] | None = None
    for inputs in _inputs_of_same_label(question.case):
        changes = changed_inputs(inputs, question.case.inputs())
        if changes is not None and (nearest is None or len(changes) < len(nearest)):
            nearest = changes
    if nearest is None:
        return CaseState(question, State.MISSING)
    return CaseState(question, State.STALE, "changed since: " + ", ".join(nearest))


def _inputs_of_same_label(case: Case) -> Iterator[Mapping[str, Any]]:
    for store in stores():
        for folder in sorted(store.root.glob(f"{case.label}-*")):
            try:
                bundle = read_bundle(folder)
            except OtherVersionError as error:
                if folder.name == store.folder(case).name:
                    yield {**case.inputs(), "format": error.value}
                continue
            except InputError:
                continue
            if bundle is not None and bundle.record.label == case.label:
                yield bundle.record.inputs


def changed_inputs(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str] | None:
    """What differs between the inputs of two cases of one label, in words; None when they are two questions.

    Two questions: a picture and sensors, two sizes, two visibility methods; or, of one build, other options alone.
    """
    if ("view" in before) != ("view" in now) or _size(before) != _size(now):
        return None
    old, new = before.get("options", {}), now.get("options", {})
    if any(old[name] != new[name] for name in QUESTION_OPTIONS if name in old and name in new):
        return None
    words = [_word(name, now) for name in INPUT_WORDS if before.get(name) != now.get(name)]
    if not words and now.get("renderer") == ENGINE:
        return None
    names = [name for name in sorted(old.keys() | new.keys()) if old.get(name) != new.get(name)]
    words += [f"option {name} {_value(old, name)} → {_value(new, name)}" for name in names]
    return words or None


def _word(name: str, now: Mapping[str, Any]) -> str:
    if name == "renderer_version" and now.get("renderer") == ENGINE:
        return "engine build"
    if name == "format":
        return f"{INPUT_WORDS[name]}, now {BUNDLE_FORMAT}"
    return INPUT_WORDS[name]


def _value(options: Mapping[str, Any], name: str) -> str:
    return str(options[name]) if name in options else "(none)"


def _size(inputs: Mapping[str, Any]) -> Any:
    return inputs.get("view", {}).get("size")

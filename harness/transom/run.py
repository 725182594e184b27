"""Running cases: looks an answer up, else renders it, resumably, until a reference is as quiet as was asked for."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.bundle import BatchStore, Bundle, Case, Store, cache_store, find_bundle, make_case
from transom.claims import CaseBusyError, announced, claimed
from transom.colour import luminance
from transom.errors import InputError, StorageError
from transom.failures import clear_failure, write_failure
from transom.files import require_writable
from transom.noise import mean_relative_standard_error
from transom.phases import span_events
from transom.pooling import finished_batches, group_means, pooled_image, pooled_sensors
from transom.renderer import ImageResult, Progress, Renderer, SensorResult
from transom.scene.model import Scene, View
from transom.sensor_file import SensorTable, scene_sensors
from transom.staging import sweep
from transom.suite import Suite, SuiteCase
from transom.visible import first_surfaces

SENSOR_TARGET_PERCENT = 0.2
"""Standard error of a published illuminance, relative to it (median over a scene's sensors)."""

LEAST_BATCHES = 32
"""Published references have at least so many batches, so that Student's quantile stays near the normal one."""

PREVIEW_BATCHES = 8
"""The same for pictures that need not be so quiet: early stages, and small pictures of hours."""

JUDGED_PERCENT = 1.0
"""References at least so quiet are judged against, and have LEAST_BATCHES."""

DEFAULT_METHOD = "gather"

COARSE_VISIBILITY = "volumes"
"""Visibility method of the solve with fewer patches; the other method's picture changes with it alike."""

LEAST_ADDED = 2
"""Fewer batches have no standard error, nor two halves."""

GREATEST_GROWTH = 4.0
"""A noise estimate from few batches is not trusted to order more than this many times what was rendered."""


@dataclass(frozen=True)
class Target:
    """When a reference is good enough: relative standard error in percent, within so many batches."""

    percent: float
    max_batches: int = 4096


@dataclass(frozen=True)
class Question:
    """One case and, for a reference, how well it is to be answered. command: what asks it again, if it fails."""

    case: Case
    target: Target | None = None
    command: str = ""


def render_case(
    renderer: Renderer,
    question: Question,
    store: Store | None = None,
    progress: Progress | None = None,
    *,
    fresh: bool = False,
    wait: bool = True,
) -> Bundle:
    """The bundle of a case: found in the repository or the cache, else rendered and written to `store` (the cache).

    fresh: render again even when an answer exists. A reference that was stopped goes on from its last batch, and one
    that is too noisy gets more batches (transom.pooling). A damaged answer counts as none. One process at a time
    renders a case: the others wait for it, or with wait=False raise CaseBusyError. A failure leaves failed.json and is
    raised.
    """
    case, store = question.case, store or cache_store()
    if not fresh:
        found = usable_answer(question, store)
        if found is not None and is_done(found, question):
            return found
    with claimed(cache_store().root, case.key, wait=wait):
        # Looked at again: whoever held the claim before may have answered it.
        found = None if fresh else usable_answer(question, store)
        if found is not None and is_done(found, question):
            return found
        require_writable(store.root)
        sweep(store.folder(case))
        sweep(cache_store().folder(case))
        try:
            bundle = _render(renderer, question, store, progress, found, fresh)
        except StorageError:
            raise
        except Exception as error:
            write_failure(case, error, question.command)
            raise
        clear_failure(case)
        return bundle


def usable_answer(question: Question, store: Store) -> Bundle | None:
    """The answer to a case that is there and whole."""
    with suppress(InputError):  # a malformed record is as good as none: it is about to be replaced
        found = store.find(question.case) or find_bundle(question.case)
        return found if found is not None and found.is_whole() else None
    return None


def _render(
    renderer: Renderer,
    question: Question,
    store: Store,
    progress: Progress | None,
    found: Bundle | None,
    fresh: bool,
) -> Bundle:
    case = question.case
    if fresh:
        cache_store().drop_batches(case)
    # The time of a reference counts from its first batch on.
    started = time.perf_counter() - (found.record.wall_seconds if found is not None else 0.0)
    if "batches" in renderer.default_options():
        return _render_in_batches(renderer, question, store, progress, started, found)
    if case.view is not None:
        image = renderer.render(case.scene, case.condition, case.view, case.options, progress)
        is_engine = renderer.name == "engine"  # Engine pictures are compared bit by bit with one another.
        facts, trace = _without_trace(image.facts)
        seconds = time.perf_counter() - started
        return store.write(case, image=image, facts=facts, trace=trace, wall_seconds=seconds, half=not is_engine)
    table, facts = _measure(renderer, case, case.options, progress)
    return store.write(case, sensors=table, facts=facts, wall_seconds=time.perf_counter() - started)


def free_first(questions: Sequence[Question], work: Callable[[Question, bool], None]) -> None:
    """Does work(question, wait) for each. One that another process is rendering is left to the end, then waited for.

    work raises CaseBusyError when it may not wait and would have to.
    """
    with announced(cache_store().root, (question.case.key for question in questions)):
        busy: list[Question] = []
        for question in questions:
            try:
                work(question, False)
            except CaseBusyError:
                busy.append(question)
        for question in busy:
            work(question, True)


def reference_questions(suite: Suite, renderer: Renderer, options: Mapping[str, Any]) -> Iterator[Question]:
    """The references of a suite: sensors first (they are cheap), then the views."""
    for entry in suite.cases:
        table = scene_sensors(entry.scene) if entry.sensors else None
        if table is not None:
            case = make_case(entry.scene, entry.condition, renderer, options, sensors=table)
            yield Question(case, Target(SENSOR_TARGET_PERCENT))
    for entry in suite.cases:
        for view in entry.views:
            case = make_case(entry.scene, entry.condition, renderer, options, view=view)
            yield Question(case, Target(suite.target_percent))


def engine_questions(suite: Suite, renderer: Renderer, visibilities: tuple[str, ...]) -> Iterator[Question]:
    """The engine's cases of a suite: every view by every visibility method, and every scene's sensors.

    Then, for suites that are shown view by view, the same with fewer patches (`coarse_options`); not for the published
    method, which is shown as it is.
    """
    for entry in suite.cases:
        table = scene_sensors(entry.scene) if entry.sensors else None
        if table is not None:
            options = method_options(entry)
            yield Question(make_case(entry.scene, entry.condition, renderer, options, sensors=table))
        for view in entry.views:
            for visibility in chosen_visibilities(entry, visibilities):
                options = method_options(entry, visibility)
                yield Question(make_case(entry.scene, entry.condition, renderer, options, view=view))
    coarse = coarse_options(renderer)
    refined = [entry for entry in suite.cases if entry.method == DEFAULT_METHOD]
    for entry in refined if coarse is not None and suite.layout == "views" else ():
        table = scene_sensors(entry.scene) if entry.sensors else None
        if table is not None:
            yield Question(make_case(entry.scene, entry.condition, renderer, coarse or {}, sensors=table))
        for view in entry.views:
            yield Question(make_case(entry.scene, entry.condition, renderer, coarse or {}, view=view))


def chosen_visibilities(entry: SuiteCase, visibilities: tuple[str, ...]) -> tuple[str, ...]:
    """All visibility methods for the default method; the published one has shadow volumes alone."""
    return visibilities if entry.method == DEFAULT_METHOD else (COARSE_VISIBILITY,)


def method_options(entry: SuiteCase, visibility: str | None = None) -> dict[str, Any]:
    """Options of the engine for a case of a suite: its method where it is not the default, and how beams are found."""
    options: dict[str, Any] = {} if entry.method == DEFAULT_METHOD else {"method": entry.method}
    return options if visibility is None else {**options, "visibility": visibility}


def coarse_options(renderer: Renderer) -> dict[str, Any] | None:
    """Options of the engine with half as many patches, whose answer shows how far the usual one has converged.

    The error of patch radiosity falls at least as fast as 1 / patches where light is smooth, so that the difference
    between N/2 and N patches is an estimate of the error with N. None for a renderer without patches.
    """
    count = renderer.default_options().get("target_patch_count")
    return None if count is None else {"visibility": COARSE_VISIBILITY, "target_patch_count": int(count) // 2}


def is_good_enough(bundle: Bundle, question: Question) -> bool:
    """Whether an answer has the batches, and the quiet, that its question asks for."""
    target, facts = question.target, bundle.record.facts
    if target is None:
        return True
    if int(facts.get("batches", LEAST_BATCHES)) < _least_batches(target):
        return False
    # 2 % of slack: a second estimate of the same noise differs a little from the one that stopped the rendering.
    return float(facts.get("relative_standard_error_percent", 0.0)) <= 1.02 * target.percent


def is_done(bundle: Bundle, question: Question) -> bool:
    """Whether an answer is good enough, or can have no more batches."""
    if question.target is None or is_good_enough(bundle, question):
        return True
    return int(bundle.record.facts.get("batches", LEAST_BATCHES)) > question.target.max_batches - LEAST_ADDED


def _render_in_batches(
    renderer: Renderer,
    question: Question,
    store: Store,
    progress: Progress | None,
    started: float,
    found: Bundle | None,
) -> Bundle:
    """Renders, estimates the noise, orders as many batches as the target needs, until it is met.

    found: an answer that is not good enough; it counts as its first batches.
    """
    case, target = question.case, question.target
    before = None if found is None else finished_batches(found, case)
    batches = cache_store().batches(case, 0 if before is None else before.count)
    count = _first_order(question, found)
    resumed = batches.count()
    image: ImageResult | None = None
    table: SensorTable | None = None
    while True:
        options = {**case.options, "batches": count}
        if case.view is not None:
            image, facts = _picture(renderer, case, options, batches, progress)
            image = image if before is None else pooled_image(before, image, count)
            percent = _image_percent(image, case.scene, case.view)
        else:
            table, facts = _measure(renderer, case, options, progress, batches)
            table = table if before is None else pooled_sensors(before, table, count)
            percent = _sensor_percent(table)
        if target is None or percent <= target.percent or count >= target.max_batches:
            break
        count = _next_order(count, percent, target)
    facts = {**facts, "relative_standard_error_percent": round(percent, 5), "batches": count}
    if resumed:
        facts["batches_resumed"] = resumed
    if before is not None:
        facts["batches_stored"] = before.count
    if case.view is not None:
        facts["group_means_cd_m2"] = group_means(before, batches, count, case.scene, case.view)
    case = replace(case, options={**case.options, "batches": count})
    seconds = time.perf_counter() - started
    bundle = store.write(case, image=image, sensors=table, facts=facts, wall_seconds=seconds)
    cache_store().drop_batches(case)
    return bundle


def _first_order(question: Question, found: Bundle | None) -> int:
    """How many batches to have before the noise is looked at: those found and what they say is missing."""
    target = question.target
    if target is None:
        return max(int(question.case.options["batches"]), LEAST_ADDED)
    if found is None:
        return _least_batches(target)
    facts = found.record.facts
    more = _next_order(int(facts["batches"]), float(facts["relative_standard_error_percent"]), target)
    return max(more, _least_batches(target))


def _next_order(count: int, percent: float, target: Target) -> int:
    """How many batches the target should need when `count` of them have a noise of `percent`.

    Even where `count` and the most that may be are.
    """
    growth = min(1.02 * (percent / target.percent) ** 2, GREATEST_GROWTH)
    return min(max(count + LEAST_ADDED, math.ceil(count * growth / 2) * 2), target.max_batches)


def _least_batches(target: Target) -> int:
    return LEAST_BATCHES if target.percent <= JUDGED_PERCENT else PREVIEW_BATCHES


def _picture(
    renderer: Renderer, case: Case, options: Mapping[str, Any], batches: BatchStore, progress: Progress | None
) -> tuple[ImageResult, dict[str, Any]]:
    render: Any = renderer.render
    image: ImageResult = render(case.scene, case.condition, case.view, options, progress, batches=batches)
    return image, dict(image.facts)


def _measure(
    renderer: Renderer,
    case: Case,
    options: Mapping[str, Any],
    progress: Progress | None,
    batches: BatchStore | None = None,
) -> tuple[SensorTable, dict[str, Any]]:
    if case.sensors is None:
        raise ValueError("the case has no sensors")
    measure: Any = renderer.illuminance
    extra = {} if batches is None else {"batches": batches}
    points, normals = case.sensors.points, case.sensors.normals
    result: SensorResult = measure(case.scene, case.condition, points, normals, options, progress, **extra)
    table = case.sensors.measured(np.asarray(luminance(result.illuminance), np.float64), result.standard_error)
    return table, dict(result.facts)


def _image_percent(image: ImageResult, scene: Scene, view: View) -> float:
    surfaces = first_surfaces(scene, view)
    mask: NDArray[np.bool_] = surfaces.interior if surfaces.interior.any() else np.ones_like(surfaces.interior)
    return 100 * mean_relative_standard_error(image, mask)


def _sensor_percent(table: SensorTable) -> float:
    """Median over the sensors, since one in the dark may not decide."""
    if table.illuminance is None or table.standard_error is None:
        raise InputError("holds no measured illuminance", field="sensors")
    lit = table.illuminance > 0
    return 100 * float(np.median(table.standard_error[lit] / table.illuminance[lit])) if lit.any() else 0.0


def _without_trace(facts: Mapping[str, Any]) -> tuple[dict[str, Any], Mapping[str, Any] | None]:
    """Facts for run.json, and the phases (name, begin, end) [s] as a trace file that Perfetto opens."""
    plain = dict(facts)
    phases = plain.pop("trace", None)
    if not phases:
        return plain, None
    origin = min(begin for _, begin, _ in phases)
    spans = [(name, begin - origin, end - origin) for name, begin, end in phases]
    return plain, {"traceEvents": span_events(spans), "displayTimeUnit": "ms"}

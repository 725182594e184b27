"""The referees checked against each other, before either judges the engine, and what the method's simplifications cost.

Suite `crosscheck`: per scene, a few sensors and one view by Mitsuba (our integrator) and by Radiance (without its
irradiance cache: paths, noise and no bias). The pictures are half as wide as the published references, whose pixels
are averaged two by two. Beside them Mitsuba's full physics against its matched one (model error), and Radiance as the
method's paper used it: with its irradiance cache, fast and accurate. One scene is looked at more closely: both
programs with full physics, and the ladder of Radiance's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from transom.bundle import Bundle, cache_store, make_case, repository_store
from transom.claims import CaseBusyError
from transom.colour import luminance
from transom.compare import SensorComparison
from transom.comparison import COMPARISON_FORMAT, Comparison, CrossCheck, LadderStep, ModelError
from transom.errors import StorageError
from transom.failures import error_words
from transom.judge import Missing, Outcome
from transom.noise import floor_cd_m2
from transom.progress import CaseProgress
from transom.referee_pictures import block_difference, halved, mean_error, picture_of, reference_picture
from transom.renderer import ImageResult, Renderer, load_renderer
from transom.run import Question, Target, free_first, render_case
from transom.scene.model import View
from transom.sensor_file import SensorTable
from transom.suite import Suite, SuiteCase
from transom.validation import (
    FULL,
    absent,
    sensor_model_errors,
    sensors_of,
    spread_sensors,
    validate_sensors,
    value_of,
    view_model_errors,
)
from transom.visible import EXTERIOR, INTERIOR, region_masks

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]
Options = Mapping[str, Any]

BLOCK_SIDES = (4, 8, 16)
"""Pixels across blocks that are compared: as small as the noise of both pictures lets them be."""

MEAN_NOISE_PERCENT = 0.35
"""Of regions and blocks that are judged: k u then takes half of the tolerance. Noisier regions are told in a note."""

SENSOR_NOISE_PERCENT = 0.1
"""Standard error asked of Mitsuba at these sensors: less than that of Radiance's paths, which cost more."""

FULL_SENSOR_NOISE_PERCENT = 0.2
"""The same with full physics: where model error is worth telling, it is larger than this."""

FULL_IMAGE_NOISE_PERCENT = 6.0
"""The same of pixels with full physics, which are only compared as means."""

EXACT: Options = {"preset": "exact"}
EXACT_FULL: Mapping[str, Any] = {"preset": "exact", "physics": "full"}

CLOSER_SCENE = "test_room"
"""Where the ladder is shown, pictures have full physics too, and both programs are compared with full physics."""

LADDER: tuple[str, ...] = (
    "-ab 1 -ad 128 -as 32 -aa 0.3 -ar 32 -lr 4 -lw 0.005",
    "-ab 2 -ad 256 -as 64 -aa 0.25 -ar 48 -lr 5 -lw 0.002",
    "",  # the preset "fast"
    "-ab 5 -ad 512 -as 128 -aa 0.16 -ar 96 -lr 8 -lw 0.0005",
    "-ab 7 -ad 768 -as 192 -aa 0.14 -ar 128 -lr 10 -lw 0.0003",
)
"""Parameters of Radiance rising from a sketch to the preset "accurate", which is the last step."""


@dataclass(frozen=True)
class Wanted:
    """One picture or set of sensors by one renderer."""

    renderer: str
    options: Options
    percent: float | None = None


def crosscheck_questions(suite: Suite) -> Iterator[tuple[Renderer, Question]]:
    """Everything that the suite needs, what decides first."""
    engine, mitsuba, radiance = (load_renderer(name) for name in ("engine", "mitsuba", "radiance"))
    sensors = [entry for entry in suite.cases if entry.sensors]
    for entry in sensors:
        yield mitsuba, _sensor_question(entry, mitsuba, {}, SENSOR_NOISE_PERCENT)
        yield radiance, _sensor_question(entry, radiance, EXACT)
    views = [(entry, view) for entry in suite.cases for view in entry.views]
    for entry, view in views:
        yield radiance, _view_question(entry, radiance, EXACT, view)
    for entry in sensors:
        yield mitsuba, _sensor_question(entry, mitsuba, FULL, FULL_SENSOR_NOISE_PERCENT)
        if entry.scene.name == CLOSER_SCENE:
            yield radiance, _sensor_question(entry, radiance, EXACT_FULL)
        yield engine, _sensor_question(entry, engine, {})
    for entry, view in views:
        if entry.scene.name == CLOSER_SCENE:
            for options in ladder_options():
                yield radiance, _view_question(entry, radiance, options, view)
        else:
            yield radiance, _view_question(entry, radiance, {"preset": "fast"}, view)
    for entry, view in views:
        if entry.scene.name == CLOSER_SCENE:
            yield mitsuba, _view_question(entry, mitsuba, FULL, view, FULL_IMAGE_NOISE_PERCENT)
    for entry, view in views:
        if entry.scene.name != CLOSER_SCENE:
            yield radiance, _view_question(entry, radiance, {"preset": "accurate"}, view)


def ladder_options() -> list[Options]:
    """The options of each step of the ladder, the presets among them."""
    steps: list[Options] = [
        {"preset": "fast", "parameters": parameters} if parameters else {"preset": "fast"} for parameters in LADDER
    ]
    return [*steps, {"preset": "accurate"}]


def render_references(suite: Suite, *, fresh: bool = False) -> list[tuple[Question, str]]:
    """Renders what is missing, references into the repository's store; the cases that failed, and why."""
    asked = list(crosscheck_questions(suite))
    renderers = {id(question): renderer for renderer, question in asked}
    questions = [replace(question, command=f"transom run {suite.name}") for _, question in asked]
    by_key = {new.case.key: renderers[id(old)] for new, (_, old) in zip(questions, asked, strict=True)}
    failed: list[tuple[Question, str]] = []
    with CaseProgress(len(questions), Console(stderr=True)) as bars:

        def work(question: Question, wait: bool) -> None:
            options = question.case.options
            words = (options.get("preset"), options.get("parameters"), options.get("physics"))
            bars.begin(" ".join([question.case.label, *(str(word) for word in words if word)]))
            renderer = by_key[question.case.key]
            store = cache_store() if renderer.name == "engine" else repository_store()
            try:
                bundle = render_case(renderer, question, store, bars.update, fresh=fresh, wait=wait)
            except (CaseBusyError, StorageError):
                raise
            except Exception as error:
                failed.append((question, error_words(error)))
                bars.finish(f"crashed: {failed[-1][1]}")
            else:
                bars.finish(f"{bundle.record.wall_seconds:.1f} s")

        free_first(questions, work)
    return failed


def compare_references(suite: Suite, crashed: Mapping[str, str] | None = None) -> Comparison:
    """All that the referees say of each other, from what has been rendered. crashed: messages by key of a case."""
    checks: list[CrossCheck] = []
    models: list[ModelError] = []
    validated: list[SensorComparison] = []
    ladder: list[LadderStep] = []
    missing: list[Missing] = []
    for entry in suite.cases:
        if entry.sensors:
            checks += _sensor_checks(entry, missing)
            models += sensor_model_errors(entry, missing)
            validated += validate_sensors(entry, missing)
        for view in entry.views:
            checks += _view_checks(entry, view, missing)
            if entry.scene.name == CLOSER_SCENE:
                models += view_model_errors(entry, view, missing)
                ladder += ladder_steps(entry, view, missing)
    by_key = {question.case.key: question for _, question in crosscheck_questions(suite)} if crashed else {}
    for key, message in (crashed or {}).items():
        case = by_key[key].case
        place = case.view.name if case.view is not None else "sensors"
        missing.append(Missing(Outcome.CRASHED, case.scene.name, place, case.condition.name, case.renderer, message))
    return Comparison(
        COMPARISON_FORMAT,
        suite.name,
        suite.title,
        sensors=tuple(validated),
        crosschecks=tuple(checks),
        model_errors=tuple(models),
        ladder=tuple(ladder),
        missing=tuple(missing),
    )


def check_sensors(
    entry: SuiteCase, physics: str, first: SensorTable, second: SensorTable, batches: int
) -> list[CrossCheck]:
    """Radiance (first) against Mitsuba (second): the mean relative difference of the sensors, each of them in the note.

    One row and not one each: without a cache a sensor costs minutes to 0.3 %, and their noises are independent.
    """
    values = [(*value_of(first, index), *value_of(second, index)) for index in range(len(second.sets))]
    lit = [(name, *value) for name, value in zip(second.sets, values, strict=True) if value[2] > 0]
    if not lit:
        return []
    differences = np.array([100 * (ours / theirs - 1) for _, ours, _, theirs, _ in lit])
    noises = np.array([100 * math.hypot(error, other) / theirs for _, _, error, theirs, other in lit])
    each = ", ".join(
        f"{name} {difference:+.2f} ± {noise:.2f}"
        for (name, *_), difference, noise in zip(lit, differences, noises, strict=True)
    )
    return [
        CrossCheck(
            scene=entry.scene.name,
            view="",
            region=f"{len(lit)} sensors",
            condition=entry.condition.name,
            quantity="sensor",
            unit="lx",
            physics=physics,
            first="radiance exact",
            second="mitsuba",
            first_value=float(np.mean([ours for _, ours, *_ in lit])),
            second_value=float(np.mean([theirs for *_, theirs, _ in lit])),
            difference_percent=float(differences.mean()),
            uncertainty_percent=float(np.sqrt(np.sum(noises**2))) / len(lit),
            batch_count=batches,
            note=f"mean of the relative differences; each [%]: {each}",
        )
    ]


def check_picture(
    entry: SuiteCase, view: View, first: ImageResult, second: ImageResult, masks: Mapping[str, Bool], batches: int
) -> list[CrossCheck]:
    """Region means and blocks of two pictures of one size, each with independent halves, Radiance's first."""
    ours, theirs = luminance(first.mean), luminance(second.mean)
    common: dict[str, Any] = {
        "scene": entry.scene.name,
        "view": view.name,
        "condition": entry.condition.name,
        "unit": "cd/m²",
        "physics": "matched",
        "first": "radiance exact",
        "second": "mitsuba",
        "batch_count": batches,
    }
    rows, unclear = [], []
    for region, mask in masks.items():
        if region == EXTERIOR:
            continue
        value, truth = float(ours[mask].mean()), float(theirs[mask].mean())
        difference = 100 * (value / truth - 1) if truth else 0.0
        error = math.hypot(mean_error(first, mask, region), mean_error(second, mask, region))
        noise = 100 * error / truth if truth else 0.0
        if region != INTERIOR and noise > MEAN_NOISE_PERCENT:
            unclear.append(f"{region} {difference:+.2f} ± {noise:.2f}")
            continue
        rows.append(
            CrossCheck(
                region=region,
                quantity="image mean",
                first_value=value,
                second_value=truth,
                difference_percent=difference,
                uncertainty_percent=noise,
                **common,
            )
        )
    if unclear:
        rows[0] = replace(rows[0], note=f"regions too noisy to be judged [%]: {', '.join(unclear)}")
    side, value, error = clear_blocks(first, second, masks[INTERIOR])
    rows.append(
        CrossCheck(
            region=f"{INTERIOR}, {side}x{side} pixels",
            quantity="image blocks",
            first_value=float(ours[masks[INTERIOR]].mean()),
            second_value=float(theirs[masks[INTERIOR]].mean()),
            difference_percent=100 * value,
            uncertainty_percent=100 * error,
            note="root of the mean product of the differences of independent halves, which noise does not inflate",
            **common,
        )
    )
    return rows


def clear_blocks(first: ImageResult, second: ImageResult, mask: Bool) -> tuple[int, float, float]:
    """The smallest side of blocks at which noise lets their difference be told, that difference, its uncertainty."""
    for side in BLOCK_SIDES:
        value, error = block_difference(first, second, mask, side)
        if 100 * error <= MEAN_NOISE_PERCENT:
            break
    return side, value, error


def ladder_steps(entry: SuiteCase, view: View, missing: list[Missing]) -> list[LadderStep]:
    """The steps that have been rendered, each against the one before and against Mitsuba."""
    truth = reference_picture(entry, view)
    if truth is None:
        return []
    reference = luminance(halved(truth.image()).mean)
    mask = region_masks(entry.scene, view)[INTERIOR]
    floor = floor_cd_m2(reference[mask])
    steps: list[LadderStep] = []
    before: Float64 | None = None
    for number, options in enumerate(ladder_options(), start=1):
        bundle = picture_of(entry, view, "radiance", options)
        if bundle is None:
            missing.append(absent(entry, view.name, f"ladder {number}"))
            continue
        picture = luminance(bundle.image().mean)
        change = None if before is None else 100 * float(_relative(picture, before, mask, floor).mean())
        steps.append(
            LadderStep(
                scene=entry.scene.name,
                view=view.name,
                condition=entry.condition.name,
                program="radiance",
                step=number,
                options=str(bundle.record.facts["parameters"]),
                seconds=float(bundle.record.facts["seconds"]),
                change_percent=change,
                difference_percent=100 * float(_relative(picture, reference, mask, floor).mean()),
                bias_percent=100 * float(picture[mask].mean() / reference[mask].mean() - 1),
            )
        )
        before = picture
    return steps


def _relative(picture: Float64, reference: Float64, mask: Bool, floor: float) -> Float64:
    share: Float64 = np.abs(picture - reference)[mask] / (reference[mask] + floor)
    return share


def _sensor_question(entry: SuiteCase, renderer: Renderer, options: Options, percent: float | None = None) -> Question:
    case = make_case(entry.scene, entry.condition, renderer, options, sensors=spread_sensors(entry))
    return Question(case, None if percent is None else Target(percent))


def _view_question(
    entry: SuiteCase, renderer: Renderer, options: Options, view: View, percent: float | None = None
) -> Question:
    case = make_case(entry.scene, entry.condition, renderer, options, view=view)
    return Question(case, None if percent is None else Target(percent))


def _sensor_checks(entry: SuiteCase, missing: list[Missing]) -> list[CrossCheck]:
    rows: list[CrossCheck] = []
    pairs: list[tuple[str, Options, Options]] = [("matched", EXACT, {})]
    if entry.scene.name == CLOSER_SCENE:
        pairs.append(("full", EXACT_FULL, FULL))
    for physics, radiance_options, mitsuba_options in pairs:
        first = sensors_of(entry, "radiance", radiance_options)
        second = sensors_of(entry, "mitsuba", mitsuba_options)
        if first is None or second is None:
            missing.append(absent(entry, "sensors", f"{'radiance' if first is None else 'mitsuba'} {physics}"))
        else:
            rows += check_sensors(entry, physics, first.sensors(), second.sensors(), _batches(first, second))
    return rows


def _view_checks(entry: SuiteCase, view: View, missing: list[Missing]) -> list[CrossCheck]:
    first, second = picture_of(entry, view, "radiance", EXACT), reference_picture(entry, view)
    if first is None or second is None:
        missing.append(absent(entry, view.name, "radiance exact" if first is None else "mitsuba"))
        return []
    masks = region_masks(entry.scene, view)
    return check_picture(entry, view, first.image(), halved(second.image()), masks, _batches(first, second))


def _batches(first: Bundle, second: Bundle) -> int:
    """Independent estimates behind the noisier answer, for Student's quantile."""
    counts = [
        int(bundle.record.facts.get("batches", bundle.record.facts.get("passes", 0))) for bundle in (first, second)
    ]
    return min(counts)

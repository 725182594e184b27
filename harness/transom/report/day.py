"""A day relit: one view of one scene, hour by hour, by the engine alone; each hour is a run bundle like any other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from transom.bundle import Bundle, Case, find_bundle, make_case
from transom.daylight.condition import resolve_condition
from transom.renderer import load_renderer
from transom.report.numbers import seconds
from transom.report.pictures import Picture, illustration
from transom.run import Question, render_case
from transom.suite import Suite, resized

DAY_HOURS = tuple(range(6, 19))
DAY_SIZE = (240, 180)
"""Thirteen pictures of this size [pixels]: small enough to be part of the page."""


@dataclass(frozen=True)
class Day:
    """The frames of a day in order, with their clock times, and what relighting took."""

    title: str
    labels: list[str]
    frames: list[Picture]
    note: str


def day_cases(suites: Sequence[Suite]) -> list[Case]:
    """The hours of the first judged view with a sun, on its day, under its sky with levels of the hour."""
    for suite in suites:
        for entry in suite.cases:
            if not entry.views or entry.condition.sun_direction is None:
                continue
            scene, spec = entry.scene, entry.condition.spec
            view = resized(entry.views[0], *DAY_SIZE)
            engine = load_renderer("engine")
            date = datetime.fromisoformat(spec.time).date()
            specs = [
                replace(
                    spec,
                    name=f"day_{hour:02d}00",
                    time=f"{date}T{hour:02d}:00",
                    zenith_luminance_cd_m2=None,
                    diffuse_horizontal_illuminance_lx=None,
                    direct_normal_illuminance_lx=None,
                )
                for hour in DAY_HOURS
            ]
            options = {"visibility": "volumes"}
            return [make_case(scene, resolve_condition(item, scene.site), engine, options, view=view) for item in specs]
    return []


def render_missing(cases: Sequence[Case], note: Callable[[str], None]) -> None:
    """Renders with the engine what is not there yet. Cases of one scene share one solve."""
    engine = load_renderer("engine")
    for case in cases:
        if find_bundle(case) is None:
            note(case.label)
            render_case(engine, Question(case))


def find_day(cases: Sequence[Case]) -> Day | None:
    """The day, if all of its hours are there."""
    found = [(case, bundle) for case in cases if (bundle := find_bundle(case)) is not None]
    if not found or len(found) < len(cases):
        return None
    scene, view = cases[0].scene, cases[0].view
    if view is None:
        return None
    labels, frames = [], []
    for case, bundle in found:
        moment = datetime.fromisoformat(case.condition.spec.time)
        labels.append(f"{moment:%H:%M}")
        frames.append(illustration(f"{scene.title} at {moment:%H:%M}, {moment.day} {moment:%B}", bundle, view))
    moment = datetime.fromisoformat(cases[0].condition.spec.time)
    return Day(f"{scene.title}, {moment.day} {moment:%B}", labels, frames, _cost_words([bundle for _, bundle in found]))


def _cost_words(bundles: Sequence[Bundle]) -> str:
    """What relighting and showing the hours took, from the runs' own facts."""
    costs = [bundle.record.facts.get("seconds", {}) for bundle in bundles]
    parts = []
    for name, what in (("relight", "relighting"), ("frame", "showing")):
        values = [float(cost[name]) for cost in costs if name in cost]
        if values:
            parts.append(f"{what} {seconds(float(np.median(values)))}")
    return "One solve serves all hours. " + (f"An hour, median: {', '.join(parts)}." if parts else "")

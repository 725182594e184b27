"""The picture sections of the report: rooms view by view, hours of the year, and the factoring of light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from transom.report.numbers import fixed, words
from transom.report.pictures import Picture, factoring_pictures, find_pictures, illustration, toned_picture, white_words
from transom.report.results import Results
from transom.report.rows_images import HEADLINE_METHOD, view_group
from transom.report.viewer import Viewer, make_viewer
from transom.suite import Suite, SuiteCase

FENESTRATION = "fenestration"
"""The suite that has a chapter of its own."""


@dataclass(frozen=True)
class ViewSection:
    """One view in one condition. group: the heading of its rows in the table of regions. viewer: None where there is
    no reference; then `pictures` holds ours alone, if there is one."""

    anchor: str
    title: str
    condition: str
    group: str
    viewer: Viewer | None
    pictures: list[Picture]


@dataclass(frozen=True)
class RoomSection:
    """One scene of a suite shown view by view."""

    title: str
    description: str
    views: list[ViewSection]


@dataclass(frozen=True)
class HourCell:
    """One moment of the grid: ours, the reference's, and the mean relative error in words."""

    ours: Picture | None
    reference: Picture | None
    error: str


@dataclass(frozen=True)
class HourGrid:
    """Figure 12: dates down, hours across; cells[date][hour], None where nothing was asked."""

    title: str
    white: str
    hours: list[str]
    days: list[tuple[str, list[HourCell | None]]]


@dataclass(frozen=True)
class Strip:
    """Figure 5 for one view."""

    title: str
    white: str
    pictures: list[Picture]


def shows_views(suite: Suite) -> bool:
    return suite.layout == "views" and suite.reference == "mitsuba" and suite.name != FENESTRATION


def rooms(suite: Suite) -> list[RoomSection]:
    """The scenes of a suite with a viewer for each view that has a reference."""
    found: dict[str, RoomSection] = {}
    for entry in suite.cases:
        scene = entry.scene
        room = found.setdefault(scene.name, RoomSection(scene.title, scene.description, []))
        for view in entry.views:
            pictures = find_pictures(entry, view)
            anchor = f"{scene.name}-{view.name}-{entry.condition.name}"
            condition = condition_words(entry)
            viewer = None
            alone: list[Picture] = []
            if pictures.volumes is not None and pictures.reference is not None:
                viewer = make_viewer(
                    anchor, f"{scene.title}, {words(view.name).lower()}", condition, entry, view, pictures
                )
            elif pictures.volumes is not None:
                alone = [toned_picture(f"Transom, shadow volumes ({white_words(view)})", pictures.volumes, view)]
            group = view_group(scene.name, view.name, entry.condition.name)
            room.views.append(ViewSection(anchor, words(view.name), condition, group, viewer, alone))
    return list(found.values())


def condition_words(entry: SuiteCase) -> str:
    """The condition in one line: moment, sky, levels and sun."""
    condition = entry.condition
    moment = datetime.fromisoformat(condition.spec.time)
    parts = [f"{moment.day} {moment:%B}, {moment:%H:%M}", entry.scene.site.name, f"sky {condition.spec.sky}"]
    parts.append(f"diffuse horizontal {fixed(condition.diffuse_horizontal_lx, 0)} lx")
    if condition.sun_direction is not None:
        altitude = float(np.degrees(np.arcsin(condition.sun_direction[2])))
        parts.append(f"sun {fixed(condition.direct_normal_lx, 0)} lx at {fixed(altitude, 0)}° altitude")
    else:
        parts.append("no sun")
    return "; ".join(parts)


def hour_grids(suite: Suite, results: Results) -> list[HourGrid]:
    """The paper's Figure 12: each scene of the suite, by day and hour."""
    grids: list[HourGrid] = []
    for scene_name in dict.fromkeys(entry.scene.name for entry in suite.cases):
        entries = [entry for entry in suite.cases if entry.scene.name == scene_name]
        for view in entries[0].views:
            cells: dict[tuple[str, str], HourCell] = {}
            for entry in entries:
                found = find_pictures(entry, view)
                cells[_day_and_hour(entry)] = HourCell(
                    illustration("Transom", found.volumes, view) if found.volumes else None,
                    illustration("Mitsuba 3", found.reference, view) if found.reference else None,
                    error_words(results, suite, entry, view.name),
                )
            days = list(dict.fromkeys(day for day, _ in cells))
            hours = sorted({hour for _, hour in cells})
            grid = [(day, [cells.get((day, hour)) for hour in hours]) for day in days]
            white = f"{fixed(view.display_white_cd_m2, 0)} cd/m²"
            grids.append(HourGrid(f"{entries[0].scene.title}, view {words(view.name)}", white, hours, grid))
    return grids


def strips(suite: Suite) -> list[Strip]:
    """The paper's Figure 5 for the first view of each scene."""
    found = []
    for scene_name in dict.fromkeys(entry.scene.name for entry in suite.cases):
        entry = next(case for case in suite.cases if case.scene.name == scene_name)
        view = entry.views[0]
        pictures = factoring_pictures(view, find_pictures(entry, view))
        white = f"{fixed(view.display_white_cd_m2, 0)} cd/m²"
        if pictures:
            found.append(Strip(f"{entry.scene.title}, view {words(view.name)}", white, pictures))
    return found


def view_images(suites: Sequence[Suite], results: Results) -> list[Any]:
    """The rows of suites that are shown view by view."""
    return suite_rows(results.images, [suite.name for suite in suites if shows_views(suite)])


def suite_rows(rows: Sequence[Any], names: Sequence[str]) -> list[Any]:
    """Those of some suites."""
    return [row for row in rows if row.suite in names]


def error_words(results: Results, suite: Suite, entry: SuiteCase, view: str) -> str:
    """The mean error of a view's interior by the headline method; "" where it was not compared."""
    wanted = (suite.name, entry.scene.name, entry.condition.name, view, "interior", HEADLINE_METHOD)
    rows: list[Any] = list(results.images)
    for row in rows:
        if (row.suite, row.scene, row.condition, row.view, row.region, row.method) == wanted:
            return f"{fixed(row.mean_relative_error_percent, 1)} %"
    return ""


def _day_and_hour(entry: SuiteCase) -> tuple[str, str]:
    moment = datetime.fromisoformat(entry.condition.spec.time)
    sky = "" if entry.condition.sun_direction is not None else " (no sun)"
    return f"{moment.day} {moment:%B}{sky}", f"{moment:%H:%M}"

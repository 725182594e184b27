"""Validation: what the method's simplifications cost (model error), and the engine against the full physics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from transom.bundle import Bundle, find_bundle, make_case
from transom.colour import luminance
from transom.compare import CaseNames, SensorComparison, compare_sensors
from transom.comparison import ModelError
from transom.judge import Missing, Outcome
from transom.referee_pictures import halved, mean_error, picture_of, reference_picture
from transom.renderer import load_renderer
from transom.scene.model import View
from transom.sensor_file import SensorTable, scene_sensors
from transom.suite import SuiteCase
from transom.visible import EXTERIOR, region_masks

SENSOR_COUNT = 4
"""Sensors of a scene that are checked, spread evenly over all of them: paths without a cache are slow."""


FULL: Mapping[str, Any] = {"physics": "full"}


def validate_sensors(entry: SuiteCase, missing: list[Missing]) -> list[SensorComparison]:
    """The engine against Mitsuba's full physics, sensor by sensor: the method's error and ours together."""
    ours, truth = sensors_of(entry, "engine", {}), sensors_of(entry, "mitsuba", FULL)
    if ours is None or truth is None:
        missing.append(absent(entry, "sensors", "engine" if ours is None else "mitsuba full"))
        return []
    names = CaseNames(
        scene=entry.scene.name,
        condition=entry.condition.name,
        method="rays",
        reference="mitsuba",
        engine_key=ours.record.key,
        reference_key=truth.record.key,
        reference_batch_count=int(truth.record.facts.get("batches", 0)),
        reference_file=str(truth.folder),
        physics="full",
    )
    return compare_sensors(ours.sensors(), truth.sensors(), names)


def sensor_model_errors(entry: SuiteCase, missing: list[Missing]) -> list[ModelError]:
    matched, full = sensors_of(entry, "mitsuba", {}), sensors_of(entry, "mitsuba", FULL)
    if matched is None or full is None:
        missing.append(absent(entry, "sensors", "mitsuba full"))
        return []
    simple, whole = matched.sensors(), full.sensors()
    rows = []
    for index, name in enumerate(simple.sets):
        value, error = value_of(simple, index)
        truth, truth_error = value_of(whole, index)
        rows.append(_row(entry, "", f"{name} {index}", "sensor", "lx", (value, truth), (error, truth_error)))
    return rows


def view_model_errors(entry: SuiteCase, view: View, missing: list[Missing]) -> list[ModelError]:
    matched, full = reference_picture(entry, view), picture_of(entry, view, "mitsuba", FULL)
    if matched is None or full is None:
        missing.append(absent(entry, view.name, "mitsuba full"))
        return []
    simple, whole = halved(matched.image()), full.image()
    rows = []
    for region, mask in region_masks(entry.scene, view).items():
        if region == EXTERIOR:
            continue
        values = (float(luminance(simple.mean)[mask].mean()), float(luminance(whole.mean)[mask].mean()))
        errors = (mean_error(simple, mask, region), mean_error(whole, mask, region))
        rows.append(_row(entry, view.name, region, "image mean", "cd/m²", values, errors))
    return rows


def _row(
    entry: SuiteCase,
    view: str,
    region: str,
    quantity: str,
    unit: str,
    values: tuple[float, float],
    errors: tuple[float, float],
) -> ModelError:
    matched, full = values
    return ModelError(
        scene=entry.scene.name,
        view=view,
        region=region,
        condition=entry.condition.name,
        quantity=quantity,
        unit=unit,
        matched=matched,
        full=full,
        model_error_percent=100 * (matched / full - 1) if full else 0.0,
        uncertainty_percent=100 * math.hypot(*errors) / full if full else 0.0,
    )


def spread_sensors(entry: SuiteCase) -> SensorTable:
    """SENSOR_COUNT of the scene's sensors, evenly spread over them, the first and the last included."""
    table = scene_sensors(entry.scene)
    if table is None:
        raise ValueError(f"{entry.scene.name} has no sensors")
    count = min(SENSOR_COUNT, len(table.points))
    rows = np.unique(np.linspace(0, len(table.points) - 1, count).round().astype(int))
    return SensorTable(tuple(table.sets[row] for row in rows), table.points[rows], table.normals[rows])


def sensors_of(entry: SuiteCase, renderer: str, options: Mapping[str, Any]) -> Bundle | None:
    case = make_case(entry.scene, entry.condition, load_renderer(renderer), options, sensors=spread_sensors(entry))
    return find_bundle(case)


def value_of(table: SensorTable, index: int) -> tuple[float, float]:
    if table.illuminance is None or table.standard_error is None:
        raise ValueError("sensors without values cannot be compared")
    return float(table.illuminance[index]), float(table.standard_error[index])


def absent(entry: SuiteCase, view: str, what: str) -> Missing:
    message = "not rendered: transom run crosscheck"
    return Missing(Outcome.NO_REFERENCE, entry.scene.name, view, entry.condition.name, what, message)

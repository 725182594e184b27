"""comparison.json: everything that was measured on a suite, between rendering and judging."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from scipy import ndimage

from transom.colour import luminance
from transom.compare import ImageComparison, SensorComparison
from transom.errors import InputError, invalid_field
from transom.files import write_atomic
from transom.judge import Missing, Subject
from transom.renderer import ImageResult
from transom.visible import EXTERIOR

COMPARISON_FORMAT = 1

DISAGREEMENT_SHARE = 0.01
"""Two visibility methods disagree on a pixel where their luminances differ by more than this share."""

EDGE_SHARE = 0.1
"""A pixel is at a sun edge where direct sunlight varies by this share of its maximum within 3x3 pixels around it."""


@dataclass(frozen=True)
class MethodAgreement:
    """Shadow volumes against shadow rays on one view: pixels whose luminances differ by more than 1 %, those of them
    further than one pixel from an edge of direct sunlight, and the differing share of all pixels [%]."""

    scene: str
    view: str
    condition: str
    pixel_count: int
    differing_count: int
    away_from_edges_count: int
    differing_percent: float
    away_from_edges_percent: float


@dataclass(frozen=True)
class AnalyticComparison:
    """One quantity of a scene with a known answer: ours, the truth and its uncertainty, and where the truth is from.

    program: whose value it is ("engine", "mitsuba", "radiance"). error_uncertainty_percent, batch_count: of the
    program's own noise, 0 where it has none.
    """

    scene: str
    quantity: str
    unit: str
    value: float
    truth: float
    truth_uncertainty: float
    error_percent: float
    source: str
    program: str = "engine"
    error_uncertainty_percent: float = 0.0
    batch_count: int = 0
    physics: str = "closed form"


@dataclass(frozen=True)
class CrossCheck:
    """One quantity of one case by two references, which must agree before either judges the engine.

    first, second: renderers with their preset ("radiance accurate"). view: "" for sensors. quantity: "image mean",
    "image blocks" (root mean square relative difference of blocks, noise removed), "sensor" (mean relative difference
    over a scene's checked sensors; each is in the note). difference_percent: of first from second, signed where the
    quantity has a sign. physics: "matched" (what the engine simplifies, they simplify too) or "full". note: what
    explains a difference that is larger, and what is too noisy to be judged.
    """

    scene: str
    view: str
    region: str
    condition: str
    quantity: str
    unit: str
    physics: str
    first: str
    second: str
    first_value: float
    second_value: float
    difference_percent: float
    uncertainty_percent: float
    batch_count: int = 0
    note: str = ""


@dataclass(frozen=True)
class ModelError:
    """What the method's simplifications cost: the matched reference against the full physics, on one quantity [%]."""

    scene: str
    view: str
    region: str
    condition: str
    quantity: str
    unit: str
    matched: float
    full: float
    model_error_percent: float
    uncertainty_percent: float


@dataclass(frozen=True)
class LadderStep:
    """One step of raising a reference's parameters until its picture stays constant, as the method's paper did.

    change_percent: mean |relative change| of pixels from the step before, None at the first. difference_percent and
    bias_percent: from Mitsuba's reference. seconds: wall time of the rendering.
    """

    scene: str
    view: str
    condition: str
    program: str
    step: int
    options: str
    seconds: float
    change_percent: float | None
    difference_percent: float
    bias_percent: float


@dataclass(frozen=True)
class HardCase:
    """One claim about one hard case: what was expected, and whether it held, with what was seen."""

    case: str
    group: str
    claim: str
    expectation: str
    holds: bool
    seen: str
    seconds: float


@dataclass(frozen=True)
class Comparison:
    """All measurements of one suite."""

    format: int
    suite: str
    title: str
    images: tuple[ImageComparison, ...] = ()
    sensors: tuple[SensorComparison, ...] = ()
    agreements: tuple[MethodAgreement, ...] = ()
    analytic: tuple[AnalyticComparison, ...] = ()
    crosschecks: tuple[CrossCheck, ...] = ()
    model_errors: tuple[ModelError, ...] = ()
    ladder: tuple[LadderStep, ...] = ()
    hard_cases: tuple[HardCase, ...] = ()
    missing: tuple[Missing, ...] = ()

    def subjects(self) -> list[Subject]:
        """What there is to judge. Signed differences; a mean relative error counts as a difference from zero.

        Directly seen sky and ground are reported and not judged: they say nothing of light transport.
        """
        found: list[Subject] = []
        for row in self.images:
            if row.region != EXTERIOR:
                found += _image_subjects(row)
        for sensor in self.sensors:
            place = (sensor.scene, "", sensor.set, sensor.condition, sensor.method, sensor.reference)
            error, noise = sensor.error_percent, sensor.error_standard_error_percent
            numerical, batches = sensor.error_numerical_percent or 0.0, sensor.reference_batch_count
            subject = Subject("sensor_percent", *place, error, noise, numerical, batches, fault=sensor.fault)
            found.append(subject)
        for pair in self.agreements:
            place = (pair.scene, pair.view, "", pair.condition, "volumes", "rays")
            found.append(Subject("agreement_percent", *place, pair.away_from_edges_percent))
        for entry in self.analytic:
            place = (entry.scene, "", entry.quantity, "", entry.program, entry.source)
            noise = 100 * entry.truth_uncertainty / abs(entry.truth) if entry.truth else 0.0
            noise = math.hypot(noise, entry.error_uncertainty_percent)
            found.append(Subject("analytic_percent", *place, entry.error_percent, noise, batch_count=entry.batch_count))
        for check in self.crosschecks:
            pair_name = f"{check.first}, {check.physics}"
            place = (check.scene, check.view, check.region, check.condition, pair_name, check.second)
            quantity = "crosscheck_sensor_percent" if check.quantity == "sensor" else "crosscheck_image_percent"
            difference, noise = check.difference_percent, check.uncertainty_percent
            found.append(Subject(quantity, *place, difference, noise, batch_count=check.batch_count))
        for claim in self.hard_cases:
            place = (claim.case, "", claim.claim, claim.group, "", "expectation")
            found.append(Subject("broken_claims", *place, 0.0 if claim.holds else 1.0))
        return found


def _image_subjects(row: ImageComparison) -> list[Subject]:
    """The scales at which a region is judged: pixels, the image mean, and blocks."""
    place = (row.scene, row.view, row.region, row.condition, row.method, row.reference)
    measured = {
        "mean_relative_error_percent": (
            row.mean_relative_error_percent,
            row.mean_relative_error_standard_error_percent,
            row.mean_relative_error_extrapolation_percent,
            row.mean_relative_error_numerical_percent,
        ),
        "bias_percent": (row.bias_percent, row.bias_standard_error_percent, 0.0, row.bias_numerical_percent),
        "block_p95_percent": (
            row.block_p95_percent,
            row.block_p95_standard_error_percent,
            row.block_p95_extrapolation_percent,
            row.block_p95_numerical_percent,
        ),
    }
    return [
        Subject(
            quantity,
            *place,
            difference=value,
            uncertainty=noise,
            numerical_bias=numerical or 0.0,
            batch_count=row.reference_batch_count,
            group_count=row.reference_group_count,
            noise_bias=noise_bias,
            fault=row.fault,
        )
        for quantity, (value, noise, noise_bias, numerical) in measured.items()
    ]


def reference_kind(physics: str) -> str:
    """What agreement with a reference shows: "validation" against the full physics; "verification" against one that
    shares the engine's simplifications or is a closed form (the code solves its equations)."""
    return "validation" if physics == "full" else "verification"


def compare_methods(scene: str, view: str, condition: str, volumes: ImageResult, rays: ImageResult) -> MethodAgreement:
    """Agreement of the two visibility methods. Raises ValueError for pictures of different size."""
    if volumes.mean.shape != rays.mean.shape:
        raise ValueError(f"pictures of {volumes.mean.shape} and {rays.mean.shape} cannot be compared")
    ours, theirs = luminance(volumes.mean), luminance(rays.mean)
    differing = np.abs(ours - theirs) > DISAGREEMENT_SHARE * np.maximum(ours, theirs)
    away = differing & ~ndimage.binary_dilation(_sun_edges(volumes) | _sun_edges(rays), np.ones((3, 3)))
    count = differing.size
    return MethodAgreement(
        scene=scene,
        view=view,
        condition=condition,
        pixel_count=count,
        differing_count=int(differing.sum()),
        away_from_edges_count=int(away.sum()),
        differing_percent=100 * float(differing.mean()),
        away_from_edges_percent=100 * float(away.mean()),
    )


def write_comparison(path: Path, comparison: Comparison) -> None:
    """Numbers that are not finite are kept (as NaN and Infinity), so that they are judged and not lost."""
    plain = TypeAdapter(Comparison).dump_python(comparison)
    write_atomic(path, json.dumps(plain, indent=1, ensure_ascii=False) + "\n")


def read_comparison(path: Path) -> Comparison:
    """Raises InputError for a file that is missing or not a comparison of this format."""
    if not path.is_file():
        raise InputError("does not exist", file=path, remedy="Compare the suite first: transom compare SUITE")
    try:
        comparison = TypeAdapter(Comparison).validate_json(path.read_bytes())
    except ValidationError as error:
        raise invalid_field(error, path) from error
    if comparison.format != COMPARISON_FORMAT:
        remedy = "Compare the suite again: transom compare SUITE"
        raise InputError("is of another version", file=path, field="format", value=comparison.format, remedy=remedy)
    return comparison


def _sun_edges(image: ImageResult) -> NDArray[np.bool_]:
    sun = image.components.get("sun")
    if sun is None:
        return np.zeros(image.mean.shape[:2], bool)
    values = luminance(sun)
    highest, lowest = ndimage.maximum_filter(values, 3), ndimage.minimum_filter(values, 3)
    edges: NDArray[np.bool_] = highest - lowest > EDGE_SHARE * highest
    return edges

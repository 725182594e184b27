"""Compares two answers to one case: error measures with their uncertainties, and no opinion.

The measures of a picture are in transom.error_measures. A value of the engine that is not finite counts as 0 and is
named as a fault of its row; one of the reference is an error, since nothing can be judged by it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.error_measures import (
    Region,
    block_error_quantiles,
    block_errors,
    cross_half_mse,
    mean_relative_error,
    signed_relative_error,
)
from transom.errors import InputError
from transom.noise import FLOOR_SHARE, floor_cd_m2
from transom.renderer import ImageResult
from transom.sensor_file import SensorTable

__all__ = [
    "CaseNames",
    "ImageComparison",
    "SensorComparison",
    "block_errors",
    "compare_images",
    "compare_region",
    "compare_sensors",
    "cross_half_mse",
    "signed_relative_error",
]

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

SHARE_LIMITS_PERCENT = (2.0, 5.0, 10.0)


@dataclass(frozen=True)
class ImageComparison:
    """One region of one view. All errors in percent; signed ones are ours minus the reference's.

    reference_mean_standard_error_cd_m2: of the region's mean. reference_standard_error_percent: mean over the pixels of
    the reference's own relative standard error. mean_relative_error_percent, block_*: extrapolated to no noise, with
    its standard error; *_extrapolation: bound on what that left of the noise; *_raw: against the noisy reference.
    block_*: quantiles
    of |relative error| over blocks of 4x4 pixels. pixel_*, share_within_*: of pixels, raw. relative_rmse_percent: from
    independent halves, unbiased by noise, as a share of the reference's mean; None where it is below the noise.
    dark_pixel_count: pixels where the reference is below the floor; light_leak_percent: our light in excess there, as a
    share of all light of the region. *_numerical_percent: the engine's own numerical bias of that quantity, from a
    solve with half as many patches; None where it was not estimated. physics: of the reference, "matched" or "full".
    reference_group_count: groups of batches whose spread the uncertainty of the mean is from. fault: what makes the
    engine's picture wrong whatever the reference says, "" for nothing.
    """

    scene: str
    view: str
    region: str
    condition: str
    method: str
    reference: str
    pixel_count: int
    floor_cd_m2: float
    engine_mean_cd_m2: float
    reference_mean_cd_m2: float
    reference_mean_standard_error_cd_m2: float
    reference_standard_error_percent: float
    mean_relative_error_percent: float
    mean_relative_error_raw_percent: float
    mean_relative_error_standard_error_percent: float
    bias_percent: float
    bias_standard_error_percent: float
    relative_rmse_percent: float | None
    block_p50_percent: float
    block_p95_percent: float
    block_p99_percent: float
    share_within_2_percent: float
    share_within_5_percent: float
    share_within_10_percent: float
    reference_batch_count: int
    mean_relative_error_numerical_percent: float | None = None
    bias_numerical_percent: float | None = None
    engine_key: str = ""
    reference_key: str = ""
    block_p95_raw_percent: float = 0.0
    block_p95_standard_error_percent: float = 0.0
    block_p95_numerical_percent: float | None = None
    mean_relative_error_extrapolation_percent: float = 0.0
    block_p95_extrapolation_percent: float = 0.0
    pixel_p50_percent: float = 0.0
    pixel_p95_percent: float = 0.0
    pixel_p99_percent: float = 0.0
    dark_pixel_count: int = 0
    light_leak_percent: float = 0.0
    physics: str = "matched"
    reference_group_count: int = 0
    fault: str = ""


@dataclass(frozen=True)
class SensorComparison:
    """One sensor: place [m], illuminances [lx], and the signed relative error [%].

    The error is relative to the reference, or to 1 % of the median of all sensors where that is more.
    error_numerical_percent, physics, fault: as for images.
    """

    scene: str
    set: str
    index: int
    condition: str
    method: str
    reference: str
    x_m: float
    y_m: float
    z_m: float
    engine_lx: float
    reference_lx: float
    reference_standard_error_lx: float
    error_percent: float
    error_standard_error_percent: float
    reference_batch_count: int
    error_numerical_percent: float | None = None
    engine_key: str = ""
    reference_key: str = ""
    physics: str = "matched"
    fault: str = ""


@dataclass(frozen=True)
class CaseNames:
    """What a comparison is of. reference_means: by region, the reference's mean luminance [cd/m²] in each of several
    groups of batches, from which the uncertainty of its mean is known whatever its pixels have in common.
    reference_file: for errors. physics: "matched" to the engine's simplifications, or "full"."""

    scene: str
    condition: str
    method: str
    reference: str
    view: str = ""
    engine_key: str = ""
    reference_key: str = ""
    reference_batch_count: int = 0
    reference_means: Mapping[str, Sequence[float]] = field(default_factory=dict)
    reference_file: str = ""
    physics: str = "matched"


def compare_region(
    engine: ImageResult,
    reference: ImageResult,
    mask: Bool,
    region: str,
    names: CaseNames,
    coarse: ImageResult | None = None,
) -> ImageComparison:
    """Compares the pixels in `mask` (h, w). coarse: the engine's picture from half as many patches, if there is one.

    Raises ValueError for an empty mask or pictures of different size, InputError for a reference that is not finite.
    """
    if engine.mean.shape != reference.mean.shape:
        raise ValueError(f"pictures of {engine.mean.shape} and {reference.mean.shape} cannot be compared")
    if not mask.any():
        raise ValueError(f"region {region} has no pixel")
    sample, fault, group_count, mean_error = _sampled(engine, reference, mask, region, names)
    ours, theirs, floor = sample.ours[mask], sample.reference[mask], sample.floor
    mean = float(theirs.mean())
    bias = _relative_difference(float(ours.mean()), mean)
    error = mean_relative_error(sample)
    pixels = np.abs(signed_relative_error(ours, theirs, floor))
    blocks = block_error_quantiles(sample)
    mse = cross_half_mse(ours, sample.halves[0][mask], sample.halves[1][mask])
    numerical = _numerical_percent(sample, coarse) if coarse is not None else (None, None, None)
    dark = theirs < floor
    within = [100 * float(np.mean(pixels <= limit / 100)) for limit in SHARE_LIMITS_PERCENT]
    quantiles = [100 * float(value) for value in np.percentile(pixels, [50, 95, 99])]
    return ImageComparison(
        scene=names.scene,
        view=names.view,
        region=region,
        condition=names.condition,
        method=names.method,
        reference=names.reference,
        pixel_count=len(theirs),
        floor_cd_m2=floor,
        engine_mean_cd_m2=float(ours.mean()),
        reference_mean_cd_m2=mean,
        reference_mean_standard_error_cd_m2=mean_error,
        reference_standard_error_percent=100 * float(np.mean(_ratio(sample.noise[mask], theirs + floor))),
        mean_relative_error_percent=100 * error.value,
        mean_relative_error_raw_percent=100 * error.raw,
        mean_relative_error_standard_error_percent=100 * error.standard_error,
        bias_percent=100 * bias,
        bias_standard_error_percent=100 * max(1.0, 1 + bias) * sample.level_error,
        relative_rmse_percent=100 * float(np.sqrt(mse)) / mean if mse >= 0 and mean > 0 else None,
        block_p50_percent=100 * blocks[0].value,
        block_p95_percent=100 * blocks[1].value,
        block_p99_percent=100 * blocks[2].value,
        share_within_2_percent=within[0],
        share_within_5_percent=within[1],
        share_within_10_percent=within[2],
        reference_batch_count=names.reference_batch_count,
        mean_relative_error_numerical_percent=numerical[0],
        bias_numerical_percent=numerical[1],
        engine_key=names.engine_key,
        reference_key=names.reference_key,
        block_p95_raw_percent=100 * blocks[1].raw,
        block_p95_standard_error_percent=100 * blocks[1].standard_error,
        block_p95_numerical_percent=numerical[2],
        mean_relative_error_extrapolation_percent=100 * error.extrapolation,
        block_p95_extrapolation_percent=100 * blocks[1].extrapolation,
        pixel_p50_percent=quantiles[0],
        pixel_p95_percent=quantiles[1],
        pixel_p99_percent=quantiles[2],
        dark_pixel_count=int(dark.sum()),
        light_leak_percent=100 * float(np.maximum(ours - theirs, 0)[dark].sum() / theirs.sum()) if mean > 0 else 0.0,
        physics=names.physics,
        reference_group_count=group_count,
        fault=fault,
    )


def compare_images(
    engine: ImageResult,
    reference: ImageResult,
    masks: Mapping[str, Bool],
    names: CaseNames,
    coarse: ImageResult | None = None,
) -> list[ImageComparison]:
    """Region by region; masks by name, as of `transom.visible.region_masks`. A region without a pixel has no row."""
    return [compare_region(engine, reference, mask, name, names, coarse) for name, mask in masks.items() if mask.any()]


def compare_sensors(
    engine: SensorTable, reference: SensorTable, names: CaseNames, coarse: SensorTable | None = None
) -> list[SensorComparison]:
    """Sensor by sensor. coarse: the engine's values from half as many patches, if there are any.

    Raises ValueError when the tables are not of the same, measured, sensors, InputError for a reference that is not
    finite.
    """
    if engine.illuminance is None or reference.illuminance is None or reference.standard_error is None:
        raise ValueError("sensors without values cannot be compared")
    if engine.points.shape != reference.points.shape or not np.allclose(engine.points, reference.points, atol=1e-6):
        raise ValueError("the two tables are of different sensors")
    if not (np.isfinite(reference.illuminance).all() and np.isfinite(reference.standard_error).all()):
        raise _not_finite_reference(names, "illuminance")
    floor = FLOOR_SHARE * float(np.median(reference.illuminance))
    rows: list[SensorComparison] = []
    for index, (name, point) in enumerate(zip(reference.sets, reference.points, strict=True)):
        measured, theirs = float(engine.illuminance[index]), float(reference.illuminance[index])
        ours, fault = (measured, "") if np.isfinite(measured) else (0.0, f"illuminance of the engine is {measured}")
        error = float(reference.standard_error[index])
        # Without any light in the reference, light of the engine is an error of 100 %.
        scale = max(theirs, floor) or abs(ours) or 1.0
        rough = None if coarse is None or coarse.illuminance is None else float(coarse.illuminance[index])
        rows.append(
            SensorComparison(
                scene=names.scene,
                set=name,
                index=index,
                condition=names.condition,
                method=names.method,
                reference=names.reference,
                x_m=float(point[0]),
                y_m=float(point[1]),
                z_m=float(point[2]),
                engine_lx=ours,
                reference_lx=theirs,
                reference_standard_error_lx=error,
                error_percent=100 * (ours - theirs) / scale,
                error_standard_error_percent=100 * error / scale * max(1.0, ours / scale),
                reference_batch_count=names.reference_batch_count,
                error_numerical_percent=None if rough is None else 100 * abs(ours - rough) / scale,
                engine_key=names.engine_key,
                reference_key=names.reference_key,
                physics=names.physics,
                fault=fault,
            )
        )
    return rows


def _sampled(
    engine: ImageResult, reference: ImageResult, mask: Bool, region: str, names: CaseNames
) -> tuple[Region, str, int, float]:
    """The luminances to compare, the engine's fault, how many groups of batches the reference's mean is known from,
    and the standard error of that mean [cd/m²]."""
    ours, theirs = (luminance(picture.mean).astype(np.float64) for picture in (engine, reference))
    broken = int(np.count_nonzero(~np.isfinite(ours[mask])))
    fault = f"{broken} of {np.count_nonzero(mask)} pixels of the engine are not finite" if broken else ""
    halves = (theirs, theirs)
    if reference.halves is not None:
        first, second = (luminance(half).astype(np.float64) for half in reference.halves)
        halves = (first, second)
    noise = np.zeros_like(theirs)
    if reference.standard_error is not None:
        noise = reference.standard_error.astype(np.float64)
    if not all(np.isfinite(picture[mask]).all() for picture in (theirs, noise, *halves)):
        raise _not_finite_reference(names, "image.exr")
    groups = names.reference_means.get(region, ())
    if len(groups) < 2 and reference.halves is not None:
        groups = [float(half[mask].mean()) for half in halves]
    mean_error = _mean_standard_error(groups, noise[mask])
    mean = float(theirs[mask].mean())
    sample = Region(
        ours=np.nan_to_num(ours, nan=0.0, posinf=0.0, neginf=0.0),
        reference=theirs,
        halves=halves,
        noise=noise,
        mask=mask,
        floor=floor_cd_m2(theirs[mask]),
        level_error=mean_error / mean if mean > 0 else 0.0,
    )
    return sample, fault, len(groups), mean_error


def _numerical_percent(sample: Region, coarse: ImageResult) -> tuple[float, float, float]:
    """How far mean relative error, bias and 95th percentile of blocks move with half as many patches [%]."""
    mask, floor = sample.mask, sample.floor
    rough = np.nan_to_num(luminance(coarse.mean).astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    errors, biases, tails = [], [], []
    for image in (sample.ours, rough):
        errors.append(float(np.abs(signed_relative_error(image[mask], sample.reference[mask], floor)).mean()))
        biases.append(_relative_difference(float(image[mask].mean()), float(sample.reference[mask].mean())))
        blocks = block_errors(image, sample.reference, mask, floor)
        tails.append(float(np.percentile(blocks, 95)))
    error, bias, tail = (100 * abs(pair[0] - pair[1]) for pair in (errors, biases, tails))
    return error, bias, tail


def _relative_difference(ours: float, reference: float) -> float:
    """Of two means; 1 where the reference is black and ours is not."""
    if reference > 0:
        return ours / reference - 1
    return 1.0 if ours > 0 else 0.0


def _mean_standard_error(group_means: Sequence[float], noise: Float64) -> float:
    """Standard error of the reference's mean luminance [cd/m²]: from its spread over groups of batches (two halves at
    least), and never less than what independent pixels would have."""
    independent = float(np.sqrt(np.sum(noise**2))) / len(noise)
    if len(group_means) < 2:
        return independent
    return max(independent, float(np.std(group_means, ddof=1) / np.sqrt(len(group_means))))


def _not_finite_reference(names: CaseNames, what: str) -> InputError:
    return InputError(
        "holds values that are not finite: nothing can be judged by it",
        file=names.reference_file or names.reference_key or names.reference,
        field=what,
        remedy="Delete the bundle and render it again: transom run references",
    )


def _ratio(values: Float64, scale: Float64) -> Float64:
    return np.divide(values, scale, out=np.zeros_like(values), where=scale > 0)

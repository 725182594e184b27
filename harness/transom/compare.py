"""Compares two answers to one case: error measures with their uncertainties, and no opinion.

Every relative error of a pixel is |L - R| / (R + floor), with a floor of 1 % of the median of R (transom.noise).
A noisy reference R inflates it. It is therefore given raw, and extrapolated to a reference without noise: with
independent halves R1 and R2 of N/2 samples each, the inflation is close to proportional to the variance, so
    error(no noise) = 2 error(N) - error(N/2),
where error(N/2) is the mean over the two halves. The true value lies between the two (the inflation is concave in the
variance where noise dominates, and then the extrapolation removes too little of it, not too much).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from transom.colour import luminance
from transom.noise import floor_cd_m2
from transom.renderer import ImageResult
from transom.sensor_file import SensorTable

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

BLOCK_PIXELS = 4
"""Side of the blocks whose mean luminances are compared."""

LEAST_GROUPS = 8
"""Fewer groups of batches say too little about a standard error."""

SHARE_LIMITS_PERCENT = (2.0, 5.0, 10.0)


@dataclass(frozen=True)
class ImageComparison:
    """One region of one view. All errors in percent; signed ones are ours minus the reference's.

    reference_mean_standard_error_cd_m2: of the region's mean. reference_standard_error_percent: mean over the pixels of
    the reference's own relative standard error. mean_relative_error_percent: extrapolated to no noise; its standard
    error bounds what the noise can do to it. relative_rmse_percent: from independent halves, unbiased by noise, as a
    share of the reference's mean; None where it is below the noise. block_*: quantiles of |relative error| over
    blocks of 4x4 pixels. share_within_*: of pixels. *_numerical_percent: the engine's own numerical bias of that
    quantity, from a solve with half as many patches; None where it was not estimated.
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


@dataclass(frozen=True)
class SensorComparison:
    """One sensor: place [m], illuminances [lx], and the signed relative error [%].

    error_numerical_percent: as for images, the engine's own numerical bias, None where it was not estimated.
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


@dataclass(frozen=True)
class CaseNames:
    """What a comparison is of. reference_means: by region, the reference's mean luminance [cd/m²] in each of several
    groups of batches, from which the uncertainty of its mean is known whatever its pixels have in common."""

    scene: str
    condition: str
    method: str
    reference: str
    view: str = ""
    engine_key: str = ""
    reference_key: str = ""
    reference_batch_count: int = 0
    reference_means: Mapping[str, Sequence[float]] = field(default_factory=dict)


def cross_half_mse(engine: Float64, half_1: Float64, half_2: Float64) -> float:
    """Mean squared luminance error, unbiased by the reference's noise [(cd/m²)²].

    half_1, half_2: independent estimates of one reference, any one shape, cd/m². E[(E - R1)(E - R2)] = (E - R)², since
    the two noises are independent. May be negative: then the error is below the noise.
    """
    return float(np.mean((engine - half_1) * (engine - half_2)))


def signed_relative_error(engine: Float64, reference: Float64, floor: float) -> Float64:
    """(E - R) / (R + floor), elementwise; 0 where both are black."""
    scale = reference + floor
    difference = engine - reference
    return np.divide(difference, scale, out=np.zeros_like(difference), where=scale > 0)


def block_errors(engine: Float64, reference: Float64, mask: Bool, floor: float) -> Float64:
    """|relative error| of the mean luminance of 4x4 pixel blocks, (B,). Blocks with half of their pixels in `mask` or
    more count, by those pixels."""
    counts = _block_sums(mask.astype(np.float64))
    kept = counts >= BLOCK_PIXELS**2 / 2
    ours = _block_sums(np.where(mask, engine, 0.0))[kept] / counts[kept]
    theirs = _block_sums(np.where(mask, reference, 0.0))[kept] / counts[kept]
    return np.abs(signed_relative_error(ours, theirs, floor))


def compare_region(
    engine: ImageResult,
    reference: ImageResult,
    mask: Bool,
    region: str,
    names: CaseNames,
    coarse: ImageResult | None = None,
) -> ImageComparison:
    """Compares the pixels in `mask` (h, w). coarse: the engine's picture from half as many patches, if there is one.

    Raises ValueError for an empty mask or pictures of different size.
    """
    if engine.mean.shape != reference.mean.shape:
        raise ValueError(f"pictures of {engine.mean.shape} and {reference.mean.shape} cannot be compared")
    if not mask.any():
        raise ValueError(f"region {region} has no pixel")
    ours_image = luminance(engine.mean).astype(np.float64)
    theirs_image = luminance(reference.mean).astype(np.float64)
    ours, theirs = ours_image[mask], theirs_image[mask]
    floor = floor_cd_m2(theirs)
    halves = _half_luminances(reference, mask, theirs)
    error = np.abs(signed_relative_error(ours, theirs, floor))
    half_error = np.mean([np.abs(signed_relative_error(ours, half, floor)) for half in halves], axis=0)
    without_noise = 2 * error - half_error
    pixel_error = np.zeros(len(theirs)) if reference.standard_error is None else reference.standard_error[mask]
    mean, count = float(theirs.mean()), len(theirs)
    mean_error = _mean_standard_error(names.reference_means.get(region, ()), pixel_error, halves)
    relative_noise = _ratio(pixel_error, theirs + floor)
    # What the noise does to the mean of `without_noise`: to its first term, and to the extrapolation added to it.
    # What pixels have in common is in the mean's own uncertainty.
    spread = np.hypot(np.sqrt(np.mean(relative_noise**2)), np.std(error - half_error)) / np.sqrt(count)
    spread = np.hypot(spread, mean_error / mean if mean > 0 else 0.0)
    mse = cross_half_mse(ours, *halves)
    blocks = block_errors(ours_image, theirs_image, mask, floor)
    quantiles = np.percentile(blocks if blocks.size else error, [50, 95, 99])
    error_numerical, bias_numerical = None, None
    if coarse is not None:
        rough = luminance(coarse.mean).astype(np.float64)[mask]
        rough_error = np.abs(signed_relative_error(rough, theirs, floor))
        error_numerical = 100 * abs(float(error.mean() - rough_error.mean()))
        bias_numerical = 100 * abs(float(ours.mean() - rough.mean())) / mean if mean > 0 else 0.0
    within = [100 * float(np.mean(error <= limit / 100)) for limit in SHARE_LIMITS_PERCENT]
    return ImageComparison(
        scene=names.scene,
        view=names.view,
        region=region,
        condition=names.condition,
        method=names.method,
        reference=names.reference,
        pixel_count=count,
        floor_cd_m2=floor,
        engine_mean_cd_m2=float(ours.mean()),
        reference_mean_cd_m2=mean,
        reference_mean_standard_error_cd_m2=mean_error,
        reference_standard_error_percent=100 * float(np.mean(relative_noise)),
        mean_relative_error_percent=max(0.0, 100 * float(without_noise.mean())),
        mean_relative_error_raw_percent=100 * float(error.mean()),
        mean_relative_error_standard_error_percent=100 * float(spread),
        bias_percent=100 * (float(ours.mean()) / mean - 1) if mean > 0 else 0.0,
        bias_standard_error_percent=100 * mean_error / mean if mean > 0 else 0.0,
        relative_rmse_percent=100 * float(np.sqrt(mse)) / mean if mse >= 0 and mean > 0 else None,
        block_p50_percent=100 * float(quantiles[0]),
        block_p95_percent=100 * float(quantiles[1]),
        block_p99_percent=100 * float(quantiles[2]),
        share_within_2_percent=within[0],
        share_within_5_percent=within[1],
        share_within_10_percent=within[2],
        reference_batch_count=names.reference_batch_count,
        mean_relative_error_numerical_percent=error_numerical,
        bias_numerical_percent=bias_numerical,
        engine_key=names.engine_key,
        reference_key=names.reference_key,
    )


def compare_images(
    engine: ImageResult,
    reference: ImageResult,
    masks: Mapping[str, Bool],
    names: CaseNames,
    coarse: ImageResult | None = None,
) -> list[ImageComparison]:
    """Region by region; masks by name, as of `transom.visible.region_masks`."""
    return [compare_region(engine, reference, mask, name, names, coarse) for name, mask in masks.items()]


def compare_sensors(
    engine: SensorTable, reference: SensorTable, names: CaseNames, coarse: SensorTable | None = None
) -> list[SensorComparison]:
    """Sensor by sensor. coarse: the engine's values from half as many patches, if there are any.
    Raises ValueError when the tables are not of the same, measured, sensors."""
    if engine.illuminance is None or reference.illuminance is None or reference.standard_error is None:
        raise ValueError("sensors without values cannot be compared")
    if engine.points.shape != reference.points.shape or not np.allclose(engine.points, reference.points, atol=1e-6):
        raise ValueError("the two tables are of different sensors")
    rows: list[SensorComparison] = []
    for index, (name, point) in enumerate(zip(reference.sets, reference.points, strict=True)):
        ours, theirs = float(engine.illuminance[index]), float(reference.illuminance[index])
        error = float(reference.standard_error[index])
        scale = theirs if theirs > 0 else 1.0
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
                error_standard_error_percent=100 * error / scale,
                reference_batch_count=names.reference_batch_count,
                error_numerical_percent=None if rough is None else 100 * abs(ours - rough) / scale,
                engine_key=names.engine_key,
                reference_key=names.reference_key,
            )
        )
    return rows


def _mean_standard_error(
    group_means: Sequence[float], pixel_error: NDArray[np.floating], halves: tuple[Float64, Float64]
) -> float:
    """Standard error of the reference's mean luminance [cd/m²]: from its spread over groups of batches; without them
    the larger of what independent pixels would give and half the difference of the halves."""
    if len(group_means) >= LEAST_GROUPS:
        return float(np.std(group_means, ddof=1) / np.sqrt(len(group_means)))
    independent = float(np.sqrt(np.sum(pixel_error**2.0))) / len(pixel_error)
    return max(independent, abs(float(np.mean(halves[0] - halves[1]))) / 2)


def _half_luminances(reference: ImageResult, mask: Bool, mean: Float64) -> tuple[Float64, Float64]:
    if reference.halves is None:
        return mean, mean
    first, second = (luminance(half).astype(np.float64)[mask] for half in reference.halves)
    return first, second


def _block_sums(image: Float64) -> Float64:
    side = BLOCK_PIXELS
    height, width = (-(-length // side) * side for length in image.shape)
    padded = np.zeros((height, width))
    padded[: image.shape[0], : image.shape[1]] = image
    sums: Float64 = padded.reshape(height // side, side, width // side, side).sum(axis=(1, 3))
    return sums


def _ratio(values: NDArray[np.floating], scale: Float64) -> Float64:
    plain = np.asarray(values, np.float64)
    return np.divide(plain, scale, out=np.zeros_like(plain), where=scale > 0)

"""Adding batches to a finished reference, so that the answer is the one that all batches would have given at once; or,
where the integrator has changed between them, the mean of all, which is as right as each.

Batch i depends on the case and on i alone. A stored answer of batches 0 .. n-1 is therefore continued by batches n,
n+1, ...; of the stored ones it takes their means, halves and standard errors, which is all that pooling needs [Chan,
Golub and LeVeque 1983]. Stored pictures are half floats: each time, that moves a pixel by at most 2^-11 (0.05 %,
0.02 % on the mean) of its value, times the stored share of the batches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.bundle import BatchStore, Bundle, Case
from transom.colour import luminance
from transom.errors import InputError
from transom.renderer import ImageResult
from transom.scene.model import Scene, View
from transom.sensor_file import SensorTable
from transom.staging import RECORD
from transom.visible import region_masks

Float64 = NDArray[np.float64]

MEAN_GROUPS = 64
"""Groups of batches whose means are kept, for the uncertainty of a reference's mean. Batch i is of group i mod 64."""

HALVES_AGREE = 2.0**-9
"""Relative difference allowed between a stored mean and that of its halves: two roundings to half floats and some,
however often batches have been added, since the mean is then that of the halves."""

DARK_CD_M2 = 1e-4
"""The same in cd/m²: half floats below 6e-5 have fewer digits."""


@dataclass(frozen=True)
class FinishedBatches:
    """The answer of batches 0 .. count-1: a picture with the means of its regions by group of batches, or sensors."""

    count: int
    image: ImageResult | None
    sensors: SensorTable | None
    group_means: Mapping[str, Sequence[float]]


def finished_batches(bundle: Bundle, case: Case) -> FinishedBatches:
    """What a stored answer holds to go on from. Raises InputError for one that is damaged or contradicts itself."""
    facts = bundle.record.facts
    count = int(facts.get("batches", 0))
    _require(bundle, count >= 2, "does not say of how many batches it is")
    _require(bundle, bundle.record.effort.get("batches") == count, "has two numbers of batches")
    if case.view is None:
        table = bundle.sensors()
        _require(bundle, table.standard_error is not None, "has no standard error")
        _require(
            bundle, case.sensors is not None and len(table.points) == len(case.sensors.points), "has other sensors"
        )
        return FinishedBatches(count, None, table, {})
    image = bundle.image()
    _require(bundle, image.mean.shape[:2] == (case.view.height, case.view.width), "is of another size")
    _require(bundle, image.halves is not None and image.standard_error is not None, "has no halves or standard error")
    _require(bundle, _halves_agree(image, count), "has halves whose average is not its mean")
    groups: Mapping[str, Sequence[float]] = facts.get("group_means_cd_m2", {})
    sizes = {len(means) for means in groups.values()}
    _require(bundle, sizes == {min(count, MEAN_GROUPS)}, "lacks means of groups of batches, or has too many")
    return FinishedBatches(count, image, None, groups)


def pooled_image(before: FinishedBatches, later: ImageResult, count: int) -> ImageResult:
    """The picture of batches 0 .. count-1, from a finished one and the picture of those after it."""
    stored = before.image
    if stored is None or stored.halves is None or later.halves is None:
        raise ValueError("no two pictures with halves")
    n, m = before.count, count - before.count
    sizes_before, sizes = _half_sizes(before.count), _half_sizes(count)
    first, second = (
        _mean(stored.halves[half], sizes_before[half], later.halves[half], sizes[half] - sizes_before[half])
        for half in (0, 1)
    )
    error = _standard_error(
        (luminance(stored.mean), stored.standard_error, n), (luminance(later.mean), later.standard_error, m)
    )
    return ImageResult(
        _mean(first, sizes[0], second, sizes[1]).astype(np.float32),
        (first.astype(np.float32), second.astype(np.float32)),
        error.astype(np.float32),
        facts=later.facts,
    )


def pooled_sensors(before: FinishedBatches, later: SensorTable, count: int) -> SensorTable:
    """The illuminances of batches 0 .. count-1, from finished ones and those of the batches after them."""
    stored = before.sensors
    if stored is None or stored.illuminance is None or later.illuminance is None:
        raise ValueError("no two measured tables")
    n, m = before.count, count - before.count
    error = _standard_error(
        (stored.illuminance, stored.standard_error, n), (later.illuminance, later.standard_error, m)
    )
    return later.measured(_mean(stored.illuminance, n, later.illuminance, m), error)


def group_means(
    before: FinishedBatches | None, batches: BatchStore, count: int, scene: Scene, view: View
) -> dict[str, list[float]]:
    """By region, the mean luminance [cd/m²] of each of MEAN_GROUPS groups of batches 0 .. count-1.

    before: what is finished of them; the others are in `batches`, arrays `values` (h, w, 3). Batches are independent
    whatever their pixels have in common, so that the spread of these means is the noise's. Regions are no part of what
    a case is: one that was not there before, or was another part of the picture, is left out.
    """
    masks = region_masks(scene, view)
    if before is not None:
        masks = {region: mask for region, mask in masks.items() if _is_as_it_was(before, region, mask)}
    groups = min(count, MEAN_GROUPS)
    sums = {region: np.zeros(groups) for region in masks}
    if before is not None:
        sizes = _group_sizes(before.count)
        for region in masks:
            sums[region][: len(sizes)] = sizes * np.asarray(before.group_means[region])
    for index in range(batches.first, count):
        values = luminance(batches.load(index)["values"])
        for region, mask in masks.items():
            sums[region][index % MEAN_GROUPS] += values[mask].mean()
    return {region: [float(f"{v:.7g}") for v in total / _group_sizes(count)] for region, total in sums.items()}


def _is_as_it_was(before: FinishedBatches, region: str, mask: NDArray[np.bool_]) -> bool:
    """Whether a region's stored means are those of the same pixels of the stored picture."""
    if before.image is None or region not in before.group_means:
        return False
    stored = np.average(before.group_means[region], weights=_group_sizes(before.count))
    return bool(np.isclose(luminance(before.image.mean)[mask].mean(), stored, rtol=HALVES_AGREE, atol=DARK_CD_M2))


def _mean(one: NDArray[Any], n: int, other: NDArray[Any], m: int) -> Float64:
    return (n * np.asarray(one, np.float64) + m * np.asarray(other, np.float64)) / (n + m)


def _standard_error(one: tuple[Any, Any, int], other: tuple[Any, Any, int]) -> Float64:
    """Standard error of the mean over n + m batches, from (mean, standard error, number) of n and of m of them.

    Squared deviations from the common mean are those from each mean, n (n - 1) se², and n m / (n + m) times the means'
    squared difference.
    """
    (mean_1, error_1, n), (mean_2, error_2, m) = one, other
    within = n * (n - 1) * np.square(error_1, dtype=np.float64) + m * (m - 1) * np.square(error_2, dtype=np.float64)
    between = n * m / (n + m) * np.square(np.subtract(mean_1, mean_2, dtype=np.float64))
    return np.asarray(np.sqrt((within + between) / ((n + m) * (n + m - 1))))


def _half_sizes(count: int) -> tuple[int, int]:
    """How many of batches 0 .. count-1 are in the half of even numbers and in that of odd ones."""
    return (count + 1) // 2, count // 2


def _group_sizes(count: int) -> NDArray[np.intp]:
    return np.bincount(np.arange(count) % MEAN_GROUPS)


def _halves_agree(image: ImageResult, count: int) -> bool:
    assert image.halves is not None
    even, odd = _half_sizes(count)
    average = _mean(image.halves[0], even, image.halves[1], odd)
    return bool(np.allclose(average, image.mean, rtol=HALVES_AGREE, atol=DARK_CD_M2))


def _require(bundle: Bundle, holds: bool, problem: str) -> None:
    if not holds:
        remedy = f"Delete {bundle.folder}, or render it again (--fresh)"
        raise InputError(f"cannot be made quieter: it {problem}", file=bundle.folder / RECORD, remedy=remedy)

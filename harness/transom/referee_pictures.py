"""Pictures of referees side by side: at one size, by regions and blocks, with the noise of both taken into account."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from transom.bundle import Bundle, find_bundle, make_case
from transom.colour import luminance
from transom.error_measures import BLOCK_PIXELS
from transom.renderer import ImageResult, load_renderer
from transom.scene.model import View
from transom.suite import SuiteCase

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

REFERENCE_SCALE = 2
"""Pictures here are so many times smaller than the published references."""


LEAST_GROUPS = 8
"""Fewer groups of batches say too little about a standard error."""


def reference_picture(entry: SuiteCase, view: View) -> Bundle | None:
    """The published Mitsuba reference of a view, REFERENCE_SCALE times as large."""
    large = replace(view, width=REFERENCE_SCALE * view.width, height=REFERENCE_SCALE * view.height)
    return find_bundle(make_case(entry.scene, entry.condition, load_renderer("mitsuba"), {}, view=large))


def picture_of(entry: SuiteCase, view: View, renderer: str, options: Mapping[str, Any]) -> Bundle | None:
    """What a renderer made of a view, if it has."""
    return find_bundle(make_case(entry.scene, entry.condition, load_renderer(renderer), options, view=view))


def block_difference(
    first: ImageResult, second: ImageResult, mask: Bool, side: int = BLOCK_PIXELS
) -> tuple[float, float]:
    """Root mean square relative difference of the square blocks that lie in `mask`, and its uncertainty, as shares.

    From the halves of both, d1 d2 with d_i = R_i / T_i - 1: the noises of halves are independent, so that the mean
    product has no share of them. The uncertainty is a third of the way to the root three standard errors further up,
    since near zero the root is far from linear.
    """
    if first.halves is None or second.halves is None:
        raise ValueError("pictures without halves: their noise cannot be told from their difference")
    inside = _block_means(mask.astype(np.float64), side) > 0.999
    differences = [
        _block_means(luminance(ours), side)[inside] / _block_means(luminance(theirs), side)[inside] - 1
        for ours, theirs in zip(first.halves, second.halves, strict=True)
    ]
    product = differences[0] * differences[1]
    mean, error = float(product.mean()), float(product.std(ddof=1) / math.sqrt(product.size))
    value = math.sqrt(max(mean, 0.0))
    return value, (math.sqrt(max(mean, 0.0) + 3 * error) - value) / 3


def halved(image: ImageResult, scale: int = REFERENCE_SCALE) -> ImageResult:
    """A picture averaged over scale x scale pixels, its halves too; standard errors as of independent pixels."""

    def reduced(values: NDArray[np.floating]) -> NDArray[np.float32]:
        height, width = values.shape[0] // scale, values.shape[1] // scale
        shape = (height, scale, width, scale, *values.shape[2:])
        mean: NDArray[np.float32] = values[: height * scale, : width * scale].reshape(shape).mean(axis=(1, 3))
        return mean

    halves = None if image.halves is None else (reduced(image.halves[0]), reduced(image.halves[1]))
    error = None
    if image.standard_error is not None:
        error = (np.sqrt(reduced(image.standard_error**2)) / scale).astype(np.float32)
    return ImageResult(reduced(image.mean), halves, error, facts=image.facts)


def mean_error(image: ImageResult, mask: Bool, region: str) -> float:
    """Standard error of a region's mean luminance [cd/m²]: from its spread over groups of batches where that was kept
    (pixels of a batch have paths in common); else of independent pixels, or half the difference of the halves where
    that is more."""
    groups = image.facts.get("group_means_cd_m2", {}).get(region, ())
    if len(groups) >= LEAST_GROUPS:
        return float(np.std(groups, ddof=1) / math.sqrt(len(groups)))
    independent = 0.0
    if image.standard_error is not None:
        independent = float(np.sqrt(np.sum(image.standard_error[mask].astype(np.float64) ** 2))) / int(mask.sum())
    if image.halves is None:
        return independent
    difference = float((luminance(image.halves[0]) - luminance(image.halves[1]))[mask].mean())
    return max(independent, abs(difference) / 2)


def _block_means(image: Float64, side: int) -> Float64:
    height, width = (length // side for length in image.shape)
    means: Float64 = image[: height * side, : width * side].reshape(height, side, width, side).mean(axis=(1, 3))
    return means

"""Error measures of a picture against a noisy reference, each raw, without the noise's share, and with its uncertainty.

|L - R| is larger against a noisy R than against the truth. With independent halves R1 and R2 of N/2 samples each, the
inflation is close to proportional to the variance where the noise is smaller than the error, so that
    error(no noise) = 2 error(N) - error(N/2)
takes it away; error(N/2) is the mean over the two halves. (SIMEX: simulate what more noise does, extrapolate to none;
Cook and Stefanski 1994. Here the second noise level is measured, not simulated.) Where the noise is larger than the
error the inflation grows like its root, and the extrapolation leaves up to (2 - sqrt 2) of it. How much of that can be
left is bounded by a second estimate which noise can only make smaller: the error in one half, counted with the sign
that it has in the other half, whose noise is independent. The bound is kept apart from the standard error, since it is
a bias: the judge adds it to k u, not in quadrature (GUM, JCGM 100:2008, F.2.4.5: U = k u + b for a bias not corrected).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from transom.noise import standard_error_of_mean, tile_indices

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]

BLOCK_PIXELS = 4
"""Side of the blocks whose mean luminances are compared."""

BLOCK_QUANTILES = (50.0, 95.0, 99.0)

MEAN_EXCESS = (2 - math.sqrt(2)) * math.sqrt(2 / math.pi)
"""What extrapolation leaves of a mean |error| that is noise alone, in standard errors of a pixel: 0.467."""

MEAN_SHORTFALL = 0.094
"""What it takes too much at worst, where the error is 1.4 standard errors, in the same unit."""

QUANTILE_EXCESS = (2 - math.sqrt(2)) * 1.959964
"""What extrapolation leaves of the 95th percentile of |error| that is noise alone, in its standard errors: 1.148."""

SIGN_PIXELS = 5
"""The sign of the error is also looked up as that of its mean over 5x5 pixels: the engine's errors are smooth."""

NOISE_DRAWS = 64
"""Draws of the noise, by signs that are random from tile to tile, for the standard error of a quantile."""


@dataclass(frozen=True)
class Estimate:
    """A share (not percent): extrapolated to no noise, and as it is against the noisy reference; the standard error of
    the former by noise; and bound on what the extrapolation left or took too much."""

    value: float
    raw: float
    standard_error: float
    extrapolation: float


@dataclass(frozen=True)
class Region:
    """The luminances [cd/m²] of one region of a picture, (h, w) each; only pixels in `mask` count, and there are some.

    halves: independent estimates of the reference, each with half of its samples; the reference twice where it has no
    noise. noise: standard error of a pixel, all told. floor: added to denominators. level_error: relative standard
    uncertainty of the reference's mean over the region, that is of what all of its pixels have in common.
    """

    ours: Float64
    reference: Float64
    halves: tuple[Float64, Float64]
    noise: Float64
    mask: Bool
    floor: float
    level_error: float = 0.0


def cross_half_mse(engine: Float64, half_1: Float64, half_2: Float64) -> float:
    """Mean squared luminance error, unbiased by the reference's noise [(cd/m²)²].

    half_1, half_2: independent estimates of one reference, any one shape, cd/m². E[(E - R1)(E - R2)] = (E - R)², since
    the two noises are independent, whatever the pixels have in common. May be negative: the error is below the noise.
    """
    return float(np.mean((engine - half_1) * (engine - half_2)))


def signed_relative_error(engine: Float64, reference: Float64, floor: float) -> Float64:
    """(E - R) / (R + floor), elementwise. Where that has no denominator: 0 if both are black, else the sign (100 %)."""
    scale = reference + floor
    difference = engine - reference
    return np.divide(difference, scale, out=np.sign(difference), where=scale > 0)


def mean_relative_error(region: Region) -> Estimate:
    """Mean over the pixels of |L - R| / (R + floor)."""
    mask = region.mask
    ours, reference = region.ours[mask], region.reference[mask]
    signed = signed_relative_error(ours, reference, region.floor)
    scale = np.where(reference + region.floor > 0, reference + region.floor, np.inf)
    in_halves = [np.abs(ours - half[mask]) / scale for half in region.halves]
    error = np.abs(signed)
    inflation = np.where(np.isinf(scale), 0.0, np.mean(in_halves, axis=0) - error)
    raw, extrapolated = float(error.mean()), float(error.mean() - inflation.mean())
    noise = float(np.mean(region.noise[mask] / scale))
    tiles = tile_indices(mask)
    drawn = np.sign(signed) * (region.halves[0][mask] - region.halves[1][mask]) / (2 * scale)
    parts = (
        standard_error_of_mean(drawn, tiles),
        standard_error_of_mean(inflation - inflation.mean(), tiles),
        region.level_error,
    )
    standard_error = math.hypot(*parts)
    least = _least_mean_error(region) - standard_error
    # noise² is what noise in the denominator does at second order.
    excess = max(min(MEAN_EXCESS * noise, extrapolated - least), MEAN_SHORTFALL * noise) + noise**2
    return Estimate(max(0.0, extrapolated), raw, standard_error, excess)


def block_error_quantiles(region: Region, seed: int = 0) -> list[Estimate]:
    """BLOCK_QUANTILES of |relative error| of the mean luminances of 4x4 blocks. Blocks with half of their pixels in the
    region or more count, by those pixels; a region that has none counts as one block.

    What twice the variance would do comes from draws of the noise that are added to the differences: half the
    difference of the halves, with a random sign by tile (a wild bootstrap, Wu 1986, by clusters). It supposes that
    errors have no gap around the quantile: where a twentieth of the blocks is wrong and the others are right, no noisy
    reference can tell the 95th percentile.
    """
    kept, means = _block_means(region)
    ours, reference, half_1, half_2 = means
    signed = signed_relative_error(ours, reference, region.floor)
    scale = np.where(reference + region.floor > 0, reference + region.floor, np.inf)
    drawn = (half_1 - half_2) / (2 * scale)
    raw = np.percentile(np.abs(signed), BLOCK_QUANTILES)
    noise = math.hypot(float(np.sqrt(np.mean(drawn[np.abs(signed) >= raw[0]] ** 2))), region.level_error)
    signs = _tile_signs(kept, seed)
    draws = np.percentile(np.abs(signed + signs * drawn), BLOCK_QUANTILES, axis=1)
    extrapolated = np.clip(2 * raw - draws.mean(axis=1), 0.0, raw)
    # The extrapolated value is twice a quantile less its mean over more noise: it scatters up to twice as much.
    spread = 2 * np.std(draws, axis=1, ddof=1)
    left = QUANTILE_EXCESS * noise + noise**2
    return [
        Estimate(float(value), float(plain), math.hypot(width, (1 + value) * region.level_error), left)
        for value, plain, width in zip(extrapolated, raw, spread, strict=True)
    ]


def block_errors(engine: Float64, reference: Float64, mask: Bool, floor: float) -> Float64:
    """|relative error| of the mean luminance of 4x4 pixel blocks, (B,). Blocks with half of their pixels in `mask` or
    more count, by those pixels."""
    region = Region(engine, reference, (reference, reference), np.zeros_like(reference), mask, floor)
    _, (ours, theirs, _, _) = _block_means(region)
    return np.abs(signed_relative_error(ours, theirs, floor))


def _least_mean_error(region: Region) -> float:
    """A mean relative error that noise can only make smaller: E[s1 (L - R2)] = E[s1] (L - R) <= |L - R| for a sign s1
    found in the other half. The larger of what the signs of pixels and of 5x5 neighbourhoods give."""
    mask = region.mask
    scale = np.where(region.reference + region.floor > 0, region.reference + region.floor, np.inf)
    errors = [np.where(mask, (region.ours - half) / scale, 0.0) for half in region.halves]
    found = []
    for side in (1, SIGN_PIXELS):
        signs = [np.sign(ndimage.uniform_filter(error, side) if side > 1 else error) for error in errors]
        found.append(float(np.mean((signs[0] * errors[1] + signs[1] * errors[0])[mask]) / 2))
    return max(found)


def _block_means(region: Region) -> tuple[Bool, tuple[Float64, Float64, Float64, Float64]]:
    """Which blocks count, as an image of blocks, and their means (B,): ours, the reference's, its halves'."""
    counts = _block_sums(region.mask.astype(np.float64))
    kept = counts >= BLOCK_PIXELS**2 / 2
    images = (region.ours, region.reference, *region.halves)
    if not kept.any():
        alone = [np.array([image[region.mask].mean()]) for image in images]
        return np.ones((1, 1), bool), (alone[0], alone[1], alone[2], alone[3])
    means = [_block_sums(np.where(region.mask, image, 0.0))[kept] / counts[kept] for image in images]
    return kept, (means[0], means[1], means[2], means[3])


def _block_sums(image: Float64) -> Float64:
    side = BLOCK_PIXELS
    height, width = (-(-length // side) * side for length in image.shape)
    padded = np.zeros((height, width))
    padded[: image.shape[0], : image.shape[1]] = image
    sums: Float64 = padded.reshape(height // side, side, width // side, side).sum(axis=(1, 3))
    return sums


def _tile_signs(kept: Bool, seed: int) -> Float64:
    """Random signs, (NOISE_DRAWS, B) for B blocks that count, alike within a tile of blocks."""
    tiles = tile_indices(kept, BLOCK_PIXELS)
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (NOISE_DRAWS // 2, int(tiles.max()) + 1))
    return np.concatenate([signs, -signs])[:, tiles]

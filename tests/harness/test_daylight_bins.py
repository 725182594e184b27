"""The sky bins: their geometry, and the flux that their mean luminances carry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from transom.daylight import SkyBins, resolve_condition
from transom.daylight.sky_model import Floats
from transom.engine_scene import EngineSky
from transom.scene.model import ConditionSpec, Site

SITE = Site("London", math.radians(51.5), math.radians(-0.12), 0.0)


def test_first_subdivision_is_tregenzas() -> None:
    bins = SkyBins(1)
    assert bins.row_counts.tolist() == [30, 30, 24, 24, 18, 12, 6, 1]
    assert np.degrees(bins.row_altitude_edges) == pytest.approx([0, 12, 24, 36, 48, 60, 72, 84, 90])


@pytest.mark.parametrize("subdivision", [1, 2, 3, 4, 6])
def test_bins_cover_the_hemisphere_once(subdivision: int) -> None:
    bins = SkyBins(subdivision)
    assert bins.count == 144 * subdivision**2 + 1 == len(bins.directions)
    assert bins.solid_angles.sum() == pytest.approx(2 * math.pi, rel=1e-12)
    assert (bins.solid_angles * bins.mean_sin_altitude).sum() == pytest.approx(math.pi, rel=1e-12)
    assert np.linalg.norm(bins.directions, axis=1) == pytest.approx(np.ones(bins.count))


@pytest.mark.parametrize("subdivision", [1, 2, 4])
def test_means_are_taken_within_their_own_bins(subdivision: int) -> None:
    """Of the number of the bin that each node is in: it is found again only where all nodes of a bin are."""
    bins = SkyBins(subdivision)
    numbers = np.arange(bins.count)
    assert np.array_equal(bins.index(bins.directions), numbers)
    for power in (1, 2):  # the squares tell nodes that lie as far to one side as to the other
        found = bins.mean(
            lambda directions, power=power: bins.index(directions).astype(float) ** power, np.array([0.6, 0.0, 0.8])
        )
        assert found == pytest.approx(numbers.astype(float) ** power, abs=1e-6)


def test_means_beside_the_sun_and_at_the_horizon_are_those_of_many_nodes() -> None:
    """An indicatrix as steep as those of clear skies, on a gradation that ends at the horizon, against 40 x 40 cells
    of equal solid angle a bin."""
    sun = np.array([0.6, 0.0, 0.8])

    def luminance(directions: Floats) -> Floats:
        angle = np.arccos(np.clip(directions @ sun, -1, 1))
        clear: Floats = (1 - np.exp(-0.15 / directions[:, 2])) * (1 + 24 * np.exp(-2.8 * angle))
        return clear

    bins = SkyBins(4)
    row = np.repeat(np.arange(len(bins.row_counts)), bins.row_counts)
    step = (np.arange(40) + 0.5) / 40
    sines = np.sin(bins.row_altitude_edges)
    sine = (sines[:-1, None] + np.diff(sines)[:, None] * step)[row]
    azimuth = 2 * math.pi * ((np.arange(bins.count) - bins.row_offsets[row])[:, None] + step)
    azimuth /= bins.row_counts[row][:, None]
    across = np.sqrt(1 - sine**2)[:, :, None]
    shape = (bins.count, 40, 40)
    cells = np.stack(
        [
            across * np.cos(azimuth)[:, None],
            across * np.sin(azimuth)[:, None],
            np.broadcast_to(sine[:, :, None], shape),
        ],
        axis=-1,
    )
    exact = luminance(cells.reshape(-1, 3)).reshape(bins.count, -1).mean(axis=1)
    assert bins.mean(luminance, sun) == pytest.approx(exact, rel=2e-3)
    total = (bins.mean(luminance, sun) * bins.solid_angles).sum()
    assert total == pytest.approx((exact * bins.solid_angles).sum(), rel=3e-5)


def test_random_directions_fall_in_bins_by_solid_angle() -> None:
    """A million uniform directions; each share within 5 standard deviations of its binomial count."""
    bins, draws = SkyBins(1), 1_000_000
    rng = np.random.default_rng(3)
    sine, azimuth = rng.random(draws), 2 * math.pi * rng.random(draws)
    across = np.sqrt(1 - sine**2)
    counts = np.bincount(
        bins.index(np.stack([across * np.cos(azimuth), across * np.sin(azimuth), sine], axis=1)), minlength=bins.count
    )
    share = bins.solid_angles / (2 * math.pi)
    assert (np.abs(counts - draws * share) < 5 * np.sqrt(draws * share)).all()


def test_edges_belong_to_a_bin_and_the_ground_to_none() -> None:
    bins = SkyBins(2)
    directions = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [1, -1e-17, 0], [0, 0, -1], [1, 0, -1e-9]], dtype=float)
    assert bins.index(directions).tolist() == [0, 30, bins.count - 1, 59, -1, -1]


def test_a_bin_is_not_divided_into_nothing() -> None:
    with pytest.raises(ValueError, match="subdivision = 0"):
        SkyBins(0)


@pytest.mark.parametrize("sky", ["cie:1", "cie:5", "cie:12", "cie:15", "perez:700,90"])
@pytest.mark.parametrize(("subdivision", "tolerance"), [(1, 1.5e-2), (2, 4e-3), (4, 1e-3)])
def test_bins_give_the_skys_horizontal_illuminance(sky: str, subdivision: int, tolerance: float) -> None:
    """Sum of luminance x solid angle x cosine; the tolerance is the luminance's slope inside a bin, falling as m²."""
    condition = resolve_condition(ConditionSpec("a", "2026-03-21T10:00", sky), SITE)
    bins = SkyBins(subdivision)
    total = (condition.bin_luminance(bins) * bins.solid_angles * bins.mean_sin_altitude).sum()
    assert total == pytest.approx(condition.diffuse_horizontal_lx, rel=tolerance)


def test_bin_means_converge_to_one_sky_whatever_the_bins() -> None:
    """The flux of fine bins gathered into Tregenza's equals Tregenza's own, also beside the sun."""
    condition = resolve_condition(ConditionSpec("a", "2026-03-21T10:00", "cie:15"), SITE)
    coarse = SkyBins(1)
    flux = condition.bin_luminance(coarse) * coarse.solid_angles
    height, step = 900, math.pi / 2 / 900  # Bin edges fall between cells.
    altitude = (np.arange(height) + 0.5) * step
    azimuth = (np.arange(1440) + 0.5) * math.pi / 720
    gathered = np.zeros(coarse.count)
    for angle in altitude:
        across = math.cos(angle)
        row = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.full(1440, math.sin(angle))], axis=1)
        weight = condition.sky.luminance(row) * across * step * math.pi / 720
        gathered += np.bincount(coarse.index(row), weights=weight, minlength=coarse.count)
    assert gathered == pytest.approx(flux, rel=3e-4)


@pytest.mark.parametrize("sky", [*(f"cie:{number}" for number in range(1, 17)), "perez:700,90", "perez:30,200", "none"])
@pytest.mark.parametrize("time", ["2026-03-21T07:30", "2026-06-21T12:00"])
def test_the_engines_bins_are_those_of_double_precision(sky: str, time: str) -> None:
    """Its formula is written anew, in single precision: a low sun and a high one, steep bins and others."""
    condition = resolve_condition(ConditionSpec("a", time, sky), SITE)
    bins = SkyBins(4)
    fast = EngineSky(bins).luminance(condition)
    assert fast.dtype == np.float32
    assert fast == pytest.approx(condition.bin_luminance(bins), rel=1e-5)


def test_bins_turn_with_the_sky() -> None:
    """A uniform overcast sky has equal means along each row, so the choice of the first bin's azimuth is free."""
    condition = resolve_condition(ConditionSpec("a", "2026-03-21T10:00", "cie:1"), SITE)
    bins = SkyBins(2)
    luminance = condition.bin_luminance(bins)
    for offset, count in zip(bins.row_offsets, bins.row_counts, strict=True):
        assert luminance[offset : offset + count] == pytest.approx(np.full(count, luminance[offset]), rel=1e-9)

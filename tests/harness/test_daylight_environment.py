"""The environment image: what a bilinear reader of it sees is the analytic sky, and Mitsuba is such a reader."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import mitsuba
import numpy as np
import pytest
from numpy.typing import NDArray

from transom.daylight import Condition, resolve_condition
from transom.daylight.environment import dome_image
from transom.scene.model import ConditionSpec, Site

Float64 = NDArray[np.float64]

SITE = Site("London", math.radians(51.5), math.radians(-0.12), 0.0)
DAY = ConditionSpec("day", "2026-03-21T10:00")
NORMALS = {"up": (0, 0, 1), "east": (1, 0, 0), "north": (0, 1, 0), "west": (-1, 0, 0), "south": (0, -1, 0)}


def read_bilinear(image: Float64, theta: Float64, phi: Float64) -> Float64:
    """Rows at pi j / (H - 1), columns at 2 pi (i + 1/2) / W; returns (N, 3)."""
    height, width, _ = image.shape
    row = theta / math.pi * (height - 1)
    column = phi / (2 * math.pi) * width - 0.5
    j, i = np.clip(np.floor(row).astype(int), 0, height - 2), np.floor(column).astype(int)
    v, u = (row - j)[:, None], (column - i)[:, None]
    i, after = i % width, (i + 1) % width
    upper = image[j, i] * (1 - u) + image[j, after] * u
    lower = image[j + 1, i] * (1 - u) + image[j + 1, after] * u
    return np.asarray(upper * (1 - v) + lower * v, dtype=np.float64)


def fine_directions(height: int) -> tuple[Float64, Float64, Float64, Float64]:
    """theta, phi, unit vectors and solid angles of 2 x 2 points in every texel interval of an image."""
    theta_count, phi_count = 2 * (height - 1), 4 * height
    theta = (np.arange(theta_count) + 0.5) * math.pi / theta_count
    phi = (np.arange(phi_count) + 0.5) * 2 * math.pi / phi_count
    theta, phi = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    return theta, phi, directions, np.sin(theta) * math.pi / theta_count * 2 * math.pi / phi_count


def analytic_illuminance(condition: Condition, normal: tuple[float, float, float]) -> float:
    """By a midpoint rule in altitude from the horizon, so that no cell straddles it."""
    _, _, directions, solid_angle = fine_directions(257)  # An even number of rows: the horizon is a cell's edge.
    value = condition.sky.luminance(directions)
    value[directions[:, 2] < 0] = condition.ground_luminance_rgb[1]
    return float((value * np.maximum(directions @ np.array(normal, dtype=float), 0) * solid_angle).sum())


@pytest.mark.parametrize("sky", ["cie:1", "cie:12", "cie:15", "perez:850,70"])
@pytest.mark.parametrize("height", [256, 257])
def test_interpolated_image_gives_the_skys_illuminances(sky: str, height: int) -> None:
    """Horizontal and four vertical planes to 2e-4: the cost of bilinear interpolation and of the horizon's row."""
    condition = resolve_condition(replace(DAY, sky=sky), SITE)
    theta, phi, directions, solid_angle = fine_directions(height)
    seen = read_bilinear(condition.environment_image(height).astype(float), theta, phi)[:, 1]
    for name, normal in NORMALS.items():
        from_image = (seen * np.maximum(directions @ np.array(normal, dtype=float), 0) * solid_angle).sum()
        assert from_image == pytest.approx(analytic_illuminance(condition, normal), rel=2e-4), name


def test_even_image_has_no_row_on_the_horizon_and_odd_image_mixes_there() -> None:
    condition = resolve_condition(replace(DAY, sky="uniform"), SITE)
    even, odd = condition.environment_image(16), condition.environment_image(17)
    sky, ground = condition.sky.scale, condition.ground_luminance_rgb[0]
    assert even[:, 0, 0] == pytest.approx([sky] * 8 + [ground] * 8)
    assert odd[:, 0, 0] == pytest.approx([sky] * 8 + [(sky + ground) / 2] + [ground] * 8)


def test_image_carries_the_colours_of_sky_and_ground() -> None:
    condition = resolve_condition(replace(DAY, sun_colour_temperature_k=3000, sky_colour_temperature_k=9000), SITE)
    image = condition.environment_image(32)
    assert image.shape == (32, 64, 3)
    assert image.dtype == np.float32
    assert image[3] / image[3, :, 1:2] == pytest.approx(
        np.broadcast_to(condition.sky_rgb / condition.sky_rgb[1], (64, 3))
    )
    assert image[-1, 0] == pytest.approx(condition.ground_luminance_rgb)


@pytest.mark.parametrize("sky", ["cie:1", "cie:12", "cie:15", "perez:850,70"])
def test_dome_holds_the_skys_luminance_from_zenith_to_horizon(sky: str) -> None:
    condition = resolve_condition(replace(DAY, sky=sky), SITE)
    image = dome_image(condition.sky, 32)
    assert image.shape == (32, 128)
    assert image.dtype == np.float32
    theta, phi = np.linspace(0, math.pi / 2, 32)[:, None], 2 * math.pi * (np.arange(128) + 0.5) / 128
    z = np.maximum(np.cos(theta), 0) + 0 * phi
    directions = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), z], axis=-1)
    assert image.ravel() == pytest.approx(condition.sky.luminance(directions.reshape(-1, 3)), rel=1e-3)
    assert image[-1].min() > 0


@pytest.fixture
def scalar_mitsuba() -> Iterator[None]:
    """Mitsuba's scalar variant for one test; the variant is global, and other tests have theirs."""
    before = mitsuba.variant()
    mitsuba.set_variant("scalar_rgb")
    yield
    if before is not None:
        mitsuba.set_variant(before)


@pytest.mark.usefixtures("scalar_mitsuba")
def test_mitsuba_reads_the_image_as_it_is_meant() -> None:
    """Mitsuba's envmap: +y is the zenith, -z its first azimuth, +x the next; ours +z, +x, +y. Float precision."""
    condition = resolve_condition(replace(DAY, sun_colour_temperature_k=3000), SITE)
    image = condition.environment_image(32)
    emitter = mitsuba.load_dict({"type": "envmap", "bitmap": mitsuba.Bitmap(image), "scale": 1.0})
    rng = np.random.default_rng(6)
    theta, phi = np.arccos(rng.uniform(-1, 1, 300)), rng.uniform(0, 2 * math.pi, 300)
    x, y, z = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
    seen = []
    for direction in np.stack([y, z, -x], axis=1):
        interaction = mitsuba.SurfaceInteraction3f()
        interaction.wi = mitsuba.Vector3f(*(-direction).tolist())
        seen.append(list(emitter.eval(interaction)))
    assert np.array(seen) == pytest.approx(read_bilinear(image.astype(float), theta, phi), rel=1e-4)

"""Rooms with products: our portal integrator against Mitsuba's own `volpath` with the product as a BSDF."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from panel_rooms import MadeUpProduct, lopsided_matrix, product_room
from reference_rooms import GradedSky, PlainCondition, UniformSky

from transom.fenestration.panels import panel_groups
from transom.fenestration.through import Lobe
from transom_reference.mitsuba_renderer import MitsubaRenderer
from transom_reference.mitsuba_scene import stock_illuminance

SUN = np.array([0.2, -0.7, 0.5]) / np.linalg.norm([0.2, -0.7, 0.5])
POINTS = np.array([[1.2, 1.5, 0.8], [2.9, 2.5, 0.8], [0.7, 2.0, 2.95], [3.95, 2.0, 1.5]])
NORMALS = np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, -1], [-1, 0, 0]])
SIGMAS = 4.0
DAYLIGHT: dict[str, Any] = {
    "sky": PlainCondition(GradedSky(5000.0, (0.8, -0.6, 0.0)), ground_luminance_rgb=np.full(3, 2000.0)),
    "sun": PlainCondition(UniformSky(1.0), SUN, np.array([80e3, 70e3, 60e3])),
}


def both(product: MadeUpProduct, condition: Any, samples: int, batches: int, monkeypatch: Any) -> tuple[Any, Any, Any]:
    """Illuminances by the portal integrator and by volpath, and the standard error of their ratio, green."""
    scene = product_room(product, monkeypatch)
    ours = MitsubaRenderer().illuminance(scene, condition, POINTS, NORMALS, {"batches": 8, "seed": 4})
    runs = [stock_illuminance(scene, condition, POINTS, NORMALS, samples, seed) for seed in range(1, batches + 1)]
    stock = np.array(runs)[..., 1]
    error = np.hypot(stock.std(axis=0, ddof=1) / np.sqrt(batches), ours.standard_error)
    return ours.illuminance[:, 1], stock.mean(axis=0), error


@pytest.mark.slow
@pytest.mark.parametrize("light", list(DAYLIGHT))
def test_a_lopsided_table_gives_the_same_light_as_a_stock_bsdf(light: str, monkeypatch: pytest.MonkeyPatch) -> None:
    product = MadeUpProduct(lopsided_matrix(), 0.3, spread=True)
    ours, stock, error = both(product, DAYLIGHT[light], 1 << 19, 4, monkeypatch)
    assert np.all(np.abs(ours - stock) < SIGMAS * error)
    assert np.all(error < 0.013 * stock)


@pytest.mark.slow
def test_the_same_table_flipped_left_for_right_does_not_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the comparison is worth: a product mirrored in x moves most sensors by far more than the errors."""
    matrix = lopsided_matrix()
    flip = np.array([-1.0, 1.0, 1.0])
    basis = MadeUpProduct(matrix).basis
    mirrored = basis.bin_of(basis.centres * flip)
    ours, stock, error = both(MadeUpProduct(matrix, 0.3, spread=True), DAYLIGHT["sky"], 1 << 16, 2, monkeypatch)
    other, _, _ = both(MadeUpProduct(matrix[np.ix_(mirrored, mirrored)], 0.3), DAYLIGHT["sky"], 1 << 12, 2, monkeypatch)
    assert np.max(np.abs(other - stock) / np.maximum(error, 0.01 * stock)) > 5
    assert np.max(np.abs(ours - stock) / error) < 5


@pytest.mark.slow
def test_a_lobe_is_the_limit_of_a_narrow_cone(monkeypatch: pytest.MonkeyPatch) -> None:
    direction = np.array([-0.2, 0.6, 0.8]) / np.linalg.norm([-0.2, 0.6, 0.8])
    product = MadeUpProduct(np.zeros((145, 145)), 0.0, (Lobe(direction, 0.4),))
    scene = product_room(product, monkeypatch)
    world = panel_groups(scene)[0].to_world(direction)
    lit = np.array([2.0, 0.0, 1.6]) + world * (2.9 - 1.6) / world[2]
    points, normals = np.array([[lit[0], lit[1], 2.9]]), np.array([[0.0, 0.0, -1.0]])
    ours = MitsubaRenderer().illuminance(scene, DAYLIGHT["sun"], points, normals, {"batches": 4, "seed": 4})
    stock = np.array([stock_illuminance(scene, DAYLIGHT["sun"], points, normals, 1 << 20, k)[0, 1] for k in range(4)])
    error = stock.std(ddof=1) / 2
    # A cone of 6 degrees has 0.1 % less cosine than its axis; light reflected once adds what the noise does not hide.
    assert ours.illuminance[0, 1] == pytest.approx(stock.mean(), abs=4 * error + 2e-3 * stock.mean())
    assert error < 0.03 * stock.mean()

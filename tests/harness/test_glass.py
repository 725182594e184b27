"""Claims about the one angular transmittance of glass."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from transom.errors import InputError
from transom.glass import (
    MAX_TRANSMITTANCE,
    diffuse_reflectance,
    diffuse_transmittance,
    pane,
    transmittance,
    transmittance_table,
)
from transom.scene.model import Opening


def clear(visible_transmittance: float) -> Opening:
    return Opening("window", "glass", "clear", visible_transmittance)


UNGLAZED = Opening("hole", "hole", "none", 1.0)


@pytest.mark.parametrize(
    ("angle_deg", "expected"), [(0, 0.9183), (30, 0.9160), (45, 0.9025), (60, 0.8435), (70, 0.7247), (80, 0.4560)]
)
def test_clear_slab_transmits_as_the_closed_form_says(angle_deg: float, expected: float) -> None:
    table = transmittance_table(clear(MAX_TRANSMITTANCE))
    # Half a unit of the last printed digit, and the table's linear interpolation.
    assert float(transmittance(table, np.cos(np.radians(angle_deg)))) == pytest.approx(expected, abs=6e-5)


def test_clear_slab_keeps_energy_at_every_angle() -> None:
    passed, returned = pane(MAX_TRANSMITTANCE, np.linspace(0, 1, 101))
    np.testing.assert_allclose(passed + returned, 1.0, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, MAX_TRANSMITTANCE))
def test_normal_transmittance_is_the_one_asked_for(visible: float) -> None:
    table = transmittance_table(clear(visible))
    assert table.shape == (1025,)
    assert table.dtype == np.float32
    assert table[-1] == pytest.approx(visible, rel=1e-6, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, MAX_TRANSMITTANCE))
def test_pane_never_creates_light_and_passes_less_at_grazing_angles(visible: float) -> None:
    passed, returned = pane(visible, np.linspace(0, 1, 201))
    assert np.all(passed >= 0)
    assert np.all(passed + returned <= 1 + 1e-12)
    assert np.all(np.diff(passed) >= -1e-12)
    assert passed[0] == 0
    assert 0 <= diffuse_reflectance(clear(visible)) + diffuse_transmittance(clear(visible)) <= 1 + 1e-5


def test_tinted_pane_agrees_with_summing_its_inter_reflections() -> None:
    """The geometric series of internal passes, summed term by term for one angle and each polarisation."""
    cosine, visible, n = 0.5, 0.6, 1.52
    refracted = np.sqrt(1 - (1 - cosine**2) / n**2)
    normal = ((n - 1) / (n + 1)) ** 2
    # The internal transmittance by bisection, not by the closed form under test.
    low, high = 0.0, 1.0
    for _ in range(80):
        a = 0.5 * (low + high)
        low, high = (a, high) if (1 - normal) ** 2 * a / (1 - (normal * a) ** 2) < visible else (low, a)
    a = low ** (1 / refracted)
    expected_t = expected_r = 0.0
    for r in (
        ((cosine - n * refracted) / (cosine + n * refracted)) ** 2,
        ((n * cosine - refracted) / (n * cosine + refracted)) ** 2,
    ):
        inside = (1 - r) * a
        expected_r += 0.5 * r
        for bounce in range(60):
            if bounce % 2 == 0:
                expected_t += 0.5 * inside * (1 - r)
            else:
                expected_r += 0.5 * inside * (1 - r)
            inside *= r * a
    passed, returned = pane(visible, np.array(cosine))
    assert float(passed) == pytest.approx(expected_t, rel=1e-12)
    assert float(returned) == pytest.approx(expected_r, rel=1e-12)


def test_unglazed_opening_passes_everything_and_reflects_nothing() -> None:
    assert np.all(transmittance_table(UNGLAZED) == 1)
    assert diffuse_reflectance(UNGLAZED) == 0
    assert diffuse_transmittance(UNGLAZED) == pytest.approx(1, abs=1e-12)


def test_transmittance_above_the_clear_slab_is_refused() -> None:
    with pytest.raises(InputError, match=r"visible_transmittance = 0.95 is outside 0..0.9183.*0.918"):
        transmittance_table(clear(0.95))

"""The closed forms against published values and against each other."""

from __future__ import annotations

import numpy as np
import pytest

from transom_reference.analytic import (
    CUBE_LUMINANCE_CD_M2,
    CUBE_MEAN_CD_M2,
    FACES,
    clear_slab_transmittance,
    furnace_luminance,
    parallel_rectangle_factor,
    perpendicular_rectangle_factor,
    refine_box,
    refine_cube,
)


@pytest.mark.parametrize(("size", "height", "expected"), [((2, 1.5), 3, 0.22957335), ((4, 4), 3, 0.53979275)])
def test_factor_of_a_roof_rectangle_has_its_known_value(
    size: tuple[float, float], height: float, expected: float
) -> None:
    factor = parallel_rectangle_factor(np.zeros(1), np.zeros(1), np.array(height), (0.0, size[0], 0.0, size[1]))  # type: ignore[arg-type]
    assert factor[0] * np.pi == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(("size", "distance", "expected"), [((2, 1.5), 3, 0.05354204), ((4, 4), 3, 0.26122533)])
def test_factor_of_a_facade_rectangle_has_its_known_value(
    size: tuple[float, float], distance: float, expected: float
) -> None:
    factor = perpendicular_rectangle_factor(np.zeros(1), np.array([distance]), (0.0, size[0], 0.0, size[1]))  # type: ignore[arg-type]
    assert factor[0] * np.pi == pytest.approx(expected, abs=1e-8)


def test_slab_transmittance_has_its_known_values() -> None:
    cosines = np.cos(np.radians([0, 30, 45, 60, 70, 80]))
    expected = [0.9183, 0.9160, 0.9025, 0.8435, 0.7247, 0.4560]
    assert clear_slab_transmittance(cosines) == pytest.approx(expected, abs=1e-4)


def test_cube_by_collocation_agrees_with_the_tabulated_luminances() -> None:
    cube = refine_cube(8)
    for (u, v), expected in CUBE_LUMINANCE_CD_M2.items():
        if max(u, v) < 1:  # on an edge the point lies in two faces
            assert cube.luminance("z0", (u + 1) / 2, (v + 1) / 2) == pytest.approx(expected, rel=1e-3)
    assert cube.mean_luminance("x1") == pytest.approx(CUBE_MEAN_CD_M2, rel=5e-4)


def test_box_of_equal_faces_is_a_furnace() -> None:
    box = refine_box((2.0, 3.0, 4.0), dict.fromkeys(FACES, 0.8), dict.fromkeys(FACES, 100.0), cells=6)
    for face in FACES:
        assert box.mean_luminance(face) == pytest.approx(furnace_luminance(100.0, 0.8), rel=1e-6)


def test_light_given_to_a_box_is_light_absorbed() -> None:
    size, reflectance = (4.0, 3.0, 2.5), {"z0": 0.2, "z1": 0.8, "x0": 0.5, "x1": 0.4, "y0": 0.5, "y1": 0.1}
    box = refine_box(size, reflectance, {"z1": 1000.0}, cells=8)
    areas = dict(zip(FACES, [7.5, 7.5, 10.0, 10.0, 12.0, 12.0], strict=True))
    absorbed = 0.0
    for face in FACES:
        leaving, own = np.pi * box.mean_luminance(face), np.pi * 1000.0 * (face == "z1")
        absorbed += areas[face] * (leaving - own) / reflectance[face] * (1 - reflectance[face])
    assert absorbed == pytest.approx(np.pi * 1000.0 * 12.0, rel=1e-3)

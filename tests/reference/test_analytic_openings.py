"""Truth of the open analytic suite: closed forms, quadrature and the law of the sphere against known values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from transom_reference.analytic import clear_slab_transmittance
from transom_reference.analytic_openings import (
    Rectangle,
    Screen,
    opening_illuminance,
    overhang_screen,
    parallel_screen,
)
from transom_reference.analytic_sky import (
    KnownSky,
    closed_form_illuminance,
    facade_corner_integrals,
    roof_corner_integrals,
)
from transom_reference.analytic_sphere import (
    icosphere,
    lamp_illuminance,
    point_to_triangles,
    reflected_illuminance,
    solid_angles,
)

UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)

HORIZONTAL_SHARES = {
    1: (2.4495, 2.4495, 2.4495, 2.4495, 2.4495),
    2: (2.6615, 2.5566, 2.3635, 2.0860, 1.7464),
    3: (2.7700, 2.7700, 2.7700, 2.7700, 2.7700),
    4: (3.0298, 2.8901, 2.6467, 2.3154, 1.9268),
    5: (math.pi,) * 5,
    6: (3.4558, 3.2778, 2.9775, 2.5842, 2.1385),
    7: (3.9021, 3.6730, 3.1431, 2.4212, 1.6713),
    8: (4.4211, 4.1231, 3.3387, 2.3284, 1.4030),
    9: (4.8652, 4.5528, 4.0587, 3.4593, 2.8266),
    10: (5.5937, 5.1449, 4.2534, 3.1703, 2.1391),
    11: (6.4517, 5.8176, 4.4854, 2.9891, 1.7468),
    12: (7.2048, 6.3941, 4.8485, 3.1906, 1.8505),
    13: (8.0730, 6.9952, 4.9827, 3.0259, 1.6309),
    14: (9.1176, 7.7081, 5.3753, 3.2170, 1.7195),
    15: (10.3380, 8.1160, 5.2711, 3.0159, 1.5926),
    16: (7 * math.pi / 9,) * 5,
}
"""Horizontal illuminance over zenith luminance at solar altitudes of 15, 30, 45, 60 and 75 degrees, by a midpoint rule
of 720 x 1440 directions over the skies of CIE S 011/E:2003."""


def sun_at(altitude_deg: float, azimuth_deg: float = 145.0) -> tuple[float, float, float]:
    altitude, azimuth = math.radians(altitude_deg), math.radians(azimuth_deg)
    across = math.cos(altitude)
    return across * math.sin(azimuth), across * math.cos(azimuth), math.sin(altitude)


@pytest.mark.parametrize("cie_type", HORIZONTAL_SHARES)
def test_horizontal_illuminance_of_every_sky(cie_type: int) -> None:
    found = [KnownSky(cie_type, sun_at(angle), 1.0).horizontal_illuminance() for angle in (15, 30, 45, 60, 75)]
    assert found == pytest.approx(HORIZONTAL_SHARES[cie_type], abs=6e-5)


def test_corner_integrals_have_their_check_values() -> None:
    assert roof_corner_integrals(2, 1.5, 3) == pytest.approx((0.22957335, 0.21094259), abs=5e-9)
    assert roof_corner_integrals(4, 4, 3) == pytest.approx((0.53979275, 0.43140184), abs=5e-9)
    assert facade_corner_integrals(2, 1.5, 3) == pytest.approx((0.05354204, 0.01527597), abs=5e-9)
    assert facade_corner_integrals(4, 4, 3) == pytest.approx((0.26122533, 0.13154821), abs=5e-9)


def test_a_huge_roof_shows_the_whole_sky() -> None:
    first, second = roof_corner_integrals(1e5, 1e5, 1.0)
    assert 4 * first == pytest.approx(math.pi, rel=1e-4)
    assert 4 * second == pytest.approx(2 * math.pi / 3, rel=1e-4)


@pytest.mark.parametrize("cie_type", [5, 16])
def test_quadrature_meets_the_closed_forms(cie_type: int) -> None:
    sky = KnownSky(cie_type, sun_at(45), 5000.0)
    roof = opening_illuminance(ORIGIN, UP, Rectangle(2, 3.0, (0, 2), (0, 1.5)), sky.luminance)
    facade = opening_illuminance(np.array([0, 3.0, 0]), UP, Rectangle(1, 0.0, (0, 4), (0, 4)), sky.luminance)
    assert roof.value == pytest.approx(closed_form_illuminance(sky, *roof_corner_integrals(2, 1.5, 3)), rel=1e-10)
    assert facade.value == pytest.approx(closed_form_illuminance(sky, *facade_corner_integrals(4, 4, 3)), rel=1e-10)


@pytest.mark.parametrize("cie_type", range(1, 17))
def test_quadrature_has_converged_for_every_sky_even_with_the_sun_in_the_opening(cie_type: int) -> None:
    sun = sun_at(45)
    sky = KnownSky(cie_type, sun, 5000.0)
    known = opening_illuminance(
        np.array([0, 1.0, 0]),
        UP,
        Rectangle(1, 0.0, (-1, 4), (0, 4)),
        sky.luminance,
        transmittance=clear_slab_transmittance,
        cusp=np.array(sun),
    )
    assert known.uncertainty < 1e-5 * known.value


def test_closed_form_of_another_sky_is_refused() -> None:
    with pytest.raises(ValueError, match="CIE sky 12"):
        closed_form_illuminance(KnownSky(12, sun_at(45), 1.0), 1.0, 1.0)


def test_parallel_screen_takes_its_rectangle_from_the_sky() -> None:
    """Through a hole, a black wall hides what the hole's shadow on it covers: the rest of the hole is a rectangle."""
    sky = KnownSky(5, sun_at(45), 1.0)
    opening = Rectangle(1, 0.0, (-1, 1), (0, 2))
    point = np.array([0.0, 2.0, 0.0])
    wall = Rectangle(1, -2.0, (-50, 50), (-1, 2))
    screen = parallel_screen(point, opening, wall, 0.0)
    assert screen.v == pytest.approx((-0.5, 1.0))
    seen = opening_illuminance(point, UP, opening, sky.luminance, screens=[screen])
    upper = opening_illuminance(point, UP, Rectangle(1, 0.0, (-1, 1), (1, 2)), sky.luminance)
    assert seen.value == pytest.approx(upper.value, rel=1e-10)


def test_overhang_hides_all_above_the_line_over_its_edge() -> None:
    opening, overhang = Rectangle(1, 0.0, (-1, 1), (0, 2)), Rectangle(2, 2.5, (-50, 50), (-2, 0))
    screen = overhang_screen(np.array([0.0, 2.0, 0.5]), opening, overhang, 0.0)
    assert screen.v[0] == pytest.approx(0.5 + 0.5 * 2.0)
    with pytest.raises(ValueError, match="ends within the view"):
        overhang_screen(np.array([0.0, 2.0, 0.5]), opening, Rectangle(2, 2.5, (-1, 1), (-2, 0)), 0.0)


def test_screen_of_the_skys_luminance_changes_nothing() -> None:
    sky = KnownSky(5, sun_at(45), 100.0)
    opening = Rectangle(1, 0.0, (-1, 1), (0, 2))
    point = np.array([0.3, 2.0, 0.2])
    plain = opening_illuminance(point, UP, opening, sky.luminance)
    screened = opening_illuminance(point, UP, opening, sky.luminance, screens=[Screen((-0.3, 0.4), (0.5, 1.1), 100.0)])
    assert screened.value == pytest.approx(plain.value, rel=1e-9)


def test_downward_sensor_sees_the_ground_alone() -> None:
    opening = Rectangle(1, 0.0, (-1, 1), (0, 2))
    known = opening_illuminance(np.array([0.0, 2.0, 2.5]), -UP, opening, KnownSky(5, sun_at(45), 9e9).luminance, 100.0)
    first, _ = facade_corner_integrals(1, 2.5, 2)
    hidden, _ = facade_corner_integrals(1, 0.5, 2)
    assert known.value == pytest.approx(200 * (first - hidden), rel=1e-9)


def test_solid_angles_of_a_closed_surface_sum_to_the_sphere() -> None:
    shape = icosphere(2.0, 1)
    assert solid_angles(shape.corners() - np.array([0.6, 0.3, 0.0])).sum() == pytest.approx(4 * math.pi, rel=1e-12)


def test_icosphere_faces_look_inwards_and_exchange_all_their_light() -> None:
    shape = icosphere(2.0, 1)
    assert len(shape.triangles) == 80
    assert np.all(np.einsum("ij,ij->i", shape.normals(), shape.centroids()) < 0)
    factors = point_to_triangles(shape.centroids(), shape.normals(), shape.corners())
    assert factors.sum(axis=1) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("level", "deviation"), [(1, 0.016), (2, 0.005)])
def test_reflected_light_in_a_polyhedron_nears_the_law_of_the_sphere(level: int, deviation: float) -> None:
    shape, lamp = icosphere(2.0, level), np.array([0.6, 0.0, 0.0])
    areas, rho = shape.areas(), 0.5
    found = reflected_illuminance(shape, shape.centroids(), shape.normals(), lamp, 1000.0, rho)
    law = 4 * math.pi * 1000 * rho / (areas.sum() * (1 - rho))
    assert np.abs(found / law - 1).max() < deviation
    assert areas @ found / areas.sum() == pytest.approx(law, rel=2e-5)


def test_lamp_illuminates_by_the_inverse_square() -> None:
    found = lamp_illuminance(np.array([[0, 0, 0.0], [3.0, 0, 0]]), np.tile(UP, (2, 1)), np.array([0, 0, 4.0]), 100.0)
    assert found == pytest.approx([100 / 16, 100 * 4 / 125])

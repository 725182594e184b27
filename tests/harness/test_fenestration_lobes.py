"""Lobes: splitting what leaves a product, following lobes between measured directions, and light of BSDF files."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from transom.bsdf.bsdf import Bsdf, KlemsMatrix, Path, Spectrum
from transom.bsdf.directions import KLEMS_FULL
from transom.fenestration.bins import PANEL_BINS, directions_within, mirror_in_x
from transom.fenestration.choice import choose_product
from transom.fenestration.interpolation import LobeTable
from transom.fenestration.landing import bin_landing, illuminance, landed, landed_represented, landing
from transom.fenestration.load import load_fenestration
from transom.fenestration.path_tracer import trace_paths
from transom.fenestration.splitting import split
from transom.fenestration.tabulated import TabulatedFenestration
from transom.fenestration.through import Lobe, SunThrough
from transom.fenestration.triangulation import SphericalTriangulation
from transom.products import list_products, load_product
from transom.products.by_direction import incident_grid
from transom.products.section import Section

Float64 = np.ndarray
NO_RESIDUAL = np.zeros(PANEL_BINS.count)
ROUNDING = 1e-12


def direction(theta_deg: float, phi_deg: float) -> np.ndarray:
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b) / 2, 0, 1))))


# Bins


def test_directions_of_a_bin_lie_in_it_and_every_bin_has_its_mirror_image() -> None:
    within = directions_within(PANEL_BINS, 16)
    np.testing.assert_array_equal(PANEL_BINS.bin_of(within), np.arange(PANEL_BINS.count)[:, None].repeat(16, 1))
    np.testing.assert_allclose(np.linalg.norm(within, axis=-1), 1, atol=ROUNDING)
    mirrored = mirror_in_x(PANEL_BINS)
    np.testing.assert_array_equal(mirrored[mirrored], np.arange(PANEL_BINS.count))
    assert PANEL_BINS.projected_solid_angles.sum() == pytest.approx(math.pi)


# Splitting


@pytest.mark.parametrize("name", list_products())
def test_lobes_and_residual_together_are_what_was_transmitted(name: str) -> None:
    tracer = load_product(name).tracer()
    for theta, phi in ((0, 0), (35, -70), (62, -110)):
        exits = tracer.trace(direction(theta, phi), rays=128).transmitted
        through = split(exits.directions, exits.flux, PANEL_BINS)
        assert through.total == pytest.approx(exits.total, abs=ROUNDING)
        assert len(through.lobes) <= 8
        assert (through.residual >= 0).all()
        assert all(lobe.direction[2] > 0 and lobe.width_rad < math.radians(6) for lobe in through.lobes)


def test_a_sharp_beam_keeps_its_direction_beside_weak_scatter() -> None:
    rng = np.random.default_rng(3)
    sharp = direction(40, 100)
    fuzz = sharp + 0.02 * rng.standard_normal((200, 3))
    fuzz /= np.linalg.norm(fuzz, axis=1, keepdims=True)
    through = split(np.vstack([sharp, fuzz]), np.append(0.7, np.full(200, 0.1 / 200)), PANEL_BINS)
    assert angle_deg(through.lobes[0].direction, sharp) < 0.2
    assert through.lobes[0].share == pytest.approx(0.7, abs=0.03)


def test_diffuse_light_is_no_lobe() -> None:
    rng = np.random.default_rng(5)
    radius, phi = np.sqrt(rng.random(4000)), 2 * np.pi * rng.random(4000)
    lambert = np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1 - radius**2)], axis=1)
    through = split(lambert, np.full(4000, 0.6 / 4000), PANEL_BINS)
    assert through.lobes == ()
    expected = 0.6 * PANEL_BINS.projected_solid_angles / math.pi
    assert np.abs(through.residual - expected).sum() < 0.15  # 4000 rays in 205 bins


def test_width_is_that_of_an_evenly_filled_cone() -> None:
    rng = np.random.default_rng(7)
    full = math.radians(3.0)
    radius, phi = 0.5 * full * np.sqrt(rng.random(3000)), 2 * np.pi * rng.random(3000)
    cone = np.stack([radius * np.cos(phi), radius * np.sin(phi), np.ones(3000)], axis=1)
    cone /= np.linalg.norm(cone, axis=1, keepdims=True)
    (lobe,) = split(cone, np.full(3000, 1 / 3000), PANEL_BINS).lobes
    assert lobe.width_rad == pytest.approx(full, rel=0.05)
    assert angle_deg(lobe.direction, np.array([0.0, 0.0, 1.0])) < 0.1


# Between measured directions


def test_weights_of_a_triangle_give_the_direction_back() -> None:
    triangulation = SphericalTriangulation(incident_grid(12.0))
    rng = np.random.default_rng(1)
    for _ in range(50):
        wanted = direction(80 * rng.random(), 360 * rng.random())
        corners, weights = triangulation.locate(wanted)
        assert (weights >= 0).all()
        assert weights.sum() == pytest.approx(1)
        vector = weights @ triangulation.directions[corners]
        assert angle_deg(vector / np.linalg.norm(vector), wanted) < 1e-5


def two_branches(incident: np.ndarray) -> SunThrough:
    """What one facet lets straight on and another turns about x by refraction: Snell's law in a wedge, for each of two
    facets. The shares cross as the incident elevation rises: the brighter becomes the weaker."""
    lobes = []
    up = 0.5 - 0.9 * incident[1]
    for slope_deg, share in ((20.0, min(max(up, 0.05), 0.95)), (-22.0, 1 - min(max(up, 0.05), 0.95))):
        leaving = wedge(incident, math.radians(slope_deg), 1.5)
        lobes.append(Lobe(leaving, 0.8 * share))
    return SunThrough(tuple(sorted(lobes, key=lambda lobe: -lobe.share)), NO_RESIDUAL)


def wedge(incident: np.ndarray, slope: float, index: float) -> np.ndarray:
    """Through a flat face and one tilted by `slope` [Snell]."""
    inside = incident / index
    inside = np.array([inside[0], inside[1], math.sqrt(1 - inside[0] ** 2 - inside[1] ** 2)])
    normal = np.array([0.0, math.sin(slope), math.cos(slope)])
    cosine = float(inside @ normal)
    tangent = index * (inside - cosine * normal)
    return np.asarray(tangent + math.sqrt(max(0.0, 1 - float(tangent @ tangent))) * normal)


def test_lobes_that_swap_rank_are_followed_by_assignment_and_lost_by_rank() -> None:
    grid = incident_grid(6.0)
    grid = grid[grid[:, 2] > math.cos(math.radians(26))]
    through = [two_branches(d) for d in grid]
    ours, rank = LobeTable(grid, through, PANEL_BINS), LobeTable(grid, through, PANEL_BINS, is_by_rank=True)
    rng = np.random.default_rng(2)
    worst_ours, worst_share, worst_rank = 0.0, 0.0, 0.0
    for _ in range(300):
        incident = direction(18 * math.sqrt(rng.random()), 360 * rng.random())
        for truth in two_branches(incident).lobes:
            near = min(ours.at(incident).lobes, key=lambda lobe: angle_deg(lobe.direction, truth.direction))
            worst_ours = max(worst_ours, angle_deg(near.direction, truth.direction))
            worst_share = max(worst_share, abs(near.share - truth.share))
            near = min(rank.at(incident).lobes, key=lambda lobe: angle_deg(lobe.direction, truth.direction))
            worst_rank = max(worst_rank, angle_deg(near.direction, truth.direction))
    assert worst_ours < 1.0
    assert worst_share < 0.02
    assert worst_rank > 8.0


def three_corners() -> np.ndarray:
    return np.array([direction(0, 0), direction(6, 0), direction(6, 60)])


def test_a_lobe_that_is_absent_at_a_corner_fades_towards_it() -> None:
    grid = three_corners()
    straight, other = [Lobe(d, 0.5) for d in grid], direction(50, 200)
    through = [
        SunThrough((straight[0], Lobe(other, 0.3)), NO_RESIDUAL),
        SunThrough((straight[1],), NO_RESIDUAL),
        SunThrough((straight[2],), NO_RESIDUAL),
    ]
    table = LobeTable(grid, through, PANEL_BINS)
    for share in (1.0, 0.6, 0.2):
        incident = share * grid[0] + (1 - share) * grid[1]
        found = table.at(incident / np.linalg.norm(incident))
        fading = [lobe for lobe in found.lobes if angle_deg(lobe.direction, other) < 6.1]
        assert sum(lobe.share for lobe in fading) == pytest.approx(0.3 * share, abs=1e-9)
        assert found.total == pytest.approx(0.5 + 0.3 * share, abs=1e-9)


def test_lobes_that_merge_keep_their_light() -> None:
    grid = three_corners()
    apart = SunThrough((Lobe(direction(10, 90), 0.4), Lobe(direction(10, -90), 0.3)), NO_RESIDUAL)
    merged = SunThrough((Lobe(direction(1, 90), 0.7),), NO_RESIDUAL)
    table = LobeTable(grid, [apart, merged, merged], PANEL_BINS)
    for share in np.linspace(0, 1, 7):
        incident = share * grid[0] + (1 - share) * grid[1]
        found = table.at(incident / np.linalg.norm(incident))
        assert found.total == pytest.approx(0.7, abs=1e-9)
        assert all(angle_deg(lobe.direction, np.array([0.0, 0.0, 1.0])) < 10.1 for lobe in found.lobes)


def test_azimuth_may_wrap() -> None:
    """Exits at azimuths of 175 and -175 degrees are 10 degrees apart, not 350."""
    grid = three_corners()
    through = [SunThrough((Lobe(direction(60, phi), 0.5),), NO_RESIDUAL) for phi in (175.0, -175.0, 180.0)]
    table = LobeTable(grid, through, PANEL_BINS)
    middle = grid.sum(axis=0)
    (lobe,) = table.at(middle / np.linalg.norm(middle)).lobes
    assert angle_deg(lobe.direction, direction(60, 180)) < 0.5


@pytest.mark.parametrize("name", ["prismatic_panel", "lightlouver_like", "laser_cut_panel"])
def test_light_is_continuous_across_the_edges_of_triangles(name: str) -> None:
    """Total reflection sets in, branches cross and vanish: on an edge the two triangles beside it still agree."""
    tracer = load_product(name).tracer()
    grid = incident_grid(12.0)
    through = []
    for d in grid:
        exits = tracer.trace(d, rays=256).transmitted
        through.append(split(exits.directions, exits.flux, PANEL_BINS))
    table = LobeTable(grid, through, PANEL_BINS)
    triangles = table.triangulation.triangles
    rng = np.random.default_rng(4)
    for row in rng.choice(len(triangles), 60, replace=False):
        a, b, c = grid[triangles[row]]
        along = rng.random()
        edge = along * a + (1 - along) * b
        away = c - (a + b) / 2
        both = [table.at((edge + sign * 1e-7 * away) / np.linalg.norm(edge)) for sign in (1, -1)]
        ours, others = both
        assert ours.total == pytest.approx(others.total, abs=1e-5)
        for one, two in ((ours, others), (others, ours)):
            for lobe in one.lobes:
                near = [other for other in two.lobes if angle_deg(other.direction, lobe.direction) < 0.01]
                assert lobe.share < 1e-5 or sum(other.share for other in near) >= lobe.share - 1e-4


# Tables


def clear_pane_table() -> TabulatedFenestration:
    """Clear glass of 0.8 as WINDOW writes it: 0.8 / projected solid angle on the diagonal."""
    clear = np.diag(0.8 / KLEMS_FULL.projected_solid_angles)
    paths = {path: KlemsMatrix(KLEMS_FULL, clear) for path in Path}
    scattering = {(Spectrum.visible, path): table for path, table in paths.items()}
    return TabulatedFenestration(Bsdf("pane", "", "pane.xml", scattering))


def test_the_diagonal_of_a_clear_klems_table_is_a_beam_along_the_sun() -> None:
    fenestration = clear_pane_table()
    for theta, phi in ((3, 0), (20, 80), (50, -130), (80, 10)):
        sun = direction(theta, phi)
        through = fenestration.sun(sun)
        (lobe,) = through.lobes
        assert angle_deg(lobe.direction, sun) < 1e-6
        assert lobe.share == pytest.approx(0.8)
        assert through.total == pytest.approx(0.8)


def test_a_diffusing_klems_table_has_no_beam() -> None:
    even = np.full((KLEMS_FULL.count, KLEMS_FULL.count), 0.5 / math.pi)
    scattering = {(Spectrum.visible, path): KlemsMatrix(KLEMS_FULL, even) for path in Path}
    through = TabulatedFenestration(Bsdf("cloth", "", "cloth.xml", scattering)).sun(direction(40, -90))
    assert through.lobes == ()
    assert through.total == pytest.approx(0.5)


BSDF_FILES = FilePath(__file__).parents[3] / "shared" / "bsdf"


@pytest.mark.parametrize("name", ["hb_klemsfull.xml", "hb_tensortree.xml", "viewer_blinds_20deg_t45.xml"])
def test_light_of_a_file_is_its_transmittance(name: str) -> None:
    if not (BSDF_FILES / name).is_file():
        pytest.skip("files of other projects are not part of this one")
    fenestration = load_fenestration(choose_product(str(BSDF_FILES / name)))
    assert isinstance(fenestration, TabulatedFenestration)
    for theta, phi in ((10, -90), (50, -70)):
        sun = direction(theta, phi)
        expected = float(fenestration.bsdf.get(Path.transmission_front).hemispherical(sun[None])[0])
        assert fenestration.sun(sun).total == pytest.approx(expected, abs=0.01)


# The matrix, and the room


def test_the_matrix_of_a_pane_keeps_light_in_its_bin_and_the_matrix_of_any_product_is_mirrored_in_x() -> None:
    pane = load_fenestration(choose_product("clear_slab"))
    matrix, weights = pane.transmission(), pane.basis.projected_solid_angles
    off_diagonal = matrix - np.diag(np.diag(matrix))
    assert np.abs(off_diagonal).max() < 1e-9
    assert (np.diag(matrix) * weights)[0] == pytest.approx(0.9183, abs=2e-4)  # (1 - r) / (1 + r), r = 0.0426 at normal
    prism = load_fenestration(choose_product("prismatic_panel"))
    turned = mirror_in_x(prism.basis)
    np.testing.assert_allclose(prism.transmission()[np.ix_(turned, turned)], prism.transmission(), atol=1e-9)


def test_light_lands_where_lines_through_the_panel_meet_the_floor() -> None:
    """The share of random points of the panel whose light lands on each target."""
    from transom.fenestration import landing as room

    rng = np.random.default_rng(6)
    x = (rng.random(200_000) - 0.5) * room.PANEL_WIDTH
    y = room.PANEL_LOW + rng.random(200_000) * (room.PANEL_HIGH - room.PANEL_LOW)
    for sent in (direction(50, -80), direction(65, -120), direction(75, -30)):
        expected = []
        for target in room.TARGETS:
            distance = (target.height - y) / sent[1]
            at_x, at_z = x + distance * sent[0], distance * sent[2]
            inside = (at_x > target.low[0]) & (at_x < target.high[0]) & (at_z > target.low[1]) & (at_z < target.high[1])
            expected.append(inside.mean())
        np.testing.assert_allclose(landing(sent[None])[0], expected, atol=4e-3)
    assert (landing(direction(30, 90)[None]) == 0).all()


@pytest.mark.parametrize("name", ["prismatic_panel", "mirror_blind"])
def test_a_second_tracer_finds_the_same_light(name: str) -> None:
    section = load_product(name).tracer()
    assert isinstance(section, Section)
    for theta, phi in ((30, -90), (55, -60)):
        sun = direction(theta, phi)
        ours, theirs = section.trace(sun, 2048), trace_paths(section, sun, 2048, seed=5)
        total = theirs.transmitted.total + theirs.reflected.total + theirs.absorbed + theirs.unfinished
        assert total == pytest.approx(1, abs=3e-3)
        assert ours.transmitted.total == pytest.approx(theirs.transmitted.total, abs=5e-3)
        ours_mean, theirs_mean = (e.transmitted.flux @ e.transmitted.directions for e in (ours, theirs))
        np.testing.assert_allclose(ours_mean, theirs_mean, atol=1e-2)


def test_lobes_and_residual_light_a_room_like_the_rays_that_they_stand_for() -> None:
    section = load_product("prismatic_panel").tracer()
    assert isinstance(section, Section)
    bins = bin_landing(PANEL_BINS)
    fenestration = load_fenestration(choose_product("prismatic_panel"))
    for sun in (direction(35, -80), direction(60, -110)):
        rays = trace_paths(section, sun, 2048, seed=9).transmitted
        truth = illuminance(landed(rays.directions, rays.flux), rays.total)
        through = fenestration.sun(sun)
        np.testing.assert_allclose(illuminance(landed_represented(through, bins), through.total), truth, rtol=0.03)


def test_a_lobe_that_is_a_line_becomes_parallel_parts_along_it_and_a_round_one_stays() -> None:
    """Light of a curved mirror: 200 exits over 3 degrees at one x, as an extruded section makes it."""
    turn = np.radians(np.linspace(20.0, 23.0, 200))
    fan = np.stack([np.full(200, 0.2), np.sin(turn) * math.sqrt(0.96), np.cos(turn) * math.sqrt(0.96)], axis=1)
    (lobe,) = split(fan, np.full(200, 0.5 / 200), PANEL_BINS).lobes
    parts = lobe.parallel_parts(math.radians(1.0))
    assert len(parts) == 3
    assert sum(part.share for part in parts) == pytest.approx(0.5)
    for part, middle in zip(sorted(parts, key=lambda p: p.direction[1]), (20.5, 21.5, 22.5), strict=True):
        expected = np.array([0.2, math.sin(math.radians(middle)) * math.sqrt(0.96), 0.0])
        np.testing.assert_allclose(part.direction[:2], expected[:2], atol=2e-3)
    round_one = Lobe(direction(30, 40), 0.5, math.radians(4.0))
    assert round_one.parallel_parts() == (round_one,)

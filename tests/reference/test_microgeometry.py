"""Particles through the triangles of real sections: a closed form, and the engine's tracer of sections."""

from __future__ import annotations

import numpy as np
import pytest

from transom.fenestration.bins import PANEL_BINS
from transom.glass import pane
from transom.products import load_product
from transom_reference.microgeometry import Microgeometry, Particles

COUNT = 1 << 18
SIGMAS = 4.0
INCIDENCES = [(0.0, 0.0, 1.0), (-0.47, -0.59, 0.66), (0.3, 0.5, 0.8), (0.6, -0.7, 0.4)]
SLIT_M = 4e-6
"""Width that stands for a cut without any: a thousandth of the panel's spacing, which catches as much light."""


def unit(direction: tuple[float, float, float]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.array(direction) / np.linalg.norm(direction)


def error(particles: Particles) -> float:
    return float(np.sqrt(max((particles.weights**2).sum() - particles.transmittance**2 / COUNT, 1e-12)))


@pytest.mark.parametrize("direction", INCIDENCES)
def test_a_slab_passes_what_fresnel_says_for_both_polarisations(direction: tuple[float, float, float]) -> None:
    section = load_product("clear_slab").section()
    ((_, _), (index, absorption)) = section.media
    assert absorption == 0
    assert index == pytest.approx(1.52)
    incident = unit(direction)
    found = Microgeometry(section).trace(incident, COUNT, 2)
    expected = float(pane(0.918, np.array([incident[2]]))[0][0])
    assert found.transmittance == pytest.approx(expected, abs=SIGMAS * error(found) + 5e-4)
    assert np.abs(found.transmitted - incident).max() < 1e-5
    assert found.unfinished == 0.0


@pytest.mark.parametrize("direction", INCIDENCES)
@pytest.mark.parametrize("name", ["prismatic_panel", "laser_cut_panel"])
def test_the_section_tracer_and_particles_send_the_same_light_the_same_way(
    name: str, direction: tuple[float, float, float]
) -> None:
    product = load_product(name)
    true = product.with_parameters({"kerf": SLIT_M}) if name == "laser_cut_panel" else product
    found = Microgeometry(true.section()).trace(unit(direction), COUNT, 2)
    traced = product.section().trace(unit(direction), 1 << 15, 1)
    share, errors = found.binned(PANEL_BINS.bin_of(found.transmitted), PANEL_BINS.count)
    bins = PANEL_BINS.bin_of(traced.transmitted.directions)
    expected = np.bincount(bins, traced.transmitted.flux, PANEL_BINS.count)
    # The slit takes in and keeps a thousandth of the light, which the cut without width does not.
    assert found.transmittance == pytest.approx(traced.transmitted.total, abs=SIGMAS * error(found) + 1e-3)
    assert np.all(np.abs(share - expected) < SIGMAS * errors + 1.5e-3)
    assert 0.5 * np.abs(share - expected).sum() < 3e-3


def test_a_kind_of_line_without_geometry_is_refused() -> None:
    with pytest.raises(ValueError, match="gap"):
        Microgeometry(load_product("laser_cut_panel").section())

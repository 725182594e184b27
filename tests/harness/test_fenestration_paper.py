"""The paper's lobes: greedy cones, a prism's two refractions; light that was put elsewhere; the command."""

from __future__ import annotations

import json
import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from transom.cli import WRONG_USE, run_command
from transom.fenestration.bins import PANEL_BINS
from transom.fenestration.moved_flux import moved_share
from transom.fenestration.paper_modes import greedy_split, prism_lobes
from transom.products import load_product
from transom.products.by_direction import incident_grid


def direction(theta_deg: float, phi_deg: float) -> np.ndarray:
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def scattered(directions: np.ndarray, flux: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """As a goniophotometer would see it: each exit spread by 2.5 degrees (surface waviness and the detector's width),
    a tenth of it by 15 degrees (scatter at the cuts)."""
    rng = np.random.default_rng(seed)
    parts, shares = [], []
    for vector, share in zip(directions, flux, strict=True):
        width = np.where(rng.random(2000) < 0.1, 15.0, 2.5)
        across = rng.standard_normal((2000, 3)) * np.radians(width)[:, None]
        spread = vector + across - (across @ vector)[:, None] * vector
        spread /= np.linalg.norm(spread, axis=1, keepdims=True)
        spread = spread[spread[:, 2] > 0]
        parts.append(spread)
        shares.append(np.full(len(spread), share / len(spread)))
    return np.concatenate(parts), np.concatenate(shares)


def test_three_cones_of_23_degrees_hold_a_laser_cut_panel_and_most_of_one_that_scatters() -> None:
    """Ideal: all of the light; with scatter 82 to 100 %, as the paper's measured panel."""
    panel = load_product("laser_cut_panel").tracer()
    for incident in incident_grid(20.0):
        if incident[2] < 0.3:
            continue
        exits = panel.trace(incident, 256).transmitted
        ideal = greedy_split(exits.directions, exits.flux, PANEL_BINS)
        assert sum(lobe.share for lobe in ideal.lobes) == pytest.approx(exits.total, abs=1e-9)
        directions, flux = scattered(exits.directions, exits.flux, seed=1)
        through = greedy_split(directions, flux, PANEL_BINS)
        held = sum(lobe.share for lobe in through.lobes) / flux.sum()
        assert 0.82 <= held <= 1
        assert through.total == pytest.approx(float(flux.sum()), abs=1e-9)


def test_a_prism_has_the_two_lobes_of_its_facets_until_reflection_is_total() -> None:
    prism = load_product("prismatic_panel")
    low, high, index = (float(prism.record.parameters[name]) for name in ("angle_low", "angle_high", "index"))
    exits = prism.tracer().trace(direction(40, -70), 256).transmitted
    brightest = exits.directions[np.argsort(-exits.flux)[:2]]
    shares = np.sort(exits.flux)[::-1][:2]
    lobes = prism_lobes(direction(40, -70), low, high, index)
    for lobe, vector, share in zip(lobes, brightest, shares, strict=True):
        np.testing.assert_allclose(lobe.direction, vector, atol=1e-6)
        assert lobe.share == pytest.approx(share, abs=0.02)  # without absorption and what comes back
    # Inside, rising light meets the low facet at its slope more than its own angle: total from the critical angle on.
    inside = math.asin(1 / index) - math.radians(low)
    onset = math.degrees(math.asin(index * math.sin(inside)))
    assert len(prism_lobes(direction(onset - 0.05, 90), low, high, index)) == 2
    assert len(prism_lobes(direction(onset + 0.05, 90), low, high, index)) == 1


def test_moved_light_is_what_must_turn_by_more_than_the_angle() -> None:
    one = (np.array([direction(30, 0), direction(30, 90)]), np.array([0.6, 0.4]))
    assert moved_share(one, one) == pytest.approx(0, abs=1e-6)
    near = (np.array([direction(38, 0), direction(30, 90)]), np.array([0.6, 0.4]))
    assert moved_share(near, one) == pytest.approx(0, abs=1e-6)
    far = (np.array([direction(45, 0), direction(30, 90)]), np.array([0.6, 0.4]))
    assert moved_share(far, one) == pytest.approx(0.6, abs=1e-6)
    dimmer = (one[0], np.array([0.3, 0.7]))
    assert moved_share(dimmer, one) == pytest.approx(0.3, abs=1e-6)


def test_the_command_shows_lobes_that_add_up(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["lobes", "laser_cut_panel", "--sun", "40,10"]) == 0
    shown = capsys.readouterr().out
    numbers = [float(line.split()[1]) for line in shown.splitlines()[1:]]
    total = float(shown.splitlines()[0].split(": ")[1].split()[0])
    assert sum(numbers) == pytest.approx(total, abs=0.02)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["lobes"], "PRODUCT"),
        (["lobes", "clear_slab", "--sun", "40"], "ALT,AZ"),
        (["lobes", "clear_slab", "--sun", "40,120"], "-90..90"),
        (["lobes", "no_such", "--sun", "40,0"], "clear_slab"),
        (["lobes", "clear_slab", "--evaluate", "-o", "lobes.txt"], ".json"),
    ],
)
def test_wrong_use_is_told_by_name(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(arguments) == WRONG_USE
    assert words in capsys.readouterr().err


def test_an_evaluation_is_kept_and_not_repeated(tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "lobes.json"
    command = ["lobes", "clear_slab", "--evaluate", "--rays", "64", "--every", "20", "-o", str(output)]
    assert run_command(command) == 0
    first = output.read_bytes()
    (found,) = json.loads(first)
    assert found["moved_ours"] == pytest.approx(0, abs=1e-6)
    assert found["represented"][0][0] == pytest.approx(1)
    assert (tmp_path / "lobes_moved.png").is_file()
    assert run_command(command) == 0
    assert output.read_bytes() == first
    assert "clear_slab" in capsys.readouterr().out

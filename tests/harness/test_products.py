"""Products: what their files say, light through their sections, and tables measured from them."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from transom.bsdf import Path, Spectrum, read_bsdf
from transom.bsdf.checks import check_bsdf
from transom.cli import WRONG_USE, run_command
from transom.errors import InputError
from transom.products import list_products, load_product
from transom.products.goniophotometer import measure

ENERGY = 1e-9
UNFINISHED = 3e-4
"""Light may go round inside a product for very long: so much of it may be left when it is given up."""


def incident(theta_deg: float, phi_deg: float) -> np.ndarray:
    theta, phi = math.radians(theta_deg), math.radians(phi_deg)
    return np.array([math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)])


def slab_transmittance(theta_deg: float, index: float) -> float:
    """Both polarisations, all reflections between the faces [Fresnel]: the mean of (1 - r) / (1 + r)."""
    inner = math.sqrt(1 - (math.sin(math.radians(theta_deg)) / index) ** 2)
    outer = math.cos(math.radians(theta_deg))
    s, p = (
        ((outer - index * inner) / (outer + index * inner)) ** 2,
        ((index * outer - inner) / (index * outer + inner)) ** 2,
    )
    return 0.5 * ((1 - s) / (1 + s) + (1 - p) / (1 + p))


@pytest.mark.parametrize("name", list_products())
def test_every_product_accounts_for_all_light(name: str) -> None:
    section = load_product(name).tracer()
    for theta, phi in ((0, 0), (35, -70), (65, 160)):
        for sign in (1, -1):
            light = section.trace(incident(theta, phi) * [1, 1, sign], rays=64)
            total = light.transmitted.total + light.reflected.total + light.absorbed + light.unfinished
            assert total == pytest.approx(1, abs=ENERGY)
            assert light.unfinished < UNFINISHED
            for exits in (light.transmitted, light.reflected):
                assert (exits.flux >= 0).all()
                np.testing.assert_allclose(np.linalg.norm(exits.directions, axis=1), 1, atol=1e-9)


def test_a_clear_pane_sends_light_straight_on() -> None:
    section = load_product("clear_slab").section()
    for theta in (0.0, 40.0, 70.0):
        light = section.trace(incident(theta, 100), rays=4096)
        assert light.transmitted.total == pytest.approx(slab_transmittance(theta, 1.52), abs=2e-3)
        np.testing.assert_allclose(light.transmitted.directions, [incident(theta, 100)], atol=1e-9)


def test_laser_cut_panel_mirrors_what_meets_a_cut() -> None:
    """Edmonds' closed form: of what is inside, the share depth tan(theta inside) / spacing turns up."""
    panel = load_product("laser_cut_panel").with_parameters({"absorption": 0.0})
    spacing, depth, index = (panel.record.parameters[name] for name in ("spacing", "depth", "index"))
    for elevation in (10.0, 25.0, 40.0):
        exits = panel.section().trace(incident(elevation, -90), rays=4096).transmitted
        up = exits.flux[exits.directions[:, 1] > 0].sum()
        share = depth * math.tan(math.asin(math.sin(math.radians(elevation)) / index)) / spacing
        assert up / exits.total == pytest.approx(share if share <= 1 else 2 - share, abs=5e-3)


def test_turning_a_prismatic_panel_round_exchanges_its_sides() -> None:
    panel = load_product("prismatic_panel_30_60")
    turned = panel.with_parameters({"prisms_outdoors": 1.0})
    there = panel.section().trace(incident(30, -90), rays=2048).transmitted
    back = turned.section().trace(incident(30, -90) * [1, 1, -1], rays=2048).transmitted
    assert there.total == pytest.approx(back.total, abs=2e-3)
    mean = [(e.directions * e.flux[:, None]).sum(0) / e.total for e in (there, back)]
    np.testing.assert_allclose(mean[0], mean[1] * [1, 1, -1], atol=2e-3)
    assert abs(mean[0][1] + math.sin(math.radians(30))) > 0.05  # it does bend light


def test_a_measured_prism_obeys_reciprocity_and_a_flipped_one_would_not() -> None:
    found = measure(load_product("prismatic_panel_30_60"), rays=64, directions=8)
    assert found.worst_balance < ENERGY
    findings = {finding.check: finding for finding in check_bsdf(found.bsdf)}
    assert all(finding.holds for finding in check_bsdf(found.bsdf) if finding.check != "reciprocity")
    table = found.bsdf.get(Path.transmission_front).klems
    assert findings["front and back"].value < 0.01
    assert findings["reciprocity"].value < 0.2  # bins that a narrow beam fills only in part differ by direction
    from transom.bsdf.directions import KLEMS_FULL

    upside_down = KLEMS_FULL.bin_of(KLEMS_FULL.centres * np.array([1.0, -1.0, 1.0]))
    values = table(KLEMS_FULL)
    weight = np.outer(KLEMS_FULL.projected_solid_angles, KLEMS_FULL.projected_solid_angles)
    flipped = values[np.ix_(upside_down, upside_down)]
    assert (weight * np.abs(values - flipped)).sum() / (2 * (weight * values).sum()) > 0.5


def test_a_measured_table_goes_through_a_file(tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "pane.xml"
    assert run_command(["measure", "clear_slab", "--rays", "64", "-o", str(file)]) == 0
    assert "energy" in capsys.readouterr().out
    read = read_bsdf(file)
    assert (Spectrum.visible, Path.reflection_back) in read.scattering
    near_normal = read.get(Path.transmission_front).hemispherical(np.array([[0.0, 0.0, 1.0]]))
    assert near_normal[0] == pytest.approx(slab_transmittance(0, 1.52), abs=2e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["measure", "no_such_panel"], "clear_slab"),
        (["measure", "clear_slab", "--set", "colour=1"], "thickness"),
        (["measure", "clear_slab", "--set", "index"], "NAME=VALUE"),
        (["measure", "prismatic_panel", "--set", "angle_low=120"], "0..90"),
        (["measure", "clear_slab", "-o", "table.txt"], ".xml"),
    ],
)
def test_wrong_use_is_told_by_name(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(arguments) == WRONG_USE
    assert words in capsys.readouterr().err


def test_a_malformed_product_is_refused_by_file_and_field(tmp_path: FilePath) -> None:
    folder = tmp_path / "odd"
    folder.mkdir()
    text = (load_product("clear_slab").file).read_text()
    for old, new, words in (
        ('shape = "slab"', 'shape = "cube"', "shape"),
        ("format = 1", "format = 2", "format"),
        ("thickness = 0.004", "thickness = -1.0", "parameters"),
        ('status = "generic"', 'status = "sold"', "status"),
    ):
        assert old in text
        (folder / "product.toml").write_text(text.replace(old, new))
        with pytest.raises(InputError, match=words) as caught:
            load_product(str(folder)).section()
        assert "product.toml" in str(caught.value)

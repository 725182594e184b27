"""Radiance's genBSDF on the very section of a product: another tracer, whose table the goniophotometer must match."""

from __future__ import annotations

import math
import os
import subprocess
from pathlib import Path as FilePath

import numpy as np
import pytest

from transom.bsdf import Bsdf, Path
from transom.bsdf.directions import KLEMS_FULL
from transom.bsdf.window_xml import write_klems_xml
from transom.errors import InputError
from transom.products import load_product
from transom.products.goniophotometer import Measurement, measure
from transom_reference.radiance_programs import program_path, radiance_folder
from transom_reference.radiance_section import radiance_bsdf, radiance_geometry

SAMPLES = 200
SOLID = KLEMS_FULL.projected_solid_angles


@pytest.fixture(scope="module")
def pair() -> tuple[Bsdf, Measurement]:
    """The 30/60 prism by genBSDF and by us."""
    product = load_product("prismatic_panel_30_60")
    return radiance_bsdf(product.section(), SAMPLES), measure(product)


def standard_error(table: np.ndarray) -> np.ndarray:
    """Of a genBSDF value [1/sr], at most: it sends SAMPLES rays from each leaving bin, and counts in which bins of
    incidence they end; a share p of them has variance p (1 - p) / SAMPLES."""
    share = table * SOLID[None, :]
    return np.sqrt(np.clip(share * (1 - share), 0, None) / SAMPLES) / SOLID[None, :]


@pytest.mark.slow
@pytest.mark.parametrize("path", list(Path))
def test_genbsdf_agrees_with_the_goniophotometer(pair: tuple[Bsdf, Measurement], path: Path) -> None:
    theirs, ours = pair[0].get(path).klems(KLEMS_FULL), pair[1].bsdf.get(path).klems(KLEMS_FULL)
    # Diffuse-hemispherical: Radiance follows no polarisation, which moves it by a few thousandths of the light.
    assert SOLID @ theirs @ SOLID / math.pi == pytest.approx(SOLID @ ours @ SOLID / math.pi, abs=5e-3)
    # Hemispherical by incidence, and value by value, within what sampling explains.
    error = standard_error(ours)
    by_incidence = np.sqrt(SOLID**2 @ (error**2 + pair[1].value_error[path] ** 2))
    apart = np.abs(SOLID @ (theirs - ours))
    assert (apart <= 3 * by_incidence + 0.01).mean() > 0.97
    assert apart.mean() < 0.02
    bright = ours > 0.05
    deviation = (theirs - ours)[bright] / np.hypot(error, pair[1].value_error[path])[bright]
    assert np.sqrt(np.mean(np.clip(deviation, -6, 6) ** 2)) < 1.3
    # And it is no other table: read with up and down exchanged it would not agree.
    flipped = KLEMS_FULL.bin_of(KLEMS_FULL.centres * [1.0, -1.0, 1.0])
    weight = np.outer(SOLID, SOLID)

    def moved(table: np.ndarray) -> float:
        return float((weight * np.abs(theirs - table)).sum() / (2 * (weight * theirs).sum()))

    assert moved(ours) < 0.12
    if path in (Path.transmission_front, Path.transmission_back):
        assert moved(ours[np.ix_(flipped, flipped)]) > 0.5


@pytest.mark.slow
def test_a_mirror_blind_agrees_with_genbsdf() -> None:
    """Curved mirrors with diffuse undersides: Radiance's metal and plastic on 41 facets a slat."""
    product = load_product("mirror_blind")
    theirs, ours = radiance_bsdf(product.section(), SAMPLES, periods=40), measure(product, directions=16)
    for path in (Path.transmission_front, Path.reflection_front):
        a, b = (SOLID @ side.get(path).klems(KLEMS_FULL) for side in (theirs, ours.bsdf))
        assert a @ SOLID / math.pi == pytest.approx(b @ SOLID / math.pi, abs=0.01)
        assert np.abs(a - b).mean() < 0.03


def test_checkbsdf_reads_an_exported_table_to_the_same_transmittance(tmp_path: FilePath) -> None:
    """Radiance's own checker prints the largest hemispherical value of each component in tenths of a percent."""
    found = measure(load_product("prismatic_panel"), rays=16, directions=4)
    file = tmp_path / "panel.xml"
    write_klems_xml(file, found.bsdf)
    environment = {**os.environ, "RAYPATH": str(radiance_folder() / "lib")}
    command = [str(program_path("checkBSDF")), str(file)]
    said = subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout
    for name, path in (
        ("Interior Refl", Path.reflection_back),
        ("Exterior Refl", Path.reflection_front),
        ("Int->Ext Trans", Path.transmission_back),
        ("Ext->Int Trans", Path.transmission_front),
    ):
        row = next(line for line in said.splitlines() if line.startswith(name) and "deg" in line)
        largest = float(row.split("%")[0].split()[-1])
        ours = float((SOLID @ found.bsdf.get(path).klems(KLEMS_FULL)).max())
        assert largest == pytest.approx(100 * ours, abs=0.2), name


def test_what_radiance_has_no_material_for_is_refused() -> None:
    with pytest.raises(InputError, match="width"):
        radiance_geometry(load_product("laser_cut_panel").section())
    with pytest.raises(InputError, match="no material"):
        radiance_geometry(load_product("perforated_blind").section())

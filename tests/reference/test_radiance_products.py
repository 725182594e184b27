"""Radiance's BSDF material with a product's XML file, against our portal integrator with the same file, under a sky."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from panel_rooms import lopsided_matrix
from reference_rooms import PlainCondition, window_room

from transom.bsdf import Bsdf
from transom.bsdf.bsdf import KlemsMatrix, Spectrum
from transom.bsdf.bsdf import Path as BsdfPath
from transom.bsdf.directions import KLEMS_FULL
from transom.bsdf.window_xml import write_klems_xml
from transom.daylight.cie_sky import CieSky
from transom.daylight.sky_model import SkyModel
from transom.errors import InputError
from transom.fenestration.reglazing import reglazed
from transom.products import load_product
from transom.products.goniophotometer import measure
from transom_reference.mitsuba_renderer import MitsubaRenderer
from transom_reference.radiance_renderer import RadianceRenderer
from transom_reference.radiance_scene import write_scene

POINTS = np.array([[1.2, 1.5, 0.8], [0.7, 2.0, 2.95], [3.95, 2.0, 1.5], [0.05, 2.0, 1.5]])
NORMALS = np.array([[0.0, 0, 1], [0, 0, -1], [-1, 0, 0], [1, 0, 0]])


def overcast() -> Any:
    """Smooth across a bin: within one Radiance draws directions evenly in angle, not in projected solid angle, which
    beside the sun's place in a clear sky is 5 % of what a wall gets."""
    return PlainCondition(SkyModel(CieSky(1), (0.48, -0.6, 0.64), 2000.0), ground_luminance_rgb=np.full(3, 400.0))


def one_way(product: Bsdf) -> Bsdf:
    """Without its transmission from the room: Radiance, which follows light backwards, reads that table by reciprocity
    where a file has it, and two tables measured apart are reciprocal to their noise alone."""
    scattering = {key: table for key, table in product.scattering.items() if key[1] is not BsdfPath.transmission_back}
    return replace(product, scattering=scattering)


def lopsided() -> Bsdf:
    nothing = KlemsMatrix(KLEMS_FULL, np.zeros((KLEMS_FULL.count, KLEMS_FULL.count)))
    tables = dict.fromkeys((BsdfPath.reflection_front, BsdfPath.reflection_back), nothing)
    tables[BsdfPath.transmission_front] = KlemsMatrix(KLEMS_FULL, lopsided_matrix())
    return Bsdf("lopsided", "", "", {(Spectrum.visible, path): table for path, table in tables.items()})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lopsided", "prismatic_panel"])
def test_radiance_and_portals_light_a_black_room_alike_through_one_file(name: str, tmp_path: Path) -> None:
    file = tmp_path / f"{name}.xml"
    product = lopsided() if name == "lopsided" else measure(load_product(name), rays=64, directions=8).bsdf
    write_klems_xml(file, one_way(product))
    scene = reglazed(window_room("none"), [f"window={file}"])
    black = replace(scene, materials=tuple(replace(m, reflectance=(0.0,) * 3) for m in scene.materials))
    ours = MitsubaRenderer().illuminance(black, overcast(), POINTS, NORMALS, {"batches": 8})
    theirs = RadianceRenderer().illuminance(black, overcast(), POINTS, NORMALS, {"preset": "exact", "passes": 8})
    values = theirs.illuminance @ [0.2126, 0.7152, 0.0722]
    error = np.hypot(ours.standard_error, theirs.standard_error)
    assert np.all(np.abs(values - ours.illuminance[:, 1]) < 4 * error + 0.01 * values)
    assert np.all(error < 0.02 * values)


def test_radiance_asks_for_a_file_where_a_product_is_a_section(tmp_path: Path) -> None:
    scene = reglazed(window_room("none"), ["window=prismatic_panel"])
    with pytest.raises(InputError, match="transom measure prismatic_panel"):
        write_scene(tmp_path, scene, overcast())

"""Radiance's BSDF material with a product's XML file, against our portal integrator with the same file, under a sky."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reference_rooms import PlainCondition, window_room

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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["clear_slab", "prismatic_panel"])
def test_radiance_and_portals_light_a_black_room_alike_through_one_file(name: str, tmp_path: Path) -> None:
    file = tmp_path / f"{name}.xml"
    write_klems_xml(file, measure(load_product(name), rays=64, directions=8).bsdf)
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

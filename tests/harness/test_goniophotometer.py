"""Measuring products: closed forms, energy, uncertainty, one sun, every exit, unit cells."""

from __future__ import annotations

import json
import math
from pathlib import Path as FilePath

import numpy as np
import pytest
from PIL import Image

from transom.bsdf import Path, read_bsdf
from transom.bsdf.directions import KLEMS_FULL
from transom.cli import WRONG_USE, run_command
from transom.errors import InputError
from transom.products import Product, load_product
from transom.products.by_direction import (
    incident_grid,
    measure_by_direction,
    read_by_direction,
    write_by_direction,
)
from transom.products.goniophotometer import measure
from transom.products.lobe_plot import SunDirection, strongest_lobes
from transom.products.section import Exits

ENERGY = 1e-4
INDEX = 1.49


def clear(name: str, **changes: float) -> Product:
    return load_product(name).with_parameters({"absorption": 0.0, **changes})


def fresnel(cosine: float, n1: float, n2: float) -> float:
    """Reflectance of unpolarised light at one face."""
    beyond = math.sqrt(1 - (n1 / n2) ** 2 * (1 - cosine**2))
    s = ((n1 * cosine - n2 * beyond) / (n1 * cosine + n2 * beyond)) ** 2
    p = ((n2 * cosine - n1 * beyond) / (n2 * cosine + n1 * beyond)) ** 2
    return (s + p) / 2


@pytest.mark.parametrize("facet", [10.0, 25.0, 38.0, 41.5])
def test_single_facet_refracts_by_snell_and_passes_what_fresnel_says(facet: float) -> None:
    """Saw teeth with an upright back, straight light: all of it meets the facet first."""
    light = clear("prismatic_panel", angle_low=facet, angle_high=90.0, index=INDEX).section().trace((0, 0, 1), 4096)
    exits = light.transmitted
    bent = math.asin(INDEX * math.sin(math.radians(facet))) - math.radians(facet)
    expected = (1 - fresnel(1, 1, INDEX)) * (1 - fresnel(math.cos(math.radians(facet)), INDEX, 1))
    flux = exits.flux[np.abs(exits.directions[:, 1] - math.sin(bent)) < 1e-9].sum()
    # What comes back from the facet and the flat face may leave the same way once more: at most their product.
    assert expected <= flux + 1e-9
    assert flux <= expected * (1 + 2 * fresnel(1, 1, INDEX))


def test_total_reflection_begins_at_the_critical_angle() -> None:
    critical = math.degrees(math.asin(1 / INDEX))
    for facet, passes in ((critical - 0.05, True), (critical + 0.05, False)):
        section = clear("prismatic_panel", angle_low=facet, angle_high=90.0, index=INDEX).section()
        exits = section.trace((0, 0, 1), 4096).transmitted
        # Just below, light leaves almost along the facet, at 45 degrees; just above, none of the first meeting does.
        flux = exits.flux[np.abs(exits.directions[:, 1] - math.sin(math.radians(45))) < 0.05].sum()
        assert (flux > 0.1) == passes


def test_optical_light_film_returns_what_is_near_its_axis() -> None:
    """Right-angled prisms return all light within a certain angle of their axis, however it is turned about it
    [Whitehead, Nodwell & Curzon 1982]; light just outside of it passes, turned rightly."""
    film = clear("optical_light_film")
    index = film.record.parameters["index"]
    eighth = math.sin(math.pi / 8) ** 2
    limit = math.acos(math.sqrt((1 - index**2 * eighth) / (1 - eighth)))
    assert math.degrees(limit) == pytest.approx(30.6, abs=0.1)
    assert math.degrees(math.acos(math.sqrt((1 - 1.5**2 * eighth) / (1 - eighth)))) == pytest.approx(27.6, abs=0.1)

    def most_passed(angle: float) -> float:
        turns = np.radians(np.arange(-88, 89, 1.0))
        section = film.section()
        return max(
            section.trace(
                (math.cos(angle), math.sin(angle) * math.sin(t), math.sin(angle) * math.cos(t)), 256
            ).transmitted.total
            for t in turns
        )

    assert most_passed(limit - math.radians(1)) < 1e-3
    assert most_passed(limit + math.radians(2)) > 0.1


def test_holes_pass_the_overlap_of_two_circles() -> None:
    product = load_product("perforated_sheet")
    parameters = product.record.parameters
    radius, thickness, pitch = parameters["diameter"] / 2, parameters["thickness"], parameters["pitch"]
    for theta, phi in ((0, 0), (20, 90), (45, 30), (60, 200)):
        t, p = math.radians(theta), math.radians(phi)
        incident = np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])
        exits = product.tracer().trace(incident, 16384).transmitted
        straight = exits.flux[np.linalg.norm(exits.directions - incident, axis=1) < 1e-9].sum()
        apart = thickness * math.tan(t)
        overlap = 2 * radius**2 * math.acos(apart / (2 * radius)) - apart / 2 * math.sqrt(4 * radius**2 - apart**2)
        assert straight == pytest.approx(overlap / pitch**2, abs=1.5e-3)  # 64 sides, 16384 points


def test_pyramid_film_looks_the_same_when_it_is_turned() -> None:
    cell = load_product("pyramid_film").tracer()
    here = cell.trace((0.3, 0.5, 0.81), 8192)
    there = cell.trace((-0.5, 0.3, 0.81), 8192)
    assert here.transmitted.total == pytest.approx(there.transmitted.total, abs=5e-3)
    assert here.unfinished < ENERGY


def test_a_product_by_mesh_says_what_is_wrong_with_it(tmp_path: FilePath) -> None:
    source = load_product("pyramid_film").file.parent
    toml, mesh = (source / "product.toml").read_text(), (source / "cell.obj").read_text()
    folder = tmp_path / "film"
    folder.mkdir()
    for old, new, words in (
        ('back = "polycarbonate"', 'back = "water"', "water"),
        ('mesh = "cell.obj"', 'mesh = "none.obj"', "none.obj"),
        ("[cell.surfaces.inner]", "[cell.surfaces.within]", "inner"),
        ("period_x = 0.0001", "period_x = 0.0", "period_x"),
        ("index = 1.586", "index = 0.5", "index"),
        ("[cell]", 'shape = "slab"\n[cell]', "shape"),
        ("format = 1", 'format = 1\nshape = ""\ncolour = 1', "colour"),
    ):
        assert old in toml
        (folder / "product.toml").write_text(toml.replace(old, new, 1))
        (folder / "cell.obj").write_text(mesh)
        with pytest.raises(InputError, match=words):
            load_product(str(folder)).tracer()
    (folder / "product.toml").write_text(toml)
    with pytest.raises(InputError, match="no section"):
        load_product(str(folder)).section()
    with pytest.raises(InputError, match="mesh fixes"):
        load_product(str(folder)).with_parameters({"index": 1.4})


def test_a_measurement_accounts_for_all_light_and_says_how_well() -> None:
    found = measure(clear("prismatic_panel_30_60"), rays=32, directions=8)
    assert found.worst_balance < ENERGY
    solid = KLEMS_FULL.projected_solid_angles
    sums = solid @ found.bsdf.get(Path.transmission_front).klems(KLEMS_FULL)
    np.testing.assert_allclose(sums, found.transmittance[0], atol=1e-12)
    # Its errors against a measurement with other directions: of the size that they say.
    other = measure(clear("prismatic_panel_30_60"), rays=32, directions=8, seed=50)
    apart = np.abs(found.transmittance - other.transmittance)
    said = np.hypot(found.standard_error, other.standard_error)
    assert (apart <= 3 * said + 1e-3).mean() > 0.97


def test_tables_come_with_the_error_of_each_value(tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "panel.xml"
    assert run_command(["measure", "laser_cut_panel", "--rays", "16", "-o", str(file)]) == 0
    assert "panel.uncertainty.npz" in capsys.readouterr().out
    with np.load(tmp_path / "panel.uncertainty.npz") as beside:
        error = beside["transmission_front"]
        provenance = json.loads(str(beside["provenance"]))
        assert beside["transmittance"].shape == (2, KLEMS_FULL.count)
    assert error.shape == (KLEMS_FULL.count, KLEMS_FULL.count)
    assert np.isfinite(error).all()
    assert provenance["product"] == "laser_cut_panel"
    assert provenance["parameters"]["spacing"] == 0.004
    assert read_bsdf(file).get(Path.transmission_front).klems(KLEMS_FULL)[error > 0].min() >= 0


def test_one_sun_shows_its_lobes(tmp_path: FilePath, capsys: pytest.CaptureFixture[str]) -> None:
    """Edmonds: sun at 40 degrees leaves a laser cut panel 40 degrees up and 40 degrees down."""
    picture = tmp_path / "lobes.png"
    assert run_command(["measure", "laser_cut_panel", "--sun", "40,0", "--sun", "20,-35", "--plot", str(picture)]) == 0
    said = capsys.readouterr().out
    assert "+40.0° up" in said
    assert "-40.0° up" in said
    assert "+35.0° to the right" in said  # a sun on the left shines to the right
    with Image.open(picture) as image:
        assert np.ptp(np.asarray(image.convert("L"))) > 100


def test_strongest_lobes_hold_the_light_within_their_width() -> None:
    directions = np.array([[0, 0, 1.0], [0, math.sin(0.1), math.cos(0.1)], [0, 1.0, 0], [1.0, 0, 0]])
    lobes = strongest_lobes(Exits(directions, np.array([0.4, 0.3, 0.2, 0.1])), count=2, width_deg=23)
    assert [lobe.share for lobe in lobes] == pytest.approx([0.7, 0.2])
    np.testing.assert_allclose(lobes[1].direction, [0, 1, 0])
    assert strongest_lobes(Exits(np.zeros((0, 3)), np.zeros(0))) == []


def test_the_sun_is_where_it_is_said() -> None:
    np.testing.assert_allclose(SunDirection(30, 0).incident, [0, -0.5, math.cos(math.pi / 6)])
    assert SunDirection(10, 50).incident[0] < 0  # on the right as seen from the room: its light goes left


@pytest.mark.parametrize("step", [12.0, 6.0])
def test_the_grid_of_incident_directions_is_even(step: float) -> None:
    grid = incident_grid(step)
    np.testing.assert_allclose(np.linalg.norm(grid, axis=1), 1)
    assert (grid[:, 2] > 0).all()
    cosine = grid @ grid.T - 2 * np.eye(len(grid))
    nearest = np.degrees(np.arccos(cosine.max(axis=1)))
    assert nearest.min() > 0.7 * step
    assert nearest.max() < 1.03 * step
    assert len(grid) == {12.0: 144, 6.0: 544}[step]


@pytest.mark.parametrize("ending", [".npz", ".csv"])
def test_every_exit_is_written_and_read(tmp_path: FilePath, ending: str) -> None:
    found = measure_by_direction(clear("laser_cut_panel"), 30.0, rays=64)
    file = tmp_path / f"panel{ending}"
    write_by_direction(file, found)
    if ending == ".csv":
        lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
        assert len(lines) == 1 + len(found.flux)
        assert json.loads(file.read_text().splitlines()[0].partition(": ")[2]) == "laser_cut_panel"
        return
    again = read_by_direction(file)
    np.testing.assert_array_equal(again.incident, found.incident)
    np.testing.assert_array_equal(again.exits(3).flux, found.exits(3).flux)
    np.testing.assert_allclose(again.transmittance + again.reflected + again.absorbed, 1, atol=ENERGY)
    assert again.provenance["step_deg"] == 30.0


def test_a_damaged_measurement_by_direction_is_refused(tmp_path: FilePath) -> None:
    found = measure_by_direction(clear("laser_cut_panel"), 30.0, rays=64)
    file = tmp_path / "panel.npz"
    arrays = {
        name: getattr(found, name) for name in ("incident", "first", "directions", "flux", "reflected", "absorbed")
    }
    arrays |= {"unfinished": found.unfinished, "provenance": np.array("{}")}
    for name, value, words in (
        ("flux", 2 * found.flux, "add up to 1"),
        ("first", found.first[:-1], "belong together"),
        ("incident", None, "is missing"),
    ):
        kept = {key: array for key, array in {**arrays, name: value}.items() if array is not None}
        np.savez(file, **kept)
        with pytest.raises(InputError, match=words):
            read_by_direction(file)
    file.write_bytes(b"PK\x03\x04 no more")
    with pytest.raises(InputError, match="no measurement"):
        read_by_direction(file)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--sun", "45"], "altitude,azimuth"),
        (["--sun", "45,120"], "before the panel"),
        (["--directions", "6"], "-o OUT.npz"),
        (["--directions", "6", "-o", "out.xml"], ".npz"),
        (["--directions", "0.1", "-o", "out.npz"], "1..45"),
        (["--plot", "out.svg"], ".png"),
    ],
)
def test_wrong_use_of_measure_is_told(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["measure", "clear_slab", *arguments]) == WRONG_USE
    assert words in capsys.readouterr().err

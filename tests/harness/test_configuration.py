"""Configuration plots: their axes, their cells, and what is printed of them."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scene_writing import write_scene
from typer.testing import CliRunner

from transom import configuration
from transom.cli import app
from transom.configuration import Axis, Plot, compute_plot, csv_text, read_axis
from transom.daylight.condition import resolve_condition
from transom.engine import Engine, SolveOptions
from transom.errors import InputError
from transom.fenestration.reglazing import load_glazed, reglazed
from transom.figures_configuration import COLOURS, LEVELS_LX, autonomy_words, configuration_png
from transom.scene import load_scene
from transom.scene.model import ConditionSpec, Scene, SensorSet

SPEC = ConditionSpec("base", "2026-03-21T12:00", direct_normal_illuminance_lx=50_000.0)
COARSE = SolveOptions(target_patch_count=60, patch_rays=64, node_rays=64)


@pytest.fixture
def room(tmp_path: Path) -> Scene:
    scene = load_scene(write_scene(tmp_path / "room"))
    points, up = np.array([[0.5, 0.5, 0.5]]), np.array([[0.0, 0.0, 1.0]])
    return replace(scene, sensors=(SensorSet("desk", points, up, target=True), SensorSet("other", points, up)))


def made(illuminance: list[list[list[float]]], daylight: list[list[bool]] | None = None) -> Plot:
    values = np.array(illuminance)
    count, rows, columns = values.shape
    dark = np.ones((rows, columns), bool) if daylight is None else np.array(daylight)
    x, y = Axis("day", tuple(range(1, columns + 1))), Axis("hour", tuple(range(9, 9 + rows)))
    return Plot("room", x, y, tuple(f"desk_{n}" for n in range(count)), values, dark, 1.0, 1.0)


def test_an_axis_is_a_range_or_a_list() -> None:
    assert read_axis("hour=9:16:8", "--x") == Axis("hour", (9, 10, 11, 12, 13, 14, 15, 16))
    assert read_axis("angle_low=10,25.5", "--x") == Axis("angle_low", (10, 25.5))


@pytest.mark.parametrize("text", ["hour", "hour=", "hour=9:16", "hour=16:9:8", "day=1:365:65", "hour=9,nan", "=1:2:2"])
def test_what_is_no_axis_is_refused_with_the_form(text: str) -> None:
    with pytest.raises(InputError, match="hour=9:16:8"):
        read_axis(text, "--x")


@pytest.mark.parametrize("text", ["hour=0:24:3", "day=0:10:3", "day=300:366:3"])
def test_hours_and_days_outside_the_year_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="outside"):
        read_axis(text, "--x")


def test_autonomy_counts_cells_in_which_every_target_can_read() -> None:
    plot = made([[[199, 200, 500], [2000, 2001, 500]], [[500, 500, 100], [500, 500, 500]]])
    assert plot.suits_reading().tolist() == [[False, True, False], [True, False, True]]
    assert plot.autonomy_percent() == pytest.approx(50)
    assert "daylight autonomy 50 % (every target at 200 to 2" in autonomy_words(plot)


def test_autonomy_leaves_out_the_night() -> None:
    plot = made([[[500, 0]]], [[True, False]])
    assert plot.autonomy_percent() == pytest.approx(100)
    assert np.isnan(made([[[0.0]]], [[False]]).autonomy_percent())


def test_a_cell_is_what_a_relighting_of_that_moment_gives(room: Scene) -> None:
    plot = compute_plot(room, SPEC, read_axis("day=80,172", "--x"), read_axis("hour=2,9,13.5", "--y"), options=COARSE)
    spec = ConditionSpec("other", "2026-06-21T13:30")
    engine = Engine.solve(room, COARSE)
    engine.relight(resolve_condition(spec, room.site))
    points, normals = room.sensors[0].points, room.sensors[0].normals
    rays = configuration.SENSOR_RAYS
    expected = engine.illuminance(points, normals, rays=rays, opening_rays=rays)["total"][0, 1]
    assert plot.targets == ("desk",)
    assert plot.illuminance_lx[0, 2, 1] == pytest.approx(expected, rel=1e-6)
    assert plot.daylight.tolist() == [[False, False], [True, True], [True, True]]
    np.testing.assert_array_equal(plot.illuminance_lx[0, 0], 0)


def test_over_facet_angles_each_cell_is_what_a_solve_with_that_panel_gives(room: Scene) -> None:
    opening = room.openings[0].name
    panel = reglazed(room, [f"{opening}=prismatic_panel(index=1.5)"])
    angles = read_axis("angle_low=30,40", "--x"), read_axis("angle_high=5,70", "--y")
    plot = compute_plot(panel, SPEC, *angles, options=COARSE)
    rays = configuration.SENSOR_RAYS
    points, normals = room.sensors[0].points, room.sensors[0].normals
    expected = []
    for high in (5, 70):
        for low in (30, 40):
            text = f"{opening}=prismatic_panel(index=1.5, angle_low={low}, angle_high={high})"
            engine = Engine.solve(reglazed(room, [text]), COARSE)
            engine.relight(resolve_condition(SPEC, room.site))
            expected.append(engine.illuminance(points, normals, rays=rays, opening_rays=rays)["total"][0, 1])
    np.testing.assert_allclose(plot.illuminance_lx[0].ravel(), expected, rtol=1e-3)
    assert len({round(value) for value in expected}) == 4, "the four panels differ"


@pytest.mark.parametrize(
    ("glazing", "x", "message"),
    [
        ([], "angle_low=10:20:2", "0 openings with a product"),
        (["south_upper=prismatic_panel"], "tilt=10:20:2", "not a variable of prismatic_panel"),
        (["south_upper=prismatic_panel"], "angle_low=60:100:2", "cannot be built"),
        (["south_upper=prismatic_panel"], "hour=9:16:2", "on both axes"),
        (["south_upper=prismatic_panel", "south_lower=prismatic_panel"], "angle_low=10:20:2", "2 openings"),
    ],
)
def test_variables_that_a_scene_does_not_have_are_refused_before_it_is_solved(
    monkeypatch: pytest.MonkeyPatch, glazing: list[str], x: str, message: str
) -> None:
    monkeypatch.setattr(Engine, "solve", lambda *_: pytest.fail("solved"))
    scene = load_glazed("test_room", glazing)
    with pytest.raises(InputError, match=message):
        compute_plot(scene, scene.conditions[0], read_axis(x, "--x"), read_axis("hour=9:16:2", "--y"))


def test_the_table_holds_every_cell_unrounded() -> None:
    plot = made([[[123.456, 600]], [[700, 800]]])
    rows = list(csv.DictReader(io.StringIO(csv_text(plot))))
    assert rows[0] == {"day": "1", "hour": "9", "desk_0_lx": "123.456", "desk_1_lx": "700", "suits_reading": "0"}
    assert [row["suits_reading"] for row in rows] == ["0", "1"]


def test_light_to_read_by_is_green_and_no_other() -> None:
    """Green: more of it than of red and of blue."""
    for low, colour in zip(LEVELS_LX, COLOURS, strict=False):
        red, green, blue = (int(colour[place : place + 2], 16) for place in (1, 3, 5))
        assert (green > max(red, blue)) == (200 <= low < 2000)


def test_the_picture_has_a_panel_for_each_target() -> None:
    one, two = (Image.open(io.BytesIO(configuration_png(made([[[100, 600]]] * count)))) for count in (1, 2))
    assert two.width > 1.5 * one.width


def test_the_command_refuses_an_axis_before_it_computes(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["plot", "desk_office", "--x", "hour=1:2", "-o", str(tmp_path / "plot.png")])
    assert isinstance(result.exception, InputError)
    assert not list(tmp_path.iterdir())

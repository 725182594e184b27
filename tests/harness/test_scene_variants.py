"""Scenes with other glazing: how they are named, chosen and judged."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from transom.bundle import make_case
from transom.cli import app
from transom.errors import InputError
from transom.fenestration.reglazing import load_glazed, reglazed
from transom.judge import Subject, read_tolerances
from transom.renderer import load_renderer
from transom.scene import content_key, load_scene, scene_root
from transom.suite import Suite, load_suite
from transom.workflow import chosen

LASER = "south_upper=laser_cut_panel"


@pytest.fixture(scope="module")
def suite() -> Suite:
    return load_suite("fenestration")


def label(glazings: list[str]) -> str:
    scene = load_glazed("test_room", glazings)
    suite_case = load_suite("quick").cases[0]
    return make_case(scene, suite_case.condition, load_renderer("engine"), {}, view=scene.views[0]).label


def test_a_scene_without_other_glazing_keeps_its_label() -> None:
    assert label([]) == "test_room-to_window-mar21_1000-engine"


def test_a_variant_is_labelled_by_what_is_in_its_openings_safely_for_a_file_name() -> None:
    texts = [[LASER], ["south_upper=prismatic_panel(angle_low=30, angle_high=5.5)"], ["south_upper=clear:0.5"]]
    labels = [label(text) for text in texts]
    assert labels[0] == "test_room-south_upper-laser_cut_panel-to_window-mar21_1000-engine"
    assert labels[1].startswith("test_room-south_upper-prismatic_panel_angle_low_30_angle_high_5_5-")
    assert all(re.fullmatch(r"[A-Za-z0-9_-]+", text) for text in labels)
    assert len(set(labels)) == 3


def test_a_variant_in_a_file_is_labelled_by_its_content(tmp_path: Path) -> None:
    names = []
    for folder, text in (("a", "one"), ("b", "two")):
        file = tmp_path / folder / "my panel.xml"
        file.parent.mkdir()
        file.write_text(text)
        names.append(load_glazed("test_room", [f"south_upper={file}"]).name)
    assert names[0] != names[1]
    assert all(re.fullmatch(r"test_room-south_upper-my_panel_[0-9a-f]{8}", name) for name in names)


def test_glazing_replaced_twice_is_named_once() -> None:
    twice = reglazed(load_glazed("test_room", [LASER]), ["south_upper=clear:0.5"])
    once = load_glazed("test_room", ["south_upper=clear:0.5"])
    assert (twice.name, twice.glazings, twice.variant_of) == (once.name, once.glazings, "test_room")
    assert content_key(twice) == content_key(once)


def test_the_same_product_by_other_words_answers_the_same_question() -> None:
    spellings = ["prismatic_panel(angle_low=30,angle_high=6)", "prismatic_panel(angle_high=6.0, angle_low=30)"]
    keys = {content_key(load_glazed("test_room", [f"south_upper={text}"])) for text in spellings}
    assert len(keys) == 1


def test_variants_of_a_suite_have_names_of_their_own(suite: Suite) -> None:
    names = [case.scene.name for case in suite.cases]
    assert len(set(names)) == len(names) == 16
    assert {case.scene.variant_of for case in suite.cases} == {"test_room", "partition_office"}
    assert {case.condition.name for case in suite.cases} == {"mar21_1000", "mar21_1530"}


def test_scenes_are_chosen_with_their_variants_by_name_or_by_pattern(suite: Suite) -> None:
    assert len(chosen(suite, {"test_room"}).cases) == 10
    assert len(chosen(suite, {"*laser_cut_panel"}).cases) == 2
    assert len(chosen(suite, {"test_room-south_upper-lumitop_like"}).cases) == 1
    with pytest.raises(InputError, match="no scene of suite"):
        chosen(suite, {"desk_office"})


def test_a_rule_with_a_pattern_binds_every_variant_and_not_the_scene_itself() -> None:
    tolerances = read_tolerances(scene_root() / "tolerances.toml")
    subject = Subject(
        "mean_relative_error_percent", "test_room", "to_window", "interior", "mar21_1000", "volumes", "mitsuba", 1.0
    )
    plain, variant = tolerances.find(subject), tolerances.find(replace(subject, scene=f"test_room-{LASER}"))
    assert plain is not None and variant is not None
    assert (plain.tolerance, variant.tolerance, variant.aims) == (8.0, 5.0, [2.0])


def test_the_command_refuses_glazing_that_the_scene_cannot_have(tmp_path: Path) -> None:
    output = str(tmp_path / "room.png")
    result = CliRunner().invoke(app, ["render", "test_room", "--glazing", "north=clear", "-o", output])
    assert isinstance(result.exception, InputError)
    assert "Openings of the scene: south_lower, south_upper" in str(result.exception)
    assert load_scene("test_room").variant_of == ""

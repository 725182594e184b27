"""Known answers: cases are drawn rightly, an exact program gets no error, and planted mistakes are caught."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.judge import Missing, Outcome, Verdict, judge, read_tolerances
from transom.known import openings, suite
from transom.known.boxes import FACES, box_of, furnace, internal_reflection, sphere
from transom.known.builder import Drawing, dark
from transom.known.case import KnownCase, compare_answers
from transom.known.lights import flux_through_opening, glass_angles
from transom.scene import load_scene, scene_root
from transom.suite import Suite, SuiteCase, load_suite

ZENITH_DRIFT_DEG = 5.0


def case_of(name: str) -> SuiteCase:
    scene = load_scene(name)
    return SuiteCase(scene, resolve_condition(scene.conditions[0], scene.site), (), False)


def verdicts_of(case: KnownCase, illuminance: NDArray[np.float64]) -> list[Verdict]:
    """What the judge says of a program that measures so much, without noise."""
    measured = case.sensors.measured(illuminance, np.zeros(len(illuminance)))
    rows = compare_answers(case, measured, "engine", 0)
    comparison = Comparison(COMPARISON_FORMAT, "analytic", "Known answers", analytic=tuple(rows))
    return judge(comparison.subjects(), [], read_tolerances(scene_root() / "tolerances.toml"))


def true_illuminance(case: KnownCase) -> NDArray[np.float64]:
    """Of a case whose answers are the illuminances of its sensors."""
    values = np.zeros(len(case.sensors.points))
    for answer in case.answers():
        values[answer.rows] = answer.truth
    return values


def test_box_of_a_scene_has_its_size_and_six_sides() -> None:
    box = box_of(load_scene("cube"))
    np.testing.assert_allclose(box.high - box.low, 10.0)
    assert set(box.reflectance) == set(FACES)
    assert all(value == pytest.approx(2 / 3) for value in box.reflectance.values())


@pytest.mark.parametrize("face", FACES)
def test_points_of_a_face_lie_just_inside_it_and_look_inwards(face: str) -> None:
    box = box_of(load_scene("three_tone"))
    points, normals = box.points(face, [(0.5, 0.5), (0.1, 0.9)])
    centre = (box.low + box.high) / 2
    assert np.all((points > box.low) & (points < box.high))
    assert np.all(np.einsum("ij,ij->i", centre - points, normals) > 0)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_furnished_room_is_no_box() -> None:
    with pytest.raises(InputError, match="not an empty box"):
        box_of(load_scene("test_room"))


def test_exact_furnace_has_no_error_at_any_reflectance() -> None:
    for case in furnace(case_of("furnace")):
        material = case.scene.materials[0]
        level = math.pi * material.luminance[0] / (1 - material.reflectance[0])
        (verdict,) = verdicts_of(case, np.full(len(case.sensors.points), level))
        assert verdict.outcome is Outcome.PASS
        assert abs(verdict.difference or 0.0) < 1e-9


def test_scene_without_a_known_answer_is_refused() -> None:
    case = case_of("cube")
    renamed = dataclasses.replace(case, scene=dataclasses.replace(case.scene, name="attic"))
    with pytest.raises(InputError, match="no known answer"):
        suite.cases_of_scene(renamed)


def test_unknown_case_of_a_suite_is_refused() -> None:
    with pytest.raises(InputError, match="not a known case"):
        list(suite.families(Suite("analytic", "", "", 1.0, "closed_form", "views", (), ("attic",))))


def test_every_case_of_the_suite_has_answers_a_bound_and_another_key() -> None:
    tolerances = read_tolerances(scene_root() / "tolerances.toml")
    named = {rule.scene for rule in tolerances.tolerances if rule.quantity == "analytic_percent"}
    seen = set()
    for name, cases in suite.families(load_suite("analytic")):
        assert name in named
        for case in cases:
            assert case.scene.name == name
            answers = case.answers()
            assert answers
            assert all(math.isfinite(answer.truth) and answer.truth > 0 for answer in answers)
            assert all(answer.truth_uncertainty < 2e-3 * answer.truth for answer in answers)
            seen.add((case.condition.key(), case.scene.mesh.vertices.tobytes(), case.scene.materials))
    assert len(seen) == 93


def test_all_sixteen_skies_light_roofs_and_facades_with_holes_and_panes() -> None:
    for family in (openings.roof, openings.facade, openings.overhang, openings.opposite_wall):
        cases = family()
        assert [case.label for case in cases] == [f"cie {number}" for number in range(1, 17)]
        groups = {answer.group for answer in cases[0].answers()}
        assert groups == {"CIE 1, hole", "CIE 1, pane"}


def test_exact_program_passes_under_every_roof() -> None:
    for case in openings.roof():
        assert {verdict.outcome for verdict in verdicts_of(case, true_illuminance(case))} == {Outcome.PASS}


def drop_glass(values: NDArray[np.float64]) -> NDArray[np.float64]:
    half = len(values) // 2
    return np.concatenate([values[:half], values[:half]])


def add_one_percent_and_a_half(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1.015 * values


@pytest.mark.parametrize("mistake", [drop_glass, add_one_percent_and_a_half])
def test_missing_glass_and_too_much_light_are_caught(
    mistake: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> None:
    for case in openings.facade():
        verdicts = verdicts_of(case, mistake(true_illuminance(case)))
        assert Outcome.FAIL in {verdict.outcome for verdict in verdicts}


@pytest.mark.parametrize(
    ("family", "constant", "wrong", "sky"),
    [
        (openings.facade, "SUN_AZIMUTH_RAD", openings.SUN_AZIMUTH_RAD + math.radians(ZENITH_DRIFT_DEG), 12),
        (openings.roof, "SUN_AZIMUTH_RAD", openings.SUN_AZIMUTH_RAD + math.radians(ZENITH_DRIFT_DEG), 12),
        (openings.facade, "GROUND_ALBEDO", 0.0001, 5),
        (openings.overhang, "OVERHANG_CD_M2", 0.0001, 1),
        (openings.opposite_wall, "WALL_CD_M2", 0.0001, 1),
        (openings.overhang, "OVERHANG_DEPTH_M", 1.15, 5),
        (openings.opposite_wall, "WALL_HEIGHT_M", 4.9, 5),
        (openings.roof, "ZENITH_CD_M2", 1.02 * openings.ZENITH_CD_M2, 8),
    ],
    ids=["sky turned", "sky turned over roof", "no ground", "dark overhang", "dark wall", "overhang", "wall", "level"],
)
def test_planted_mistake_fails(
    monkeypatch: pytest.MonkeyPatch, family: Callable[[], list[KnownCase]], constant: str, wrong: float, sky: int
) -> None:
    """A program that gets one thing wrong measures what would be true if the scene were so."""
    case = family()[sky - 1]
    monkeypatch.setattr(openings, constant, wrong)
    measured = true_illuminance(case)
    monkeypatch.undo()
    assert Outcome.FAIL in {verdict.outcome for verdict in verdicts_of(case, measured)}


def test_truth_at_a_corner_of_the_roof_is_the_published_integral() -> None:
    """Point 2 lies under a corner of a 2 x 1.5 m opening, 3 m below it: 0.22957335 and 0.21094259."""
    uniform, traditional = (openings.roof()[number - 1].answers()[1].truth for number in (5, 16))
    assert uniform == pytest.approx(5000 * 0.22957335, rel=1e-7)
    assert traditional == pytest.approx(5000 / 3 * (0.22957335 + 2 * 0.21094259), rel=1e-7)


def test_truth_opposite_a_corner_of_the_window_is_the_published_integral() -> None:
    answer = openings.facade()[4].answers()[0]
    assert answer.truth == pytest.approx(5000 * 0.05354204, rel=1e-6)


def test_walls_light_falls_as_the_room_in_front_of_it_comes_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    places = np.array([[2.0, -6.0, 1.5], [9.0, -6.0, 1.5]])
    centre, aside = openings._skylit_wall(places)
    assert centre < aside < openings.REFLECTING_WALL_REFLECTANCE * openings.UNIFORM_CD_M2
    monkeypatch.setattr(openings, "WALL_DISTANCE_M", 1e6)
    assert openings._skylit_wall(places) == pytest.approx(1800.0, rel=1e-6)


def test_mean_illuminances_of_a_room_are_those_of_its_reflectances() -> None:
    truths = [case.answers()[0].truth for case in internal_reflection()]
    assert truths == pytest.approx([104.17, 130.21, 208.33, 520.83], abs=0.005)


def test_pane_has_its_transmittance_at_every_angle() -> None:
    truths = [case.answers()[0].truth for case in glass_angles()]
    assert truths == pytest.approx([0.9183, 0.9160, 0.9025, 0.8435, 0.7247, 0.4560], abs=5e-5)


def test_flux_grows_with_the_area_of_the_opening() -> None:
    truths = [case.answers()[0].truth for case in flux_through_opening()]
    assert truths == pytest.approx([7 * math.pi / 9 * 5000 * width**2 for width in (0.5, 1, 2, 3)], rel=1e-12)


def test_lost_bounce_in_the_sphere_fails() -> None:
    """One reflection less: what is reflected misses its last share, rho² of the flux."""
    (case,) = sphere()
    values = np.zeros(len(case.sensors.points))
    for answer in case.answers()[1:]:
        values[answer.rows] = 0.98 * answer.truth - answer.offset
    assert {verdict.outcome for verdict in verdicts_of(case, values)} == {Outcome.FAIL}


def test_room_drawn_in_code_shares_vertices_between_its_sides() -> None:
    """Also round an opening: a vertex in the middle of a neighbour's edge would be a crack."""
    drawing = Drawing("room", "Room")
    drawing.opening("hole", glazed=False)
    drawing.room((0, 0, 0), (4, 4, 3), {"z1": {"hole": ((1, 3), (1, 2))}})
    scene = drawing.scene()
    assert len(scene.mesh.vertices) == 32
    edges: dict[tuple[int, int], int] = {}
    for face in scene.mesh.faces:
        for start, end in zip(face, np.roll(face, -1), strict=True):
            key = (min(start, end), max(start, end))
            edges[key] = edges.get(key, 0) + 1
    assert set(edges.values()) == {2}


def test_missing_reference_is_said_and_a_broken_program_crashes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TRANSOM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("TRANSOM_REFERENCES", str(tmp_path / "references"))
    case = KnownCase(load_scene("cube"), dark(), glass_angles()[0].sensors, list)
    missing = suite.answer(case, "mitsuba")
    crashed = suite.answer(case, "candle")
    assert isinstance(missing, Missing)
    assert isinstance(crashed, Missing)
    assert (missing.outcome, crashed.outcome) == (Outcome.NO_REFERENCE, Outcome.CRASHED)
    assert "is not a renderer" in crashed.message

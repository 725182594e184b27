"""The suite of hard cases: what it tries, how it says what broke, and a few of its claims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from transom.comparison import COMPARISON_FORMAT, Comparison
from transom.errors import InputError
from transom.hard import changes
from transom.hard.claims import Case, Claim, Lit, Seen, close, conserving, finite, refused, relit, same, threads
from transom.hard.rooms import windowed_room
from transom.hard_cases import GROUPS, chosen_cases, compare_hard_cases, try_claim
from transom.judge import Outcome, judge, read_tolerances
from transom.scene import scene_root
from transom.scene.polygons import triangle_distances
from transom.suite import Suite, load_suite

QUICK_GROUPS = ("table",)


def suite_of(*groups: str) -> Suite:
    return Suite("hard", "Hard cases", "", 1.0, "hard", "views", (), groups)


def test_the_suite_tries_every_group() -> None:
    assert set(load_suite("hard").known) == set(GROUPS)


def test_claims_are_named_once() -> None:
    names = [(case.name, claim.name) for case in chosen_cases(suite_of(*GROUPS)) for claim in case.claims]
    assert len(names) == len(set(names))
    assert len(names) > 500


def test_unknown_group_is_refused() -> None:
    with pytest.raises(InputError, match=r"suites\.hard\.known = 'moon' is no group"):
        compare_hard_cases(suite_of("moon"))


def test_claim_that_cannot_be_tried_is_broken_and_fails() -> None:
    def crash() -> Seen:
        raise ZeroDivisionError("no\nsize")

    case = Case("nothing", "shape", (Claim("stands", "always", crash), Claim("holds", "yes", lambda: Seen(True, ""))))
    rows = tuple(try_claim(case, claim) for claim in case.claims)
    assert not rows[0].holds
    assert rows[0].seen == "ZeroDivisionError: no size"
    comparison = Comparison(COMPARISON_FORMAT, "hard", "Hard cases", hard_cases=rows)
    verdicts = judge(comparison.subjects(), (), read_tolerances(scene_root() / "tolerances.toml"))
    assert [verdict.outcome for verdict in verdicts] == [Outcome.FAIL, Outcome.PASS]


def test_refusal_needs_an_error_with_the_words() -> None:
    def no_error() -> None:
        return None

    def wrong() -> None:
        raise InputError("is wrong", field="x")

    assert not refused("refused", no_error, ()).check().holds
    assert not refused("refused", wrong, ("y",)).check().holds
    assert refused("refused", wrong, ("x",)).check().holds


@pytest.mark.parametrize("group", QUICK_GROUPS)
def test_group_holds(group: str) -> None:
    broken = [row for row in compare_hard_cases(suite_of(group)).hard_cases if not row.holds]
    assert not broken


def test_usual_room_is_invariant() -> None:
    lit = Lit(windowed_room())
    for claim in (finite(lit), conserving(lit), relit(lit), threads(lit), same(lit, changes.turned(), 0.03, "")):
        seen = claim.check()
        assert seen.holds, f"{claim.name}: {seen.text}"


def test_changed_light_is_noticed() -> None:
    lit = Lit(windowed_room())
    other = Lit(lambda: lit.scene, lambda _: changes.sunlit(lit.condition, (0.5, -1.0, 0.5)))
    assert not close(lit, other, 0.03).holds
    darker = Lit(windowed_room(reflectance=0.4))
    assert not close(lit, darker, 0.03).holds


def test_moved_faces_keep_their_areas() -> None:
    scene = windowed_room().load()
    for change in (changes.mirrored(), changes.turned(), changes.reordered()):
        changed = change.scene(scene)
        areas = []
        for mesh in (scene.mesh, changed.mesh):
            triangles, _ = mesh.triangles()
            a, b, c = (mesh.vertices[triangles[:, k]] for k in range(3))
            areas.append(np.sort(np.linalg.norm(np.cross(b - a, c - a), axis=1)))
        np.testing.assert_allclose(areas[0], areas[1], atol=1e-12)


def test_distances_from_a_triangle() -> None:
    triangle = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]])
    places = {(1.0, 1.0, 3.0): 3.0, (-3.0, 0.0, 4.0): 5.0, (2.0, -1.0, 0.0): 1.0, (4.0, 4.0, 0.0): 8**0.5}
    for place, distance in places.items():
        np.testing.assert_allclose(triangle_distances(np.array(place), triangle), [distance])


def test_lamp_on_a_wall_is_refused() -> None:
    lamp = '[[point_sources]]\nname = "lamp"\nposition_m = [4.0, 2.0, 2.0]\nintensity_cd = 1000'
    with pytest.raises(InputError, match=r"point_sources\[0\]\.position_m = \[4\.0, 2\.0, 2\.0\] of 'lamp' lies on"):
        replace(windowed_room(), extra=lamp).load()


@pytest.mark.slow
@pytest.mark.parametrize("group", [group for group in GROUPS if group not in QUICK_GROUPS])
def test_slow_group_holds(group: str) -> None:
    broken = [row for row in compare_hard_cases(suite_of(group)).hard_cases if not row.holds]
    assert not broken

"""Parts of the report by themselves: sunlit corners, a day's hours, use time beside a heliodon, publishing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from harness_fakes import small_scene

from transom.daylight.condition import resolve_condition
from transom.errors import InputError
from transom.report.day import DAY_HOURS, day_cases
from transom.report.figure_13 import sunlit_corners
from transom.report.publish import FILES, publish
from transom.report.rows_speed import HELIODON_SETUP_S, HELIODON_SUN_S, use_time, use_times
from transom.scene.model import Scene
from transom.suite import Suite, SuiteCase
from transom.timing import Timing
from transom.visible import FirstSurfaces


def two_walls() -> Scene:
    """The small scene's floor, and a wall that stands on its edge x = 0."""
    scene = small_scene()
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]])
    faces = np.array([[0, 1, 2, 3], [0, 3, 5, 4]], np.int32)
    none = np.zeros(2, np.int32)
    return replace(scene, mesh=replace(scene.mesh, vertices=corners, faces=faces, face_material=none, face_object=none))


def test_sunlit_corner_is_the_unlit_wall_beside_a_sunlit_floor() -> None:
    # A row of pixels along the floor (x = 0.9, 0.4, 0.1), then up the wall (z = 0.1, 0.4, 0.9).
    position = np.array([[[0.9, 0.5, 0], [0.4, 0.5, 0], [0.1, 0.5, 0], [0, 0.5, 0.1], [0, 0.5, 0.4], [0, 0.5, 0.9]]])
    face = np.array([[0, 0, 0, 1, 1, 1]], np.int32)
    surfaces = FirstSurfaces(face, position.astype(np.float32), np.ones((1, 6), bool))
    lit = np.array([[False, False, True, False, False, False]])
    assert sunlit_corners(two_walls(), surfaces, lit).tolist() == [[False, False, False, True, True, False]]
    assert not sunlit_corners(two_walls(), surfaces, np.zeros((1, 6), bool)).any()


def test_day_has_its_hours_with_levels_of_their_own() -> None:
    scene = small_scene()
    spec = replace(scene.conditions[0], sky="clear", direct_normal_illuminance_lx=50_000.0)
    entry = SuiteCase(scene, resolve_condition(spec, scene.site), scene.views, sensors=False)
    suite = Suite("rooms", "Rooms", "", 1.0, "mitsuba", "views", (entry,))
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr("transom.bundle._engine_build", lambda: "fake")
        cases = day_cases([suite])
    assert [case.condition.spec.time[11:13] for case in cases] == [f"{hour:02d}" for hour in DAY_HOURS]
    levels = [case.condition.direct_normal_lx for case in cases]
    assert max(levels) == pytest.approx(levels[len(levels) // 2]) and len(set(levels)) > 3, "highest at noon"


def test_use_time_is_compared_with_the_heliodon() -> None:
    timings = [
        Timing("small", "solve", "s", 4.0, 4.0, 4.0, 1, 2, 40),
        Timing("small", "relight", "s", 0.29, 0.29, 0.29, 1, 2, 40),
    ]
    table = use_time(use_times(timings, [], {"small": 0.3}, "here"))
    heliodon, ours = table.rows
    assert [cell.value for cell in heliodon.cells[2:4]] == [HELIODON_SETUP_S, HELIODON_SUN_S] == [86.0, 29.0]
    assert [cell.value for cell in ours.cells[2:]] == pytest.approx([4.3, 0.29, 20.0, 100.0])


def test_published_report_replaces_the_one_before(tmp_path: Path) -> None:
    for name in (*FILES, "tables/new.csv"):
        (tmp_path / "report" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "report" / name).write_text(name)
    (tmp_path / "published" / "tables").mkdir(parents=True)
    (tmp_path / "published" / "tables" / "old.csv").write_text("old")
    publish(tmp_path / "report", tmp_path / "published")
    found = {str(path.relative_to(tmp_path / "published")) for path in (tmp_path / "published").rglob("*.*")}
    assert found == {*FILES, "tables/new.csv"}


def test_half_a_report_and_a_huge_one_are_not_published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="does not exist"):
        publish(tmp_path, tmp_path / "published")
    for name in FILES:
        (tmp_path / name).write_text("0123456789")
    monkeypatch.setattr("transom.report.publish.LARGEST_BYTES", 20)
    with pytest.raises(InputError, match="too large"):
        publish(tmp_path, tmp_path / "published")

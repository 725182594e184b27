"""`transom check` from end to end, with renderers that take no time: exit codes, and what the summary names."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree as ET

import harness_fakes
import pytest
from scene_writing import ROOM_OBJ, ROOM_TOML, write_scene

from transom.cli import run_command

TABLE = """
o table
v 1 1 0.7
v 3 1 0.7
v 3 2 0.7
v 1 2 0.7
usemtl wall
f 9 10 11
"""
SECOND_HALF = "f 9 11 12\n"


class QuietReference(harness_fakes.NoisyRenderer):
    """A reference that agrees with the cheap engine."""

    def __init__(self) -> None:
        super().__init__(level=100.0, relative_noise=0.01)


def use(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Scenes, stores and baselines in one folder, and renderers that take no time."""
    patch.setenv("TRANSOM_SCENES", str(folder / "scenes"))
    patch.setenv("TRANSOM_CACHE", str(folder / "cache"))
    patch.setenv("TRANSOM_REFERENCES", str(folder / "references"))
    patch.setattr("transom.baseline.BASELINES", folder / "baselines")
    patch.setattr(harness_fakes, "QuietReference", QuietReference, raising=False)
    patch.setattr(
        "transom.renderer.RENDERERS", {"engine": "harness_fakes:CheapEngine", "mitsuba": "harness_fakes:QuietReference"}
    )
    patch.chdir(folder)


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A suite of one room with its references rendered and its baseline blessed."""
    folder = tmp_path_factory.mktemp("prepared")
    root = folder / "scenes"
    toml = ROOM_TOML.replace("display_white", "width = 48\nheight = 36\ndisplay_white")
    toml = toml.replace("reflectance = [0.3, 0.2, 0.1]", "reflectance = 0.5")
    write_scene(root / "room", toml, ROOM_OBJ + TABLE + SECOND_HALF)
    (root / "suites.toml").write_text(
        'format = 1\n[suites.quick]\ntitle = "Room"\nlayout = "hours"\ncases = [{ scene = "room" }]\n'
    )
    (root / "tolerances.toml").write_text((Path(__file__).parents[2] / "scenes" / "tolerances.toml").read_text())
    with pytest.MonkeyPatch.context() as patch:
        use(patch, folder)
        assert run_command(["run", "references"]) == 0
        assert run_command(["bless", "quick", "--reason", "the first values of a test", "--seeds", "3"]) == 0
    return folder


@pytest.fixture
def room(prepared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of what was prepared; gives its folder of scenes."""
    folder = tmp_path / "copy"
    shutil.copytree(prepared, folder)
    use(monkeypatch, folder)
    return folder / "scenes"


def summary() -> str:
    return Path("build/check/summary.md").read_text()


def change_engine(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """A changed engine, whose build differs too."""
    monkeypatch.setenv(f"CHEAP_ENGINE_{name}", value)
    monkeypatch.setattr(harness_fakes.CheapEngine, "version", f"cheap-{name}-{value}")


def test_unchanged_engine_passes_and_writes_what_ci_wants(room: Path) -> None:
    assert room.is_dir()
    assert run_command(["check", "--junit", "out/junit.xml", "--summary", "out/summary.md"]) == 0
    assert summary().startswith("# transom check: passed (exit code 0)")
    assert Path("out/summary.md").read_text() == summary()
    suites = ET.fromstring(Path("out/junit.xml").read_bytes())
    assert [(suite.get("name"), suite.get("failures"), suite.get("skipped")) for suite in suites] == [
        ("quick", "0", "0"),
        ("quick baseline", "0", "0"),
    ]
    (checked,) = json.loads(Path("build/check/check.json").read_text())
    assert {row["outcome"] for row in checked["baseline_verdicts"]} == {"PASS"}
    assert run_command(["check", "--seed", "17"]) == 0


def test_drift_of_a_quarter_percent_fails_and_is_named(room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert room.is_dir()
    change_engine(monkeypatch, "SKY", "1.0025")
    assert run_command(["check"]) == 1
    text = summary()
    assert "| quick | references | 7 | 0 | 0 |" in re.sub(r"references \| \d+", "references | 7", text), text
    assert "Direct sky light: +0.25 % by region, one way everywhere: its level changed" in text
    assert "transom check --suite quick" in text
    assert "transom bless quick --reason" in text


def test_lost_triangle_is_named(room: Path) -> None:
    (room / "room" / "mesh.obj").write_text(ROOM_OBJ + TABLE)
    assert run_command(["run", "references"]) == 0
    assert run_command(["check"]) == 1
    text = summary()
    assert "Geometry: faces of the scene 8 → 7 (room)" in text
    assert re.search(r"faces are no longer seen \(1\): face 7 of table \(wall\) in room", text), text
    assert "The question changed, not the answer alone: scene" in text


def test_missing_reference_or_baseline_is_an_error(room: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert room.is_dir()
    with monkeypatch.context() as patch:
        patch.setattr("transom.baseline.BASELINES", tmp_path / "none")
        assert run_command(["check"]) == 4
        assert "NO_REFERENCE: room / sensors / morning / rays: no baseline: transom bless quick" in summary()
    monkeypatch.setenv("TRANSOM_REFERENCES", str(tmp_path / "empty"))
    assert run_command(["check"]) == 4
    assert "no reference: transom run references" in summary()
    errors = [suite.get("errors") for suite in ET.fromstring(Path("build/check/junit.xml").read_bytes())]
    assert errors != ["0", "0"]


def test_crash_is_an_error(room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert room.is_dir()
    monkeypatch.setenv("CHEAP_ENGINE_FAILS", "morning")
    monkeypatch.setattr(harness_fakes.CheapEngine, "version", "cheap-broken")
    assert run_command(["check"]) == 4
    assert "ArithmeticError: light went backwards" in summary()


def test_blessing_again_accepts_what_failed(room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert room.is_dir()
    change_engine(monkeypatch, "INDIRECT", "1.02")
    assert run_command(["check"]) == 1
    assert run_command(["bless", "quick", "--reason", "more light goes round", "--seeds", "3"]) == 0
    assert run_command(["check"]) == 0
    history = json.loads((Path("baselines") / "quick.json").read_text())["history"]
    assert [entry["reason"] for entry in history] == ["the first values of a test", "more light goes round"]
    assert {change["category"] for change in history[1]["changes"]} >= {"indirect"}


def test_blessing_without_reason_or_with_one_seed_is_refused(room: Path) -> None:
    before = (Path("baselines") / "quick.json").read_bytes()
    assert room.is_dir()
    assert run_command(["bless", "quick"]) == 2
    assert run_command(["bless", "quick", "--reason", "why not"]) == 2
    assert run_command(["bless", "quick", "--reason", "a good reason to bless", "--seeds", "1"]) == 2
    assert run_command(["check", "--suite", "unheard_of"]) == 2
    assert (Path("baselines") / "quick.json").read_bytes() == before

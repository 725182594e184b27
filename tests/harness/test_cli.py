"""The command: teaches with an example, and answers wrong use with one line, exit code 2 and no file."""

from __future__ import annotations

from pathlib import Path

import pytest

from transom.cli import WRONG_USE, run_command

COMMANDS = ("render", "sensors", "run", "compare", "judge", "report", "bench", "trace", "list", "doctor")


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(command in text for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command([command, "--help"]) == 0
    assert f"Example:  transom {command}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["render", "no_such_room", "-o", "a.png"], ["no_such_room"]),
        (["render", "test_room", "-o", "a.jpg"], ["a.jpg", ".exr", ".png"]),
        (["render", "test_room", "-o", "missing/a.png"], ["missing", "folder"]),
        (["render", "test_room", "--view", "no_view", "-o", "a.png"], ["no_view", "Choose"]),
        (["render", "test_room", "--condition", "no_time", "-o", "a.png"], ["no_time", "Choose"]),
        (["render", "test_room", "--size", "640", "-o", "a.png"], ["640", "640x480"]),
        (["render", "test_room", "--size", "0x480", "-o", "a.png"], ["0x480"]),
        (["render", "test_room", "--time", "noon", "-o", "a.png"], ["noon"]),
        (["render", "test_room", "--sky", "cie:17", "-o", "a.png"], ["cie:17"]),
        (["render", "test_room", "--sun", "disc:8", "-o", "a.png"], ["--sun", "disc:8", "auto"]),
        (["sensors", "desk_office", "--sun", "square", "-o", "a.csv"], ["--sun", "square", "auto"]),
        (["render", "test_room", "--renderer", "pencil", "-o", "a.png"], ["pencil"]),
        (["render", "test_room", "--renderer", "mitsuba", "--sun", "disc", "-o", "a.png"], ["--sun", "engine"]),
        (["sensors", "desk_office", "--renderer", "radiance", "--sun", "auto", "-o", "a.csv"], ["--sun", "engine"]),
        (["render", "test_room"], ["-o"]),
        (["render"], ["SCENE"]),
        (["sensors", "test_room", "--points", "no.csv", "-o", "a.csv"], ["no.csv"]),
        (["sensors", "test_room", "-o", "a.png"], ["a.png", ".csv"]),
        (["run", "no_suite"], ["no_suite", "rooms"]),
        (["compare", "no_suite"], ["no_suite"]),
        (["judge", "no_suite"], ["no_suite"]),
        (["list", "chairs"], ["chairs"]),
        (["paint"], ["paint"]),
        (["render", "test_room", "--nois", "1"], ["--nois"]),
    ],
)
def test_wrong_use_is_one_line_exit_code_2_and_no_file(
    arguments: list[str],
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(arguments) == WRONG_USE
    message = capsys.readouterr().err
    assert message.startswith("transom: ")
    assert message.count("\n") == 1
    assert all(word in message for word in words)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_lists_name_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["list", "scenes"]) == 0
    assert run_command(["list", "views", "test_room"]) == 0
    assert run_command(["list", "suites"]) == 0
    assert run_command(["list", "products"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("partition_office", "view ", "rooms", "clear"))


def test_picture_and_sensors_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("transom._engine", reason="the engine is not built", exc_type=ImportError)
    monkeypatch.chdir(tmp_path)
    for name in ("box.png", "box.exr"):
        assert run_command(["render", "cube", "--size", "32x24", "-o", name]) == 0
        assert (tmp_path / name).stat().st_size > 100
    (tmp_path / "points.csv").write_text("x,y,z,nx,ny,nz\n1,1,1,0,0,2\n")
    assert run_command(["sensors", "cube", "--points", "points.csv", "-o", "lux.csv"]) == 0
    header, values = (tmp_path / "lux.csv").read_text().splitlines()
    assert header == "x,y,z,nx,ny,nz,illuminance_lx,standard_error_lx"
    assert len(values.split(",")) == 8
    assert float(values.split(",")[6]) > 0
    assert "box.exr: 32x24" in capsys.readouterr().out

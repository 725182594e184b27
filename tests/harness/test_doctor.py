"""`transom doctor`: says what is wrong, says what to do about it, and survives what it looks at."""

from __future__ import annotations

from pathlib import Path

import pytest

from transom import doctor
from transom.doctor import Check, diagnose, print_report


def test_every_thing_that_is_not_right_comes_with_a_remedy() -> None:
    checks = diagnose()
    assert len({check.name for check in checks}) == len(checks)
    assert all(check.found for check in checks)
    assert [check for check in checks if check.state != "ok" and not check.remedy] == []


def test_without_programs_on_the_path_the_build_tools_fail(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    states = {check.name: check.state for check in diagnose()}
    assert (states["C++ compiler"], states["CMake"], states["Ninja"]) == ("fail", "fail", "fail")


def test_a_tool_that_is_too_old_fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program = tmp_path / "cmake"
    program.write_text("#!/bin/sh\necho 'cmake version 3.9.6'\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    check = doctor._tool("CMake", "cmake", (3, 25))
    assert (check.state, check.found) == ("fail", "cmake version 3.9.6")
    assert "3.25" in check.remedy


def test_a_probe_that_aborts_is_reported_and_not_fatal() -> None:
    assert doctor._probe("import os; os.abort()") == "signal 6"
    assert doctor._probe("import no_such_module") == "ModuleNotFoundError: No module named 'no_such_module'"
    assert doctor._probe("print('noise'); print('{\"answer\": 1}')") == {"answer": 1}


@pytest.mark.parametrize(("state", "code"), [("ok", 0), ("warn", 0), ("fail", 1)])
def test_only_a_failure_is_an_error(
    state: doctor.State, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "diagnose", lambda: [Check("Thing", state, "this was found", "do that")])
    assert print_report() == code
    printed = capsys.readouterr().out
    assert "this was found" in printed
    assert ("do that" in printed) == (state != "ok")

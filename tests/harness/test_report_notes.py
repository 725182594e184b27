"""Modelling notes: seven sections, none of which may be empty."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from transom.errors import InputError
from transom.report.notes import FOLDER, HEADINGS, read_notes


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(FOLDER, tmp_path / "notes"))


def test_all_seven_sections_say_something() -> None:
    sections = read_notes()
    assert [section.letter for section in sections] == list("ABCDEFG") == list(HEADINGS)
    assert all(note.paragraphs for section in sections for note in section.notes)


def test_section_that_is_missing_stops_the_report(folder: Path) -> None:
    (folder / "E.md").unlink()
    with pytest.raises(InputError, match="does not exist"):
        read_notes(folder)


@pytest.mark.parametrize("text", ["", "# E. Omitted\n", "# E. Omitted\n\n## Note\n\nNo.\n", "# E\n\n## Note\n"])
def test_section_that_says_nothing_stops_the_report(folder: Path, text: str) -> None:
    (folder / "E.md").write_text(text)
    with pytest.raises(InputError, match=r"empty|without text"):
        read_notes(folder)


def test_code_stands_apart_from_words(folder: Path) -> None:
    (folder / "E.md").write_text("# E\n\n## Note\n\nRun `transom run` and wait until it is done, however long.\n")
    spans = read_notes(folder)[4].notes[0].paragraphs[0]
    assert [(span.text, span.code) for span in spans][:2] == [("Run ", False), ("transom run", True)]

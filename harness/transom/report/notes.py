"""The modelling notes: reports/notes/A.md to G.md, under the seven headings of ANSI/ASHRAE Standard 140's notes form.

The form asks for each deviation of a program from a test's specification, whatever the results look like. Our suites
are not Standard 140's, which is about heat; we keep its headings so that a reader knows where to look.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from transom.errors import InputError

FOLDER = Path(__file__).resolve().parents[3] / "reports" / "notes"

HEADINGS = {
    "A": "Software information",
    "B": "Alternative modelling methods",
    "C": "Equivalent modelling methods",
    "D": "Non-specified inputs",
    "E": "Omitted test cases and results",
    "F": "Changes made to source code for the tests",
    "G": "Anomalous results",
}
"""ANSI/ASHRAE Standard 140-2017, file S140outNotes, sections A to G."""

LEAST_LENGTH = 40
"""Characters of a section that says something."""


@dataclass(frozen=True)
class Span:
    """A piece of a paragraph. code: set as a command or a name."""

    text: str
    code: bool


@dataclass(frozen=True)
class Note:
    """A titled note: its paragraphs, each in pieces."""

    title: str
    paragraphs: list[list[Span]]


@dataclass(frozen=True)
class NotesSection:
    """One lettered section."""

    letter: str
    heading: str
    notes: list[Note]


def read_notes(folder: Path | None = None) -> list[NotesSection]:
    """All seven sections. Raises InputError for one that is missing or says nothing: no report is built without it."""
    return [_read_section(folder or FOLDER, letter, heading) for letter, heading in HEADINGS.items()]


def _read_section(folder: Path, letter: str, heading: str) -> NotesSection:
    path = folder / f"{letter}.md"
    remedy = f"Write what there is to say under “{heading}”, or why there is nothing"
    if not path.is_file():
        raise InputError("does not exist", file=path, remedy=remedy)
    notes: list[Note] = []
    for block in path.read_text(encoding="utf-8").split("\n\n"):
        text = " ".join(block.split())
        if text.startswith("## "):
            notes.append(Note(text.removeprefix("## "), []))
        elif text.startswith("# "):
            continue
        elif text and not notes:
            raise InputError("has a paragraph before the first `## ` title", file=path, value=text[:40])
        elif text:
            notes[-1].paragraphs.append(_spans(text))
    silent = [note.title for note in notes if not note.paragraphs]
    if silent:
        raise InputError("has a note without text", file=path, field=silent[0], remedy=remedy)
    if sum(len(span.text) for note in notes for text in note.paragraphs for span in text) < LEAST_LENGTH:
        raise InputError("is empty", file=path, remedy=remedy)
    return NotesSection(letter, heading, notes)


def _spans(text: str) -> list[Span]:
    """A paragraph in pieces: what stands between backticks is code."""
    return [Span(piece, bool(index % 2)) for index, piece in enumerate(text.split("`")) if piece]

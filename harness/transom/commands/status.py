"""`transom status`: which cases are done, running, queued, failed, stale or missing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from transom.states import CaseState

REFERENCES = "references"


def status(
    suite: Annotated[
        str | None, typer.Argument(metavar="[SUITE]", help="Name of a suite, or `references`; all suites if omitted.")
    ] = None,
) -> None:
    """Say of every case of a suite, ours and the references, what state it is in; renders nothing.

    \b
    done     it has an answer
    running  a process is rendering it now: which one, and since when
    queued   a process will come to it
    failed   it crashed when it was last rendered, or its answer is damaged: the error, and what shows it again
    stale    there is an answer to what it used to be: what has changed since
    missing  it was never rendered

    `transom run SUITE` renders what is not done; `transom run references` the references.

    \b
    Example:  transom status
    Example:  transom status rooms
    Example:  transom status references
    """
    from transom.references import published_questions
    from transom.states import case_states, suite_questions
    from transom.suite import load_suite, read_suites

    if suite == REFERENCES:
        _print_cases(case_states(published_questions()))
    elif suite is not None:
        _print_cases(case_states(suite_questions(load_suite(suite))))
    else:
        names = list(read_suites())
        width = max(len(name) for name in names)
        for name in names:
            typer.echo(f"{name:<{width}}  {_counts(case_states(suite_questions(load_suite(name))))}")


def _print_cases(states: list[CaseState]) -> None:
    from transom.workflow import question_words

    rows = [(str(entry.state), question_words(entry.question), entry.note) for entry in states]
    width = max((len(words) for _, words, _ in rows), default=0)
    for state, words, note in rows:
        typer.echo(f"{state:<8} {words:<{width}}  {note}".rstrip())
    typer.echo(_counts(states))


def _counts(states: list[CaseState]) -> str:
    from transom.states import state_counts

    counts = state_counts(states)
    words = ", ".join(f"{count} {state}" for state, count in counts.items())
    return words or "no stored cases: its answers are found when it is compared"

"""The `transom` command. Only here are errors printed and exit codes set.

Exit codes, highest wins: 4 crash or missing reference, 2 wrong use, 1 fail, 3 inconclusive, 0 pass.
"""

from __future__ import annotations

import sys

import click
import typer

from transom.commands import judging, listing, picture, running, sensing
from transom.errors import InputError

WRONG_USE = 2
STOPPED = 130
"""What a shell expects of a program that was interrupted."""

app = typer.Typer(
    name="transom",
    help=(
        "Daylight in building interiors: an interactive engine, and references that say how wrong it is.\n\n"
        "Start with:  transom list scenes\n\n"
        "Then:        transom render test_room -o room.png"
    ),
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
app.command("render")(picture.render)
app.command("sensors")(sensing.sensors)
app.command("run")(running.run)
app.command("compare")(judging.compare)
app.command("judge")(judging.judge)
app.command("report")(judging.report)
app.command("list")(listing.list_names)
app.command("doctor")(listing.doctor)


def main() -> None:
    """Entry point of the command: prints one line for any bad input, and exits."""
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    """Runs the command and gives its exit code."""
    try:
        code = app(arguments, prog_name="transom", standalone_mode=False)
    except InputError as error:
        print(f"transom: {error}", file=sys.stderr)
        return WRONG_USE
    except click.exceptions.NoArgsIsHelpError as error:
        print(error.format_message())
        return WRONG_USE
    except click.UsageError as error:
        hint = error.ctx.command_path if error.ctx else "transom"
        print(f"transom: {error.format_message()} See {hint} --help.", file=sys.stderr)
        return WRONG_USE
    except click.ClickException as error:
        print(f"transom: {error.format_message()}", file=sys.stderr)
        return WRONG_USE
    except (click.exceptions.Abort, KeyboardInterrupt):
        print("transom: stopped. What is finished is kept: run the same command to go on.", file=sys.stderr)
        return STOPPED
    return code if isinstance(code, int) else 0

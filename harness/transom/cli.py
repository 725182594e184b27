"""The `transom` command. Only here are errors printed and exit codes set.

Exit codes, highest wins: 4 crash or missing reference, 2 wrong use, 1 fail, 3 inconclusive, 0 pass.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import typer

from transom.commands import (
    benching,
    checking,
    judging,
    listing,
    lobes,
    picture,
    plotting,
    products,
    referees,
    running,
    sensing,
    status,
    tracing,
)
from transom.errors import InputError

WRONG_USE = 2
STOPPED = 130
"""What a shell expects of a program that was interrupted."""

app = typer.Typer(
    name="transom",
    help=(
        "Daylight in building interiors: an interactive engine, and references that say how wrong it is.\n\n"
        "\b\n"
        "Start with:  transom list scenes\n"
        "Then:        transom render test_room -o room.png"
    ),
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
COMMANDS: dict[str, tuple[Callable[..., None], str]] = {
    "render": (picture.render, "One picture of a scene, as .exr or .png."),
    "sensors": (sensing.sensors, "Illuminance at points, as .csv."),
    "plot": (plotting.plot, "Illuminance over hour and day, or over facet angles."),
    "run": (running.run, "Render, compare and judge a suite; or the references."),
    "status": (status.status, "The state of every case of a suite."),
    "compare": (judging.compare, "Compare a suite's runs with their references."),
    "judge": (judging.judge, "Judge a compared suite by the tolerances."),
    "report": (judging.report, "Run and time everything; write the report."),
    "bench": (benching.bench, "Time a scene; or two builds against each other."),
    "trace": (tracing.trace, "Where the time goes, for Perfetto."),
    "measure": (products.measure, "Trace light through a product; its tables as Klems XML."),
    "lobes": (lobes.lobes, "Beams of the sun behind a product; how good they are."),
    "referees": (referees.referees, "References of rooms with products against each other."),
    "bsdf": (products.bsdf, "Check a product's BSDF file; export it as Klems XML."),
    "check": (checking.check, "Has accuracy changed? References, and our own baseline."),
    "bless": (checking.bless, "Accept the present answers as a suite's baseline."),
    "list": (listing.list_names, "List scenes, views, suites or products."),
    "doctor": (listing.doctor, "Say what the set-up looks like."),
}
for name, (function, summary) in COMMANDS.items():
    app.command(name, short_help=summary)(function)


def main() -> None:
    """Entry point of the command: prints one line for any bad input, and exits."""
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    """Runs the command and gives its exit code. Without arguments it shows the help."""
    try:
        code = app(arguments or ["--help"], prog_name="transom", standalone_mode=False)
    except InputError as error:
        print(f"transom: {error}", file=sys.stderr)
        return WRONG_USE
    except typer.TyperException as error:
        message = " ".join(str(error.format_message()).split())
        command = ["transom", *(word for word in arguments[:1] if word in COMMANDS)]
        print(f"transom: {message} See {' '.join(command)} --help.", file=sys.stderr)
        return WRONG_USE
    except (typer.Abort, KeyboardInterrupt):
        print("transom: stopped. What is finished is kept: run the same command to go on.", file=sys.stderr)
        return STOPPED
    return code if isinstance(code, int) else 0

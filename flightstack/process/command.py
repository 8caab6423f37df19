"""The command line of ``flightstack``."""

from __future__ import annotations

import sys

import typer

from flightstack.process import collection, console, options
from flightstack.process.command_line import (
    PanelCommand,
    UsageError,
    Version,
    expand_options,
    make_app,
    run_app,
    usage_sentence,
)
from flightstack.process.plain_arguments import read_plain

app = make_app(name="flightstack")


@app.command(cls=PanelCommand)
@expand_options
def run(given: options.RunOptions, version: Version = False) -> None:  # its callback handles the version
    """Connect to a simulator, run the control loops, and serve ground stations over MAVLink."""
    raise typer.Exit(_run(given))


def _run(given: options.RunOptions) -> int:
    from flightstack.process import program

    return program.run(given) or 0


def run_command() -> int:
    """Run the command line; return the exit code. Raises KeyboardInterrupt."""
    console.replace_unencodable()
    try:
        with collection.paused():
            given = read_plain(options.RunOptions, sys.argv[1:])
            return run_app(app, "flightstack") if given is None else console.checked_code(_run(given))
    except UsageError as error:
        console.complain(f"flightstack: {usage_sentence(error)}")
        return 2
    except OSError as error:
        return console.report_os_error("flightstack", error)

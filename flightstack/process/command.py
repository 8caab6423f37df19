"""The command line of ``flightstack``."""

from __future__ import annotations

import typer

from flightstack.process import collection, console, options
from flightstack.process.command_line import (
    PanelCommand,
    UsageError,
    expand_options,
    make_app,
    run_app,
    usage_sentence,
)

app = make_app(name="flightstack")


@app.command(cls=PanelCommand)
@expand_options
def run(given: options.RunOptions) -> None:
    """Connect to a simulator, run the control loops, and serve ground stations over MAVLink."""
    from flightstack.process import program

    raise typer.Exit(program.run(given) or 0)


def run_command() -> int:
    """Run the command line; return the exit code. Raises KeyboardInterrupt."""
    console.replace_unencodable()
    try:
        with collection.paused():
            return run_app(app, "flightstack")
    except UsageError as error:
        console.complain(f"flightstack: {usage_sentence(error)}")
        return 2
    except OSError as error:
        return console.report_os_error("flightstack", error)

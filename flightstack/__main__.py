"""The ``flightstack`` command."""

from __future__ import annotations

import sys

from flightstack.process import collection, console, options
from flightstack.process.command_line import (
    PanelCommand,
    UsageError,
    expand_options,
    make_app,
    usage_sentence,
)

app = make_app(name="flightstack")


@app.command(cls=PanelCommand)
@expand_options
def run(given: options.RunOptions) -> None:
    """Connect to a simulator, run the control loops, and serve ground stations over MAVLink."""
    from flightstack.process import program

    sys.exit(program.run(given))


def main() -> None:
    """Run the command."""
    console.replace_unencodable()
    try:
        with collection.paused():
            sys.exit(app(prog_name="flightstack", standalone_mode=False))
    except UsageError as error:
        console.complain(f"flightstack: {usage_sentence(error)}")
        sys.exit(2)
    except OSError as error:
        sys.exit(console.report_os_error("flightstack", error))


if __name__ == "__main__":
    main()

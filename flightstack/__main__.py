"""The ``flightstack`` command.

A module of its own: an interrupt of the imports that the command line needs is an orderly end too.
"""

from __future__ import annotations

import sys

from flightstack.process.interrupts import report, signals


def main() -> None:
    """Run the command."""
    try:
        signals.catch()  # the main loop has its own handlers
        from flightstack.process.command import run_command  # noqa: PLC0415  # an interrupt of it ends in order

        code = run_command()
        signals.reported = True
    except KeyboardInterrupt:
        signals.reported = True
        report("flightstack: stopped")
        code = 0
    sys.exit(signals.end_with(code))


if __name__ == "__main__":
    main()

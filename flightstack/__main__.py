"""The ``flightstack`` command.

A module of its own: an interrupt of the imports that the command line needs is an orderly end too.
"""

from __future__ import annotations

import sys

from flightstack.process import interrupts


def main() -> None:
    """Run the command."""
    signals = interrupts.Interrupts()  # the main loop has its own handlers
    try:
        from flightstack.process.command import run_command  # noqa: PLC0415  # an interrupt of it ends in order

        code = run_command()
    except KeyboardInterrupt:
        signals.reported = True
        interrupts.report("flightstack: stopped")
        code = 0
    sys.exit(interrupts.end_with(code))


if __name__ == "__main__":
    main()

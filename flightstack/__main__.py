"""The ``flightstack`` command.

A module of its own: an interrupt of the imports that the command line needs is an orderly end too.
"""

from __future__ import annotations

import signal
import sys

from flightstack.process.console import report_interrupt


def main() -> None:
    """Run the command."""
    for number in (signal.SIGINT, signal.SIGTERM):  # the main loop has its own handlers
        signal.signal(number, signal.default_int_handler)
    try:
        from flightstack.process.command import run_command  # noqa: PLC0415  # an interrupt of it ends in order

        code = run_command()
    except KeyboardInterrupt:
        report_interrupt("flightstack: stopped")
        code = 0
    sys.exit(code)


if __name__ == "__main__":
    main()

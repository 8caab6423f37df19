"""The ``sim-bridge`` command.

A module of its own: an interrupt of the imports that the command line needs is an orderly end too.
"""

from __future__ import annotations

import signal
import sys

from flightstack.process.console import report_interrupt

_ON_FILES = {"open-loop", "export-mjcf", "render"}
_INTERRUPTED = 130


def main(argv: list[str] | None = None) -> int:
    """Run the command; return the exit code."""
    words = sys.argv[1:] if argv is None else argv
    for number in (signal.SIGINT, signal.SIGTERM):  # the server has its own handlers
        signal.signal(number, signal.default_int_handler)
    try:
        from sim_bridge.command import run_command  # noqa: PLC0415  # an interrupt of it ends in order

        return run_command(words)
    except KeyboardInterrupt:
        is_unfinished = not _ON_FILES.isdisjoint(words)
        report_interrupt("sim-bridge: interrupted" if is_unfinished else "sim-bridge: stopped")
        return _INTERRUPTED if is_unfinished else 0


if __name__ == "__main__":
    sys.exit(main())

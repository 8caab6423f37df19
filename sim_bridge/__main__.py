"""The ``sim-bridge`` command.

A module of its own: an interrupt of the imports that the command line needs is an orderly end too.
"""

from __future__ import annotations

import sys

from flightstack.process.interrupts import report, signals

_ON_FILES = {"open-loop", "export-mjcf", "render"}
_INTERRUPTED = 130


def main(argv: list[str] | None = None) -> int:
    """Run the command; return the exit code."""
    words = sys.argv[1:] if argv is None else argv
    try:
        signals.catch()  # the server has its own handlers
        from sim_bridge.command import run_command  # noqa: PLC0415  # an interrupt of it ends in order

        code = run_command(words)
        signals.reported = True
    except KeyboardInterrupt:
        signals.reported = True
        is_unfinished = not _ON_FILES.isdisjoint(words)
        report("sim-bridge: interrupted" if is_unfinished else "sim-bridge: stopped")
        code = _INTERRUPTED if is_unfinished else 0
    return signals.end_with(code)


if __name__ == "__main__":
    sys.exit(main())

"""The command ``gcs``: the ground station on the command line.

``gcs --help`` prints a generated text: the import of the command line takes five times as long as Python's start.
"""

from __future__ import annotations

import json
import os
import signal
import sys

from flightstack.process.console import report_interrupt, say
from gcs_cli.help_generated import HELP, WIDTH

_INTERRUPTED = 130
"""``gcs_cli.errors.INTERRUPTED``, without the import."""


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if len(words) == 1 and words[0] in ("-h", "--help") and _columns() >= WIDTH and _prints(HELP):
        return 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends like Ctrl-C: the terminal is restored
    try:
        from gcs_cli.program import run

        return run(words)
    except KeyboardInterrupt:  # during the imports: `run` reports those of the command
        return _report_interrupt("--json" in words)


def _report_interrupt(as_json: bool) -> int:
    """Report an interrupt as ``gcs_cli.output.run_command`` does, without its imports."""
    report_interrupt("gcs: interrupted")
    if as_json:
        say(json.dumps({"event": "error", "message": "interrupted", "exit_code": _INTERRUPTED}))
    return _INTERRUPTED


def _columns() -> int:
    """Return the width of the terminal; that of the generated text without a terminal."""
    try:
        return int(os.environ.get("COLUMNS", "")) or WIDTH
    except ValueError:
        pass
    try:
        return os.get_terminal_size(1).columns or WIDTH
    except OSError:
        return WIDTH


def _prints(text: str) -> bool:
    """Print a text; return False if stdout is closed or full, which ``run`` reports."""
    try:
        print(text, flush=True)
    except (OSError, ValueError):
        return False
    return sys.stdout is not None


if __name__ == "__main__":
    sys.exit(main())

"""The command ``gcs``: the ground station on the command line.

``gcs --help`` prints a generated text: the import of the command line takes five times as long as Python's start.
"""

from __future__ import annotations

import contextlib
import os
import sys

from flightstack.process import collection
from flightstack.process.interrupts import report, signals
from gcs_cli.help_generated import HELP, WIDTH

_INTERRUPTED = 130
"""``gcs_cli.errors.INTERRUPTED``, without the import."""
_HELP = ("-h", "--help")
_FLYING = ("fly", "sim")
"""Commands with a simulator and a flight stack of their own."""


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    words = sys.argv[1:] if argv is None else argv
    try:
        signals.catch()
        code = _run(words)
        signals.reported = True
    except KeyboardInterrupt:  # outside the command: `run` reports those of the command
        signals.reported = True
        code = _report_interrupt("--json" in words)
    return signals.end_with(code)


def _run(words: list[str]) -> int:
    if len(words) == 1 and words[0] in _HELP and _columns() >= WIDTH and _prints(HELP):
        return 0
    with contextlib.ExitStack() as ends:
        prepared = None
        if _flies(words):
            from gcs_cli.fly.processes import prepare  # noqa: PLC0415  # other commands do without it

            with contextlib.suppress(OSError):  # the command reports it
                prepared = ends.enter_context(prepare())
        with collection.paused():
            from gcs_cli.program import run
        return run(words, prepared)


def _flies(words: list[str]) -> bool:
    """Return True if the command will start simulator and flight stack, which takes longer than its own imports."""
    return bool(words) and words[0] in _FLYING and not any(flag in words for flag in _HELP)


def _report_interrupt(as_json: bool) -> int:
    """Report an interrupt as ``gcs_cli.output.run_command`` does, without its imports."""
    report("gcs: interrupted")
    if as_json:
        import json  # noqa: PLC0415  # signals are caught before these imports

        from flightstack.process.console import say  # noqa: PLC0415

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

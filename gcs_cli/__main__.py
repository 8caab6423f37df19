"""The command ``gcs``: the ground station on the command line.

``gcs --help`` prints a generated text: the import of the command line takes five times as long as Python's start.
"""

from __future__ import annotations

import os
import sys

from gcs_cli.help_generated import HELP, WIDTH

_FAILED = 1
"""``gcs_cli.errors.FAILED``, without the import."""


def main(argv: list[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    words = sys.argv[1:] if argv is None else argv
    if len(words) == 1 and words[0] in ("-h", "--help") and _columns() >= WIDTH and _prints(HELP):
        return 0
    try:
        from gcs_cli.program import run

        return run(words)
    except KeyboardInterrupt:  # during the imports: `run` reports those of the command
        print("gcs: interrupted", file=sys.stderr)
        return _FAILED


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

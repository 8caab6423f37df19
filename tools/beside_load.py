"""Run a command while one busy process per processor core competes with it, and return its exit code.

python tools/beside_load.py COMMAND [ARG ...]
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator

BUSY = "while True: pass"


@contextlib.contextmanager
def busy() -> Iterator[None]:
    """Keep every core busy."""
    load = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for process in load:
            process.kill()
            process.wait()


def main(command: list[str]) -> int:
    """Run ``command`` beside the load; return its exit code."""
    if not command:
        print(__doc__, file=sys.stderr)
        return 2
    with busy():
        return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

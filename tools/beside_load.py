"""Run a command while one busy process per processor core competes with it, and return its exit code.

python tools/beside_load.py COMMAND [ARG ...]
"""

from __future__ import annotations

import os
import subprocess
import sys

BUSY = "while True: pass"


def main(command: list[str]) -> int:
    """Run ``command`` beside the load; return its exit code."""
    if not command:
        print(__doc__, file=sys.stderr)
        return 2
    load = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(os.cpu_count() or 1)]
    try:
        return subprocess.run(command, check=False).returncode
    finally:
        for process in load:
            process.kill()
            process.wait()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

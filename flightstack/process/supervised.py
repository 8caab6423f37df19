"""Run a module as a program that ends with its parent: ``python -m flightstack.process.supervised MODULE …``.

The parent holds the other end of standard input. The kernel closes it when the parent ends, by whatever signal; the
program then gets SIGTERM.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys
import threading


def _end_with_parent() -> None:
    """Send SIGTERM to this process when stdin closes. It is read without a buffer, whose lock blocks the exit."""
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    module = sys.argv.pop(1)
    runpy.run_module(module, run_name="__main__", alter_sys=True)

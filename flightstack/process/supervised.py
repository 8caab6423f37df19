"""Run a module that ends with its parent: ``python -m flightstack.process.supervised DESCRIPTOR MODULE …``.

The parent holds the other end of the pipe at the descriptor, usually standard input. The kernel closes it when the
parent ends, by whatever signal; the program then gets SIGTERM.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys
import threading

from flightstack.process.command_line import own_program


def supervised(module: str, *arguments: str, descriptor: int = 0) -> list[str]:
    """Return the command that runs a module of this installation until the pipe at ``descriptor`` closes."""
    return own_program("flightstack.process.supervised", str(descriptor), module, *arguments)


def _end_with_parent(descriptor: int) -> None:
    """Send SIGTERM to this process when the pipe closes. It is read without a buffer, whose lock blocks the exit."""
    while os.read(descriptor, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    pipe, module_name = int(sys.argv.pop(1)), sys.argv.pop(1)
    threading.Thread(target=_end_with_parent, args=(pipe,), daemon=True).start()
    runpy.run_module(module_name, run_name="__main__", alter_sys=True)

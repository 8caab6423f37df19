"""Run a module that ends with its parent: ``python -m flightstack.process.supervised DESCRIPTOR MODULE …``.

The parent holds the other end of the pipe at the descriptor, usually standard input. The kernel closes it when the
parent ends, by whatever signal; the program then gets SIGTERM.

With ``-`` for MODULE, the process imports the module that follows, and then reads on the pipe what it is to run: a line
of JSON, ``[OUTPUT, MODULE, ARGUMENT…]``, with the file of its output.
"""

from __future__ import annotations

import importlib
import json
import os
import runpy
import signal
import sys
import threading

from flightstack.process import collection
from flightstack.process.command_line import own_program

_READS = "-"


def supervised(module: str, *arguments: str, descriptor: int = 0) -> list[str]:
    """Return the command that runs a module of this installation until the pipe at ``descriptor`` closes."""
    return own_program("flightstack.process.supervised", str(descriptor), module, *arguments)


def prepared(imported: str) -> list[str]:
    """Return the command that imports a module, and then runs what it reads on standard input."""
    return supervised(_READS, imported)


def order(output: str, module: str, *arguments: str) -> bytes:
    """Return what to write to a ``prepared`` process: module, arguments and the file of its output, which exists."""
    return json.dumps([output, module, *arguments]).encode() + b"\n"


def _take_order(descriptor: int) -> str:
    """Read an order, and prepare for it; return its module. Exit if the pipe closes before."""
    line = b""
    while not line.endswith(b"\n"):
        if not (more := os.read(descriptor, 65536)):
            sys.exit()
        line += more
    output, module, *sys.argv[1:] = json.loads(line)
    file = os.open(output, os.O_WRONLY | os.O_APPEND)
    for standard in (1, 2):
        os.dup2(file, standard)
    os.close(file)
    return str(module)


def _end_with_parent(descriptor: int) -> None:
    """Send SIGTERM to this process when the pipe closes. It is read without a buffer, whose lock blocks the exit."""
    while os.read(descriptor, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    pipe, module_name = int(sys.argv.pop(1)), sys.argv.pop(1)
    if module_name == _READS:
        try:
            with collection.paused():
                importlib.import_module(sys.argv.pop(1))
        except BaseException:
            _take_order(pipe)  # its output is where the reason is looked for
            raise
        module_name = _take_order(pipe)
    threading.Thread(target=_end_with_parent, args=(pipe,), daemon=True).start()
    runpy.run_module(module_name, run_name="__main__", alter_sys=True)

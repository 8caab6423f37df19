"""Run a module that ends with its parent: ``python -m flightstack.process.supervised DESCRIPTOR MODULE …``.

The parent holds the other end of the pipe at the descriptor, usually standard input. The kernel closes it when the
parent ends, by whatever signal; the program then gets SIGTERM.

With ``-`` for MODULE, the process imports the modules that follow, and then reads on the pipe what it is to run: a line
of JSON, ``[OUTPUT, MODULE, ARGUMENT…]``, with the file of its output.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

from flightstack.process import collection

_READS = "-"
_ROOT = Path(__file__).resolve().parents[2]


def own_program(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of this installation.

    ``-P`` keeps Python from importing a folder of the same name in the working directory, unless the working
    directory is this installation.
    """
    safe = [] if Path.cwd() == _ROOT else ["-P"]
    return [sys.executable, *safe, "-m", module, *arguments]


def supervised(module: str, *arguments: str, descriptor: int = 0) -> list[str]:
    """Return the command that runs a module of this installation until the pipe at ``descriptor`` closes."""
    return own_program("flightstack.process.supervised", str(descriptor), module, *arguments)


def prepared(*imported: str) -> list[str]:
    """Return the command that imports modules, and then runs what it reads on standard input."""
    return supervised(_READS, *imported)


def order(output: str, module: str, *arguments: str) -> bytes:
    """Return what to write to a ``prepared`` process: module, arguments and the file of its output, which exists."""
    return json.dumps([output, module, *arguments]).encode() + b"\n"


class PreparedPrograms:
    """Processes that import the modules of a program, half of its start, and wait for their command lines.

    A command starts them before it imports what it needs itself. The end of the ``with`` block ends those that still
    wait.
    """

    def __init__(self, programs: Mapping[str, Sequence[str]]) -> None:
        """``programs`` are what each program imports first, by its module."""
        self._waiting = {
            module: subprocess.Popen(
                prepared(*imported),
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            for module, imported in programs.items()
        }

    def take(self, module: str, arguments: Sequence[str], output: Path) -> subprocess.Popen[bytes] | None:
        """Run ``module`` with its output in the file ``output``; return None if no process can.

        That is the case for another module, after the first call, and if the process has ended. One whose imports fail
        says why in ``output``.
        """
        process = self._waiting.get(module)
        if process is None or process.poll() is not None:
            return None
        assert process.stdin is not None
        try:
            process.stdin.write(order(str(output.absolute()), module, *arguments))
            process.stdin.flush()
        except OSError:
            return None
        del self._waiting[module]
        return process

    def __enter__(self) -> PreparedPrograms:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._waiting.values():
            process.kill()
            process.wait()
            assert process.stdin is not None
            with contextlib.suppress(OSError):
                process.stdin.close()


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
                for imported in sys.argv[1:]:
                    importlib.import_module(imported)
        except BaseException:
            _take_order(pipe)  # its output is where the reason is looked for
            raise
        module_name = _take_order(pipe)
    threading.Thread(target=_end_with_parent, args=(pipe,), daemon=True).start()
    runpy.run_module(module_name, run_name="__main__", alter_sys=True)

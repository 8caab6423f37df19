"""A Python module run as a process, whose output is read line by line.

Waits are for events (a line of output, the end of the process); their timeouts are hang guards.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from queue import Empty, Queue
from typing import Any

from tests.support.programs import PROGRAMS, Program, started_by

BOUND_S = 60.0
MOST_LINES = 200
IMPORTS = {
    "dask": ("gcs_cli.campaign.cluster", "distributed.cli.dask_scheduler", "distributed.cli.dask_worker")
}
"""Modules that a third party's program and its clients import: the warm server imports them once."""
SUPERVISOR = "flightstack.process.supervised"


def start(module: str, arguments: Sequence[str], listens: bool) -> Program | subprocess.Popen[str]:
    """Start one of ``PROGRAMS`` or ``IMPORTS`` from the warm server, another module in a new interpreter."""
    if module in PROGRAMS or module in IMPORTS:
        imports = IMPORTS.get(module, ())
        return Program(module, arguments, listens=listens, joins_output=True, imports=imports)
    return subprocess.Popen(
        [sys.executable, "-u", "-m", module, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.PIPE if listens else subprocess.DEVNULL,
        text=True,
    )


def children_of(pid: int) -> dict[str, int]:
    """Return module name and process id of the children of a process: from /proc, and of the warm server."""
    found = started_by(pid)
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            arguments = (entry / "cmdline").read_text().split("\0")
        except (OSError, IndexError):  # the process has ended
            continue
        if parent == pid and "-m" in arguments:
            module, *rest = arguments[arguments.index("-m") + 1 :]
            found[program_of(module, rest)] = int(entry.name)
    return found


def program_of(module: str, arguments: Sequence[str]) -> str:
    """Return the program that ``python -m MODULE ARGUMENTS`` runs: that of the supervisor, or the module."""
    if module != SUPERVISOR:
        return module
    _, program, *rest = arguments
    return program if program != "-" else rest[0].partition(".")[0]  # one that waits for its command line


def await_output(process: subprocess.Popen[Any], text: str) -> None:
    """Read the output of a process up to ``text``, or to its end."""
    assert process.stdout is not None
    seen = b""
    while text.encode() not in seen:
        assert select.select([process.stdout], [], [], BOUND_S)[0], seen.decode()
        if not (more := os.read(process.stdout.fileno(), 4096)):
            return
        seen += more


def wait_until(holds: Callable[[], object]) -> None:
    """Wait until ``holds``, asked every 20 ms: a loop without a pause takes the processor from what it waits for."""
    while not holds():
        select.select([], [], [], 0.02)


@contextlib.contextmanager
def ends_of(*processes: int) -> Iterator[None]:
    """Wait for the ends of processes, which what is done meanwhile causes."""
    watched = [os.pidfd_open(process) for process in processes]
    yield
    for descriptor in watched:
        assert select.select([descriptor], [], [], BOUND_S)[0]
        os.close(descriptor)


class Process:
    """A Python module that runs as a process; standard error is read together with standard output."""

    def __init__(self, module: str, *arguments: str, listens: bool = False) -> None:
        """Start the process; with ``listens`` its standard input is the lines of :meth:`tell`, else empty."""
        self.name = module
        self.popen = start(module, arguments, listens)
        self._fresh: Queue[str | None] = Queue()
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.popen.stdout is not None
        with self.popen.stdout as output:
            for line in output:
                self.lines.append(line.rstrip())
                self._fresh.put(line)
        self._fresh.put(None)

    def next_line(self) -> str | None:
        """Return the next line of output; None at its end, or after BOUND_S without output."""
        try:
            return self._fresh.get(timeout=BOUND_S)
        except Empty:
            return None

    def wait_for(self, text: str) -> str:
        """Wait for a line of output that has ``text``, and return it."""
        for _ in range(MOST_LINES):
            line = self.next_line()
            assert line is not None, f"{self.name} never said {text!r}: {self.output}"
            if text in line:
                return line
        raise AssertionError(f"{self.name} did not say {text!r} in {MOST_LINES} lines: {self.output}")

    def tell(self, line: str) -> None:
        """Write a line to the standard input of the process."""
        assert self.popen.stdin is not None
        self.popen.stdin.write(line + "\n")
        self.popen.stdin.flush()

    def end(self) -> int:
        """Close its input, wait for its end and return its exit code."""
        if self.popen.stdin is not None:
            self.popen.stdin.close()
        code = self.popen.wait(BOUND_S)
        self._reader.join(BOUND_S)
        return code

    def kill(self) -> None:
        self.popen.kill()
        self.end()

    @property
    def is_running(self) -> bool:
        return self.popen.poll() is None

    def interrupt(self) -> None:
        self.popen.send_signal(signal.SIGINT)

    @property
    def output(self) -> str:
        return "\n".join(self.lines)

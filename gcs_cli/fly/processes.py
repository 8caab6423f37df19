"""Child processes, which always end with their parent and write to files; signals as a flag."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, Protocol, TypeVar

from flightstack.process.supervised import PreparedPrograms, supervised

_TAIL_BYTES = 4096
_POLL_S = 0.005
_NOTICE = re.compile(r"\S+: (warning: |compiling )|.*\wWarning: ")
"""A line to show in flight: a warning of the child or of one of its libraries, or progress of compilation."""
_BLAME = ("lost at", "lost:", "was shut down")  # in the last line of simulator or flight stack


_IMPORTED = {
    "flightstack": ("flightstack.process.program",),
    "sim_bridge": ("sim_bridge.program", "sim_bridge.server.quiet_exchanges"),
}
"""What a program imports first, by its module."""


def prepare(*modules: str) -> PreparedPrograms:
    """Start the programs of these modules, which wait for their command lines."""
    return PreparedPrograms({module: _IMPORTED[module] for module in modules or _IMPORTED})


class Process(Protocol):
    """A process, running or ended."""

    @property
    def exit_code(self) -> int | None:
        """Exit code; negative when a signal ended it, None while it runs."""

    @property
    def blames_another(self) -> bool:
        """True if it ended because another process did."""


P = TypeVar("P", bound=Process)


def is_explained(processes: Sequence[Process]) -> bool:
    """Return True if the processes that have ended explain the end of all.

    Each process depends on those before it. One that failed without blaming another is the cause. One that ended in
    order without blaming another is the cause only if it is the last: its dependants may have ended before it.
    """
    *others, last = processes
    failed = (other for other in others if other.exit_code and not other.blames_another)
    if next(failed, None) is not None or all(process.exit_code is not None for process in processes):
        return True
    return last.exit_code is not None and not last.blames_another


def culprit(processes: Sequence[P]) -> P | None:
    """Return the process whose end caused the others to end; each depends on those before it.

    One that a signal ended comes first, then one that blames no other. Of two that ended in order, the dependent one
    would have blamed the other.
    """
    ended = [process for process in reversed(processes) if process.exit_code is not None]
    return min(
        ended, key=lambda process: ((process.exit_code or 0) >= 0, process.blames_another), default=None
    )


class Child:
    """One child process, in a session of its own, which Ctrl-C on the terminal does not reach.

    Its standard input is a pipe that closes at the latest when this process ends.
    """

    def __init__(self, name: str, process: subprocess.Popen[bytes], log_path: Path) -> None:
        self.name = name
        self._log_path = log_path
        self._read = 0
        self._process = process

    @classmethod
    def start(cls, name: str, command: Sequence[str], log_path: Path) -> Child:
        """Start a command with its output in ``log_path``."""
        with log_path.open("wb") as log:
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
            )
        return cls(name, process, log_path)

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code; negative when a signal ended it, None while it runs."""
        return self._process.poll()

    def notices(self) -> list[str]:
        """Return the warnings and progress lines written since the last call."""
        with self._log_path.open("rb") as log:
            log.seek(self._read)
            text, newline, _ = log.read().rpartition(b"\n")
        self._read += len(text) + len(newline)
        return [line for line in text.decode(errors="replace").splitlines() if _NOTICE.match(line)]

    @property
    def last_line(self) -> str:
        """The last line of its output, which gives the reason of its end."""
        with self._log_path.open("rb") as log:
            log.seek(max(0, self._log_path.stat().st_size - _TAIL_BYTES))
            lines = log.read().decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")

    @property
    def blames_another(self) -> bool:
        """True if it ended because another process did."""
        return any(words in self.last_line for words in _BLAME)

    @property
    def end_reason(self) -> str:
        """How it ended, in one clause."""
        code = self.exit_code
        if code is not None and code < 0:  # its last line has another subject
            return f"{self.name} was killed by signal {-code}"
        ending = f"ended with code {code}"
        said = self.last_line.removeprefix(f"{self.name}: ")
        return f"{self.name} {ending}" + (f": {said}" if said else "")

    def terminate(self) -> None:
        """Send SIGTERM, unless it has ended."""
        self._process.terminate()

    def kill(self) -> None:
        """Send SIGKILL and wait."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        self._process.stdin.close()


class Children:
    """The children of a run. Leaving the ``with`` block ends them all, and so does the end of this process.

    The last one started is stopped first: it depends on those before it.
    """

    def __init__(self, folder: Path, prepared: PreparedPrograms | None = None) -> None:
        """``prepared`` become children of their modules."""
        self._folder = folder
        self._prepared = prepared
        self._all: list[Child] = []

    def start(self, name: str, module: str, arguments: Sequence[str]) -> Child:
        """Start a Python module of this installation; its output goes to ``<name>.log``."""
        log_path = self._folder / f"{name}.log"
        log_path.write_bytes(b"")
        process = None if self._prepared is None else self._prepared.take(module, arguments, log_path)
        if process is None:
            child = Child.start(name, supervised(module, *arguments), log_path)
        else:
            child = Child(name, process, log_path)
        self.add(child)
        return child

    def add(self, child: Child) -> None:
        """Add a child."""
        self._all.append(child)

    def notices(self) -> list[str]:
        """Return the warnings and progress lines of all children since the last call."""
        return [line for child in self._all for line in child.notices()]

    def ended(self) -> list[Child]:
        """Return those that have ended."""
        return [child for child in self._all if child.exit_code is not None]

    def wait(self, timeout_s: float) -> bool:
        """Wait until all have ended; return False after ``timeout_s``."""
        return _wait(self._all, timeout_s)

    def culprit(self, timeout_s: float) -> Child | None:
        """Wait until the end is explained, ``timeout_s`` at most; return the child that caused it."""
        _wait_until(lambda: is_explained(self._all), timeout_s)
        return culprit(self._all)

    def stop(self, timeout_s: float = 5.0) -> None:
        """Terminate each child, and kill it after ``timeout_s``."""
        for child in reversed(self._all):
            if child.exit_code is None:
                child.terminate()
                if not _wait([child], timeout_s):
                    child.kill()

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self.stop()
        finally:  # a second Ctrl-C in between
            for child in self._all:
                child.kill()


def _wait(children: Sequence[Child], timeout_s: float) -> bool:
    return _wait_until(lambda: all(child.exit_code is not None for child in children), timeout_s)


def _wait_until(condition: Callable[[], bool], timeout_s: float) -> bool:
    end_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() >= end_s:
            return False
        time.sleep(_POLL_S)
    return True


class Interruption:
    """Keeps the first SIGINT, SIGTERM or SIGHUP as ``reason``; the second one raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.reason = ""
        self._before: dict[int, Any] = {}

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if self.reason:
            raise KeyboardInterrupt
        self.reason = (
            "interrupted" if number == signal.SIGINT else f"interrupted ({signal.Signals(number).name})"
        )

    def __enter__(self) -> Interruption:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

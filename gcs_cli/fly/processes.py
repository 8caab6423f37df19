"""Child processes: started, watched and always ended; their output goes to files."""

from __future__ import annotations

import re
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from flightstack.process.command_line import own_program

_TAIL_BYTES = 4096
_POLL_S = 0.02
_NOTICE = re.compile(r"\S+: (warning: |compiling )|.*\wWarning: ")
"""A line to show in flight: a warning of the child or of a library of its, or progress of compilation."""
_BLAME = ("lost at", "lost:", "was shut down")  # in the words of simulator and flight stack


class Process(Protocol):
    """A process that has ended, or not yet."""

    @property
    def exit_code(self) -> int | None:
        """Exit code; negative when a signal ended it, None while it runs."""

    @property
    def blames_another(self) -> bool:
        """Whether it ended because another process did."""


P = TypeVar("P", bound=Process)


def is_explained(processes: Sequence[Process]) -> bool:
    """Tell whether those that have ended say why, so that nobody else need be waited for.

    Each process depends on those before it. One that failed, and blames nobody, is the cause. One that ended in
    order and blames nobody is it only if it is the last: those that depend on it may have ended first, in order.
    """
    *others, last = processes
    failed = (other for other in others if other.exit_code and not other.blames_another)
    if next(failed, None) is not None or all(process.exit_code is not None for process in processes):
        return True
    return last.exit_code is not None and not last.blames_another


def culprit(processes: Sequence[P]) -> P | None:
    """Return the one whose end made the others end; each depends on those before it.

    A signal comes before all else, then who blames nobody. Of two that ended in order, the one that depends on
    the other would have blamed it.
    """
    ended = [process for process in reversed(processes) if process.exit_code is not None]
    return min(
        ended, key=lambda process: ((process.exit_code or 0) >= 0, process.blames_another), default=None
    )


class Child:
    """One child process, in a session of its own: Ctrl-C on our terminal is ours to handle."""

    def __init__(self, name: str, arguments: Sequence[str], log_path: Path) -> None:
        self.name = name
        self._log_path = log_path
        self._read = 0
        with log_path.open("wb") as log:
            self._process = subprocess.Popen(
                arguments,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code; negative when a signal ended it, None while it runs."""
        return self._process.poll()

    def notices(self) -> list[str]:
        """Return warnings and progress that it wrote since the last call, whole lines."""
        with self._log_path.open("rb") as log:
            log.seek(self._read)
            text, newline, _ = log.read().rpartition(b"\n")
        self._read += len(text) + len(newline)
        return [line for line in text.decode(errors="replace").splitlines() if _NOTICE.match(line)]

    @property
    def last_line(self) -> str:
        """The last line that it wrote, which says why it ended."""
        with self._log_path.open("rb") as log:
            log.seek(max(0, self._log_path.stat().st_size - _TAIL_BYTES))
            lines = log.read().decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")

    @property
    def blames_another(self) -> bool:
        """Whether it ended because another process did."""
        return any(words in self.last_line for words in _BLAME)

    @property
    def obituary(self) -> str:
        """How it ended, in one clause."""
        code = self.exit_code
        if code is not None and code < 0:  # its last line was about something else
            return f"{self.name} was killed by signal {-code}"
        ending = f"ended with code {code}"
        said = self.last_line.removeprefix(f"{self.name}: ")
        return f"{self.name} {ending}" + (f": {said}" if said else "")

    def terminate(self) -> None:
        """Ask it to end; nothing happens when it has."""
        self._process.terminate()

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait()


class Children:
    """The children of a run. Leaving the ``with`` block ends them all.

    What was started last is stopped first: it depends on those before it.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._all: list[Child] = []

    def start(self, name: str, module: str, arguments: Sequence[str]) -> Child:
        """Start a Python module of this installation; its output goes to ``<name>.log``."""
        child = Child(name, own_program(module, *arguments), self._folder / f"{name}.log")
        self.add(child)
        return child

    def add(self, child: Child) -> None:
        """Take charge of a child."""
        self._all.append(child)

    def notices(self) -> list[str]:
        """Return the warnings and the progress that the children wrote since the last call."""
        return [line for child in self._all for line in child.notices()]

    def ended(self) -> list[Child]:
        """Return those that have ended."""
        return [child for child in self._all if child.exit_code is not None]

    def wait(self, timeout_s: float) -> bool:
        """Wait until all have ended; return False when they have not within ``timeout_s``."""
        return _wait(self._all, timeout_s)

    def culprit(self, timeout_s: float) -> Child | None:
        """Wait until those that have ended, or are about to, say why; return the one that began it."""
        _wait_until(lambda: is_explained(self._all), timeout_s)
        return culprit(self._all)

    def stop(self, patience_s: float = 5.0) -> None:
        """Ask each to end, and kill it when it does not within ``patience_s``."""
        for child in reversed(self._all):
            if child.exit_code is None:
                child.terminate()
                if not _wait([child], patience_s):
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

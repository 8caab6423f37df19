"""Child processes: started, watched and always ended; their output goes to files."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

_TAIL_BYTES = 4096
_POLL_S = 0.02
_BLAME = ("lost at", "lost:", "was shut down")  # in the words of simulator and flight stack


class Child:
    """One child process, in a session of its own: Ctrl-C on our terminal is ours to handle."""

    def __init__(self, name: str, arguments: Sequence[str], log_path: Path) -> None:
        self.name = name
        self._log_path = log_path
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
        child = Child(name, [sys.executable, "-m", module, *arguments], self._folder / f"{name}.log")
        self.add(child)
        return child

    def add(self, child: Child) -> None:
        """Take charge of a child."""
        self._all.append(child)

    def ended(self) -> list[Child]:
        """Return those that have ended."""
        return [child for child in self._all if child.exit_code is not None]

    def wait(self, timeout_s: float) -> bool:
        """Wait until all have ended; return False when they have not within ``timeout_s``."""
        return _wait(self._all, timeout_s)

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
    end_s = time.monotonic() + timeout_s
    while any(child.exit_code is None for child in children):
        if time.monotonic() >= end_s:
            return False
        time.sleep(_POLL_S)
    return True

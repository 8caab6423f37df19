"""Log files of one process: naming, and reading while they are written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from flightstack.flight_log.flight_log import FlightLog
from flightstack.process.log_library import create_log_file

RUNS = Path("runs")


def default_log(instance: int, stamp: str) -> Path:
    """Return the default log path at time ``stamp``.

    Each instance has its own folder, because ground stations can list and erase all logs of a folder.
    """
    folder = RUNS if instance == 0 else RUNS / f"instance-{instance}"
    return folder / f"{stamp}-flight.ulg"


class LogFiles:
    """Opens ``first`` for the first flight and numbered files for the next ones.

    Numbers of existing files are skipped. Only ``first`` may be overwritten, with ``overwrite``.
    """

    def __init__(self, first: Path | None, overwrite: bool = False) -> None:
        self._first = first
        self._overwrite = overwrite
        self._count = 0
        self.current: Path | None = None
        """The newest log, open or closed."""

    def open(self, rotors: int) -> FlightLog | None:
        """Open the next log, or return None if logging is off; raise OSError."""
        if self._first is None:
            return None
        while True:
            self._count += 1
            path = self.current = self._numbered(self._first)
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                file = create_log_file(path, self._overwrite and self._count == 1)
            except FileExistsError:
                continue
            return FlightLog(file, rotors)

    def _numbered(self, first: Path) -> Path:
        is_device = first.exists() and not first.is_file()
        if self._count == 1 or is_device:
            return first
        return first.with_name(f"{first.stem}-{self._count}{first.suffix}")

    def tail(self, is_logging: Callable[[], bool]) -> FileTail | None:
        """Open the current log for reading while it is written, or return None."""
        path = self.current
        if path is None or not is_logging():
            return None
        try:
            return FileTail(path, lambda: is_logging() and self.current == path)
        except OSError:
            return None


class FileTail:
    """A growing file, read from the start; implements ``services.logs.log_store.LogTail``."""

    def __init__(self, path: Path, is_open: Callable[[], bool]) -> None:
        """Open ``path``; ``is_open`` returns True while it is written. Raise OSError."""
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._offset = 0
        self._is_open = is_open

    def read(self, count: int) -> bytes:
        """Return up to ``count`` new bytes; b"" without any or if reading fails."""
        try:
            data = os.pread(self._descriptor, count, self._offset) if self._descriptor >= 0 else b""
        except OSError:
            return b""
        self._offset += len(data)
        return data

    @property
    def ended(self) -> bool:
        """True if the file does not grow any more."""
        return self._descriptor < 0 or not self._is_open()

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

"""The files of one process's flight logs: named one after the other, and readable while they are written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from flightstack.flight_log.flight_log import FlightLog
from flightstack.process.log_library import create_log_file

RUNS = Path("runs")


def default_log(instance: int, stamp: str) -> Path:
    """Return where a vehicle that is told nothing begins its logs, at ``stamp``.

    A vehicle shows its ground stations, and erases for them, the logs of one folder; so each has a folder of its own.
    """
    folder = RUNS if instance == 0 else RUNS / f"instance-{instance}"
    return folder / f"{stamp}-flight.ulg"


class LogFiles:
    """Opens ``first`` for the first flight, and for the next ones files with a number behind its name.

    A file that exists is left alone, and the next free number taken; but ``first`` may be overwritten if the user
    said so.
    """

    def __init__(self, first: Path | None, overwrite: bool = False) -> None:
        self._first = first
        self._overwrite = overwrite
        self._count = 0
        self.current: Path | None = None
        """The newest log, finished or not."""

    def open(self, rotors: int) -> FlightLog | None:
        """Begin the next log; None if there are to be none. Raise OSError."""
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
        """Return the log that is being written, to be read along; None while there is none."""
        path = self.current
        if path is None or not is_logging():
            return None
        try:
            return FileTail(path, lambda: is_logging() and self.current == path)
        except OSError:
            return None


class FileTail:
    """A growing file, read from its beginning; implements ``services.logs.log_stream.LogTail``."""

    def __init__(self, path: Path, is_open: Callable[[], bool]) -> None:
        """Open ``path``, raise OSError; ``is_open`` tells whether somebody still writes to it."""
        self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._offset = 0
        self._is_open = is_open

    def read(self, count: int) -> bytes:
        """Return the next bytes, at most ``count``; none if nothing new is there or the file cannot be read."""
        try:
            data = os.pread(self._descriptor, count, self._offset) if self._descriptor >= 0 else b""
        except OSError:
            return b""
        self._offset += len(data)
        return data

    @property
    def ended(self) -> bool:
        """Whether nothing will be added."""
        return self._descriptor < 0 or not self._is_open()

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

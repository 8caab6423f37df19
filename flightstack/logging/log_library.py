"""The folder of flight logs: the only place that opens log files, and it opens nothing else.

A log is a regular file of this folder whose name ends in ``.ulg``. What leads out of the folder (a path, a symbolic
link) is no log, whatever a ground station asks for.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import stat
from pathlib import Path
from typing import BinaryIO

from flightstack.mavlink.services.log_store import LogInfo

SUFFIX = ".ulg"
_OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | os.O_CLOEXEC
MAX_LOGS = 65_535
"""LOG_ENTRY counts in 16 bits; of more, the newest are shown."""


class LogFileReader:
    """An open log. Its size is what it was when it was opened: the log of this flight goes on growing."""

    def __init__(self, descriptor: int, size: int) -> None:
        self._descriptor = descriptor
        self._size = size

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._size

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset``; raise OSError."""
        return os.pread(self._descriptor, max(0, min(count, self._size - offset)), offset)

    def is_being_written(self) -> bool:
        """Tell whether somebody holds it open as ``create_log_file`` does."""
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            return error.errno == errno.EWOULDBLOCK
        fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        return False

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def create_log_file(path: Path, overwrite: bool = False) -> BinaryIO:
    """Open a new log for writing, unbuffered; raise OSError, FileExistsError for a file unless ``overwrite``.

    A lock that lasts until it is closed tells every process, this one too, that it is being written.
    """
    is_file = path.is_file() or not path.exists()  # a device or a pipe is written to
    file = open(path, "xb" if is_file and not overwrite else "wb", buffering=0)  # noqa: SIM115  # its owner closes it
    with contextlib.suppress(OSError):  # some file systems know no locks
        fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
    return file


class LogLibrary:
    """The logs in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def logs(self) -> list[LogInfo]:
        """Return all logs, the oldest first; none if the folder cannot be read."""
        found: list[tuple[int, str, LogInfo]] = []
        with contextlib.suppress(OSError), os.scandir(self._folder) as entries:
            for entry in entries:
                status = _status(entry)
                if status is not None and is_log_name(entry.name):
                    info = LogInfo(entry.name, status.st_size, max(0, int(status.st_mtime)) & 0xFFFF_FFFF)
                    found.append((status.st_mtime_ns, entry.name, info))
        return [info for _, _, info in sorted(found)][-MAX_LOGS:]

    def open(self, name: str) -> LogFileReader | None:
        """Open a log; None if there is none of this name. Raise OSError when it cannot be read."""
        if not is_log_name(name):
            return None
        try:
            descriptor = os.open(self._folder / name, _OPEN_FLAGS)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            if error.errno == errno.ELOOP:  # a symbolic link
                return None
            raise
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            os.close(descriptor)
            return None
        return LogFileReader(descriptor, status.st_size)

    def erase(self) -> int:
        """Erase all logs but those being written; return how many. Raise OSError at the first that stays."""
        count = 0
        for log in self.logs():
            reader = self.open(log.name)
            if reader is not None and not reader.is_being_written():
                (self._folder / log.name).unlink(missing_ok=True)
                count += 1
            if reader is not None:
                reader.close()
        return count


def is_log_name(name: str) -> bool:
    """Tell whether ``name`` may be a log: one plain part of a path that can be shown and sent."""
    return (
        name.endswith(SUFFIX)
        and not name.startswith(".")
        and "/" not in name
        and "\\" not in name
        and name.isprintable()
        and len(name.encode(errors="replace")) <= 200
    )


def _status(entry: os.DirEntry[str]) -> os.stat_result | None:
    """Return the status of a regular file; None for anything else, and for what just vanished."""
    try:
        status = entry.stat(follow_symlinks=False)
    except OSError:
        return None
    return status if stat.S_ISREG(status.st_mode) else None

"""The folder of flight logs: the only place that opens log files, and it opens nothing else.

A log is a regular file of this folder whose name ends in ``.ulg``. What leads out of the folder (a path, a symbolic
link) is no log, whatever a ground station asks for.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import math
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, NamedTuple

from flightstack.mavlink.services.log_store import LogInfo

SUFFIX = ".ulg"
_OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | os.O_CLOEXEC
MAX_LOGS = 65_535
"""LOG_ENTRY counts in 16 bits; of more, the newest are shown."""
LOOK_S = 1.0
"""Time between two looks at the folder [s]."""
LATELY_S = 60.0
"""A log written so lately may still grow [s]."""


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


class _Known(NamedTuple):
    """A file of the folder as it was when it was last examined."""

    inode: int
    written_ns: int
    info: LogInfo | None
    """None for what is no log, or not examined yet."""


class LogLibrary:
    """The logs in ``folder``, by an index in memory.

    The folder is examined at most once in ``LOOK_S``, and at once when ``own_log`` returns something else than before,
    because a log of this process began or ended. Only new files and those written lately are examined again.
    """

    def __init__(self, folder: Path, own_log: Callable[[], object] = lambda: None) -> None:
        self._folder = folder
        self._own_log = own_log
        self._own: object = None
        self._known: dict[str, _Known] = {}
        self._logs: tuple[LogInfo, ...] = ()
        self._folder_written_ns = -1
        self._looked_s = -math.inf

    def logs(self) -> tuple[LogInfo, ...]:
        """Return all logs, the oldest first; none if the folder cannot be read. The same object until they change."""
        now_s, own = time.time(), self._own_log()
        if own != self._own or not 0.0 <= now_s - self._looked_s < LOOK_S:
            self._own = own
            self._look(now_s)
        return self._logs

    def _look(self, now_s: float) -> None:
        """Bring the index up to date."""
        self._looked_s = now_s
        lately_ns = int((now_s - LATELY_S) * 1e9)
        try:
            written_ns = self._folder.stat().st_mtime_ns
            listed = self._known if written_ns == self._folder_written_ns else self._listed()
            is_settled = written_ns < int((now_s - LOOK_S) * 1e9)  # a change in this instant has its own time
            self._folder_written_ns = written_ns if is_settled else -1
        except OSError:
            listed, self._folder_written_ns = {}, -1
        changed = {
            name: fresh
            for name, known in listed.items()
            if (known.info is None or known.written_ns > lately_ns)
            and (fresh := self._examined(name, known.inode)) != known
        }
        if changed or listed.keys() != self._known.keys():
            self._known = {**listed, **changed}
            logs = sorted((k.written_ns, k.info.name, k.info) for k in self._known.values() if k.info)
            self._logs = tuple(info for _, _, info in logs[-MAX_LOGS:])

    def _listed(self) -> dict[str, _Known]:
        """Return the files that are there, as far as they are known; raise OSError."""
        listed = {}
        with os.scandir(self._folder) as entries:
            for entry in entries:
                known, inode = self._known.get(entry.name), entry.inode()
                if known is not None and known.inode == inode:
                    listed[entry.name] = known
                elif is_log_name(entry.name):
                    listed[entry.name] = _Known(inode, 0, None)
        return listed

    def _examined(self, name: str, inode: int) -> _Known:
        """Return what a file is: a log if it is a regular file."""
        try:
            status = os.stat(self._folder / name, follow_symlinks=False)
        except OSError:  # it just vanished
            return _Known(inode, 0, None)
        info = LogInfo(name, status.st_size, max(0, int(status.st_mtime)) & 0xFFFF_FFFF)
        return _Known(inode, status.st_mtime_ns, info if stat.S_ISREG(status.st_mode) else None)

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
        self._look(time.time())
        for log in self._logs:
            reader = self.open(log.name)
            if reader is not None and not reader.is_being_written():
                (self._folder / log.name).unlink(missing_ok=True)
                count += 1
            if reader is not None:
                reader.close()
        self._look(time.time())
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

"""The folder of flight logs, with access restricted to its log files.

A log is a regular file in this folder whose name ends in ``.ulg``. Paths and symbolic links out of the folder are
refused.
"""

from __future__ import annotations

import errno
import fcntl
import math
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, NamedTuple

from flightstack.services.logs.log_store import LogInfo, LogTail

SUFFIX = ".ulg"
_OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | os.O_CLOEXEC
MAX_LOGS = 65_535
"""Limit of LOG_ENTRY's 16-bit count; the newest logs are listed."""
SCAN_INTERVAL_S = 1.0
"""Interval of folder scans [s]."""
RECENT_S = 60.0
"""Files written within this time [s] are examined at each scan, all others once per this time."""
_LOCK_TRIES, _LOCK_WAIT_S = 100, 1e-3


class LogFileReader:
    """An open log with its size at opening; the log of the current flight still grows."""

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

    def claim(self) -> bool:
        """Lock the log against ``create_log_file`` until it is closed; return False if it is being written."""
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:  # not all file systems support locks
            return error.errno != errno.EWOULDBLOCK
        return True

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def create_log_file(path: Path, overwrite: bool = False) -> BinaryIO:
    """Open a new log for unbuffered writing; raise OSError, FileExistsError for an existing file unless ``overwrite``.

    A shared lock marks the file as being written until it is closed. A log that was erased before it was locked is
    created again.
    """
    is_file = path.is_file() or not path.exists()  # a device or a pipe is opened as it is
    while True:
        file = open(path, "xb" if is_file and not overwrite else "wb", buffering=0)  # noqa: SIM115  # closed by its owner
        _lock(file)
        if not is_file or _is_at(path, file):
            return file
        file.close()


def _lock(file: BinaryIO) -> None:
    """Lock a log, without a lock after ``_LOCK_TRIES``; an erase holds its lock for microseconds."""
    for _ in range(_LOCK_TRIES):
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_LOCK_WAIT_S)
        except OSError:  # not all file systems support locks
            return
        else:
            return


def _is_at(path: Path, file: BinaryIO) -> bool:
    """Return True if ``path`` still names the open file."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


class _Known(NamedTuple):
    """A file of the folder at its last examination."""

    inode: int
    written_ns: int
    info: LogInfo | None
    """None if it is no log or not examined yet."""


class LogLibrary:
    """Index of the logs in ``folder``.

    ``own_log`` returns the name of the log that this process writes, or None; ``open_tail`` opens it for streaming. At
    most once per ``SCAN_INTERVAL_S``, new files, recently written ones and the own log are examined; all files once per
    ``RECENT_S`` and when the own log starts or ends.
    """

    def __init__(
        self,
        folder: Path,
        own_log: Callable[[], str | None] = lambda: None,
        open_tail: Callable[[], LogTail | None] = lambda: None,
    ) -> None:
        self._folder = folder
        self._own_log = own_log
        self.open_tail = open_tail
        self._own: str | None = None
        self._known: dict[str, _Known] = {}
        self._logs: tuple[LogInfo, ...] = ()
        self._folder_written_ns = -1
        self._scan_s = self._full_scan_s = -math.inf

    def logs(self) -> tuple[LogInfo, ...]:
        """Return all logs, oldest first; empty if the folder cannot be read. The same object until a change."""
        now_s, own = time.time(), self._own_log()
        if own != self._own:
            self._own, self._full_scan_s = own, -math.inf
        if self._full_scan_s == -math.inf or not 0.0 <= now_s - self._scan_s < SCAN_INTERVAL_S:
            self._scan(now_s)
        return self._logs

    def _scan(self, now_s: float) -> None:
        """Update the index."""
        self._scan_s = now_s
        is_full = not 0.0 <= now_s - self._full_scan_s < RECENT_S
        if is_full:
            self._full_scan_s = now_s
        recent_ns = int((now_s - RECENT_S) * 1e9)
        try:
            written_ns = self._folder.stat().st_mtime_ns
            listed = self._known if written_ns == self._folder_written_ns else self._listed()
            is_settled = written_ns < int((now_s - SCAN_INTERVAL_S) * 1e9)  # later changes have another time
            self._folder_written_ns = written_ns if is_settled else -1
        except OSError:
            listed, self._folder_written_ns = {}, -1
        changed = {
            name: fresh
            for name, known in listed.items()
            if (is_full or known.info is None or known.written_ns > recent_ns or name == self._own)
            and (fresh := self._examined(name, known.inode)) != known
        }
        if changed or listed.keys() != self._known.keys():
            self._known = {**listed, **changed}
            logs = sorted((k.written_ns, k.info.name, k.info) for k in self._known.values() if k.info)
            self._logs = tuple(info for _, _, info in logs[-MAX_LOGS:])

    def _listed(self) -> dict[str, _Known]:
        """Return the files in the folder, with known information; raise OSError."""
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
        """Examine a file, which is a log if it is regular."""
        try:
            status = os.stat(self._folder / name, follow_symlinks=False)
        except OSError:  # removed meanwhile
            return _Known(inode, 0, None)
        info = LogInfo(name, status.st_size, max(0, int(status.st_mtime)) & 0xFFFF_FFFF)
        return _Known(inode, status.st_mtime_ns, info if stat.S_ISREG(status.st_mode) else None)

    def open(self, name: str) -> LogFileReader | None:
        """Open a log; return None if it does not exist. Raise OSError."""
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
        """Erase all logs that are not being written; return the number. Raise OSError at the first failure."""
        count = 0
        self._scan(time.time())
        for log in self._logs:
            reader = self.open(log.name)
            if reader is not None and reader.claim():
                (self._folder / log.name).unlink(missing_ok=True)
                count += 1
            if reader is not None:
                reader.close()
        self._scan(time.time())
        return count


def is_log_name(name: str) -> bool:
    """Return True for a valid log name: one path component of printable characters."""
    return (
        name.endswith(SUFFIX)
        and not name.startswith(".")
        and "/" not in name
        and "\\" not in name
        and name.isprintable()
        and len(name.encode(errors="replace")) <= 200
    )

"""Interface to the stored flight logs, and their directories for MAVLink FTP."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple, Protocol

from flightstack.mavlink.files import Entry, VirtualFile, clean_path


class LogInfo(NamedTuple):
    """One log."""

    name: str
    """File name, unique among the logs."""
    size: int
    """Size [bytes]; the log of the current flight still grows."""
    time_utc_s: int
    """Time of the last write, in seconds since 1970; 0 if unknown."""

    @property
    def day(self) -> str:
        """Date of ``time_utc_s``, in the format of PX4's log directories."""
        return datetime.fromtimestamp(self.time_utc_s, UTC).strftime("%Y-%m-%d")


class LogTail(Protocol):
    """Reader of the log in progress, from its beginning."""

    def read(self, count: int) -> bytes:
        """Return the next bytes, at most ``count``; none if there are no new ones."""
        ...

    @property
    def ended(self) -> bool:
        """True if the log is complete."""
        ...

    def close(self) -> None:
        """Close the reader."""
        ...


class LogStore(Protocol):
    """The logs of one vehicle."""

    def logs(self) -> Sequence[LogInfo]:
        """Return all logs, oldest first. The same object is returned until a log changes."""
        ...

    def open(self, name: str) -> VirtualFile | None:
        """Open a log; return None if the name does not exist. Raise OSError if it cannot be read."""
        ...

    def open_tail(self) -> LogTail | None:
        """Open the log in progress to stream it; return None while there is none."""
        ...

    def erase(self) -> int:
        """Erase all logs but the one in progress; return their number. Raise OSError."""
        ...


class NoLogs:
    """Store of a vehicle without logs."""

    def logs(self) -> Sequence[LogInfo]:
        """Return an empty list."""
        return ()

    def open(self, name: str) -> VirtualFile | None:
        """Return None."""
        return None

    def open_tail(self) -> None:
        """Return None."""
        return

    def erase(self) -> int:
        """Erase nothing."""
        return 0


NO_LOGS = NoLogs()


class FlatLogs:
    """All logs in one directory, for QGroundControl at ``@MAV_LOG``."""

    def __init__(self, store: LogStore) -> None:
        self._store = store
        self._listed: Sequence[LogInfo] = ()
        self._entries: list[Entry] = []

    def list(self, path: str) -> list[Entry] | None:
        """Return the logs in the order of their ids."""
        logs = self._store.logs()
        if logs is not self._listed:
            self._listed, self._entries = logs, [Entry(log.name, log.size) for log in logs]
        return None if path else self._entries

    def open(self, path: str) -> VirtualFile | None:
        """Open a log by name."""
        return None if "/" in path else self._store.open(path)


class DatedLogs:
    """Logs in one directory per day, as PX4 in ``/fs/microsd/log``."""

    def __init__(self, store: LogStore) -> None:
        self._store = store
        self._listed: Sequence[LogInfo] = ()
        self._by_day: dict[str, dict[str, Entry]] = {}

    def list(self, path: str) -> list[Entry] | None:
        """Return the days, or the logs of a day."""
        days = self._days()
        if not path:
            return [Entry(day, None) for day in days]
        return list(days.get(path, {}).values()) or None

    def open(self, path: str) -> VirtualFile | None:
        """Open ``day/name``."""
        day, _, name = (clean_path(path) or "").partition("/")
        return self._store.open(name) if name in self._days().get(day, {}) else None

    def _days(self) -> dict[str, dict[str, Entry]]:
        """Return the logs of each day by name, days in order; cached until the logs change."""
        logs = self._store.logs()
        if logs is not self._listed:
            by_day: dict[str, dict[str, Entry]] = {}
            for log in logs:
                by_day.setdefault(log.day, {})[log.name] = Entry(log.name, log.size)
            self._listed, self._by_day = logs, dict(sorted(by_day.items()))
        return self._by_day

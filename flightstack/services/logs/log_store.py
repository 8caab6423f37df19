"""A vehicle's flight logs as its link services see them, wherever they are kept."""

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
    """Bytes so far; the log of the flight under way still grows."""
    time_utc_s: int
    """When it was last written, in seconds since 1970; 0 if unknown."""

    @property
    def day(self) -> str:
        """The day of ``time_utc_s``, as PX4 names the directories of its logs."""
        return datetime.fromtimestamp(self.time_utc_s, UTC).strftime("%Y-%m-%d")


class LogStore(Protocol):
    """The logs of one vehicle."""

    def logs(self) -> Sequence[LogInfo]:
        """Return all logs, the oldest first: the same object until something changes."""
        ...

    def open(self, name: str) -> VirtualFile | None:
        """Open a log; None if there is none of this name. Raise OSError when it cannot be read."""
        ...

    def erase(self) -> int:
        """Erase all logs but the one that is being written; return how many were. Raise OSError."""
        ...


class NoLogs:
    """The logs of a vehicle that keeps none."""

    def logs(self) -> Sequence[LogInfo]:
        """Return nothing."""
        return ()

    def open(self, name: str) -> VirtualFile | None:
        """Return None."""
        return None

    def erase(self) -> int:
        """Erase nothing."""
        return 0


NO_LOGS = NoLogs()


class FlatLogs:
    """Logs as one directory: what QGroundControl looks for at ``@MAV_LOG``."""

    def __init__(self, store: LogStore) -> None:
        self._store = store
        self._shown: Sequence[LogInfo] = ()
        self._entries: list[Entry] = []

    def list(self, path: str) -> list[Entry] | None:
        """Return the logs, in the order of their ids."""
        logs = self._store.logs()
        if logs is not self._shown:
            self._shown, self._entries = logs, [Entry(log.name, log.size) for log in logs]
        return None if path else self._entries

    def open(self, path: str) -> VirtualFile | None:
        """Open a log by its name."""
        return None if "/" in path else self._store.open(path)


class DatedLogs:
    """Logs in a directory for each day: as PX4 keeps them in ``/fs/microsd/log``."""

    def __init__(self, store: LogStore) -> None:
        self._store = store
        self._shown: Sequence[LogInfo] = ()
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
        """Return the logs of each day by name, the days in order; made anew only when the logs have changed."""
        logs = self._store.logs()
        if logs is not self._shown:
            by_day: dict[str, dict[str, Entry]] = {}
            for log in logs:
                by_day.setdefault(log.day, {})[log.name] = Entry(log.name, log.size)
            self._shown, self._by_day = logs, dict(sorted(by_day.items()))
        return self._by_day

"""Status texts of all vehicles and the results of the user's actions, in order of arrival; bounded."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from flightstack.core.enums import Severity
from gcs_cli.vehicle.view_types import StatusText, VehicleView

ENTRIES_KEPT = 5_000


class Entry(NamedTuple):
    """A line of the log. ``number`` counts all lines."""

    number: int
    system_id: int
    severity: int
    text: str
    vehicle_time_s: float | None
    is_own: bool = False
    """True for a line of this ground station, for example the result of an action."""

    @property
    def status_text(self) -> StatusText:
        """The same as a status text."""
        return StatusText(self.number, self.severity, self.text, 0.0, self.vehicle_time_s)


class MessageLog:
    """Keeps the newest lines."""

    def __init__(self) -> None:
        self._entries: deque[Entry] = deque(maxlen=ENTRIES_KEPT)
        self._seen: dict[int, int] = {}
        self.count = 0

    def follow(self, view: VehicleView) -> None:
        """Add the new status texts of a vehicle."""
        if view.identity is None:
            return
        system_id = view.identity.system_id
        seen = self._seen.get(system_id, 0)
        if view.text_count < seen:  # the vehicle was replaced by another one with its id
            seen = 0
        for text in view.texts_since(seen):
            self._add(system_id, text.severity, text.text, text.vehicle_time_s, is_own=False)
        self._seen[system_id] = view.text_count

    def say(self, view: VehicleView, text: str, severity: int = Severity.INFO) -> None:
        """Add a line of this ground station about a vehicle."""
        system_id = 0 if view.identity is None else view.identity.system_id
        self._add(system_id, severity, text, view.time_s, is_own=True)

    def _add(
        self, system_id: int, severity: int, text: str, vehicle_time_s: float | None, *, is_own: bool
    ) -> None:
        self._entries.append(Entry(self.count, system_id, severity, text, vehicle_time_s, is_own))
        self.count += 1

    def since(self, count: int) -> list[Entry]:
        """Return the kept lines after the first ``count``."""
        return [entry for entry in list(self._entries) if entry.number >= count]


def selected(entries: Iterable[Entry], severity: int, words: str) -> list[Entry]:
    """Return the lines of at least ``severity`` (smaller is worse) that contain all ``words``, in any case."""
    wanted = words.lower().split()
    return [
        entry
        for entry in entries
        if entry.severity <= severity and all(word in entry.text.lower() for word in wanted)
    ]

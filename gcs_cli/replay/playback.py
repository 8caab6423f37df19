"""Messages of a replay: the interface for all logs, and the messages of a tlog. Pure."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from flightstack.mavlink.link import Address, Link, Message
from gcs_cli.errors import USAGE, CliError
from gcs_cli.logs.tlog_reader import dated_records
from gcs_cli.replay.logged_plans import LoggedPlans

REPLIES = frozenset({
    "COMMAND_ACK", "PARAM_VALUE", "PARAM_ERROR", "MISSION_COUNT", "MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_REQUEST",
    "MISSION_REQUEST_INT", "MISSION_ACK", "FILE_TRANSFER_PROTOCOL", "LOG_ENTRY", "LOG_DATA", "LOGGING_DATA",
    "LOGGING_DATA_ACKED", "TIMESYNC", "PING", "AUTOPILOT_VERSION", "HEARTBEAT",
})  # fmt: skip
"""Messages of a log that are not sent again: answers to others, and heartbeats, which keep their rate."""


class Playback(Protocol):
    """The messages of one vehicle; times in s since the start of the log."""

    vehicle: Address
    duration_s: float
    parameters: Sequence[Message]
    """PARAM_VALUE messages."""

    def messages(self, begin_s: float, end_s: float) -> Iterable[Message]:
        """Return the messages after ``begin_s`` up to ``end_s``, in order, without heartbeats."""

    def state(self, at_s: float) -> Sequence[Message]:
        """Return the newest message of each type."""

    def heartbeat(self, at_s: float) -> Message:
        """Return the HEARTBEAT."""

    def version(self) -> Message | None:
        """Return the AUTOPILOT_VERSION, or None if it is unknown."""

    def plan(self, kind: int, at_s: float) -> Sequence[Message]:
        """Return the items of a MAV_MISSION_TYPE, as ``LoggedPlans.at`` does; none if the log has none."""


class TlogPlayback:
    """The autopilot's messages of a tlog, unchanged."""

    def __init__(self, content: bytes, vehicle: tuple[int, int]) -> None:
        """``vehicle``: system and component whose messages are replayed. Raise CliError (usage) without heartbeats."""
        self.vehicle = Address(*vehicle)
        link, found = Link(0, 0), []
        times = []
        self._plans = LoggedPlans(vehicle[0])
        for record in dated_records(content):
            times.append(record.time_us)
            for message in link.decode(record.frame):
                self._plans.take(message, 1e-6 * record.time_us)
                if (message.get_srcSystem(), message.get_srcComponent()) == vehicle:
                    found.append((record.time_us, message))
        start_us = min(times)
        self._start_s = 1e-6 * start_us
        self.duration_s = (max(times) - start_us) * 1e-6
        found.sort(key=lambda entry: entry[0])
        own = [(1e-6 * (time_us - start_us), message) for time_us, message in found]
        kinds: dict[str, list[tuple[float, Message]]] = {}
        for entry in own:
            kinds.setdefault(entry[1].get_type(), []).append(entry)
        if "HEARTBEAT" not in kinds:
            raise CliError("the log has no heartbeat of a vehicle", USAGE)
        self._kinds = kinds
        sent = [entry for entry in own if entry[1].get_type() not in REPLIES]
        self._times = np.array([at_s for at_s, _ in sent])
        self._sent = [message for _, message in sent]
        values = {message.param_id: message for _, message in kinds.get("PARAM_VALUE", ())}
        self.parameters: Sequence[Message] = list(values.values())

    def messages(self, begin_s: float, end_s: float) -> Iterable[Message]:
        """Return the recorded messages."""
        first, last = np.searchsorted(self._times, (begin_s, end_s), side="right")
        return self._sent[first:last]

    def state(self, at_s: float) -> Sequence[Message]:
        """Return the newest message of each type."""
        return [
            message
            for kind in self._kinds
            if kind not in REPLIES
            and kind != "STATUSTEXT"
            and (message := self._newest(kind, at_s)) is not None
        ]

    def heartbeat(self, at_s: float) -> Message:
        """Return the newest HEARTBEAT, the first one before it."""
        beat = self._newest("HEARTBEAT", at_s)
        return self._kinds["HEARTBEAT"][0][1] if beat is None else beat

    def version(self) -> Message | None:
        """Return the recorded AUTOPILOT_VERSION."""
        return self._newest("AUTOPILOT_VERSION", self.duration_s)

    def plan(self, kind: int, at_s: float) -> Sequence[Message]:
        """Return the items of the latest transfer in the log."""
        return self._plans.at(kind, self._start_s + at_s)

    def _newest(self, kind: str, at_s: float) -> Message | None:
        entries = self._kinds.get(kind, [])
        index = bisect_right(entries, at_s, key=lambda entry: entry[0])
        return entries[index - 1][1] if index else None

"""Answer TIMESYNC and PING: what time the vehicle has, and how long the way to it is. Without I/O.

https://mavlink.io/en/services/timesync.html and ping.html. The time told is the vehicle's own, the one that its
telemetry bears, so that a client can relate both to its own clock at any simulation speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message, sender

_ANSWERS_A_POLL = 64
"""More requests than this between two polls are a flood: the rest stay unanswered."""


class TimeService:
    """Answers who asks for the time, or for an echo. Answers of others are not for us: we never ask."""

    handles = frozenset({"TIMESYNC", "PING"})

    def __init__(self, time_us: Callable[[], int]) -> None:
        """``time_us`` returns the vehicle's time since boot [µs]."""
        self._time_us = time_us
        self._outbox: list[tuple[Hashable | None, Message]] = []

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a request."""
        if len(self._outbox) >= _ANSWERS_A_POLL:
            return
        if message.get_type() == "TIMESYNC":
            if message.tc1 == 0:
                self._send(peer, self._time(message))
        elif message.target_system == 0 and message.target_component == 0:  # an answer names whom it is for
            source = sender(message)
            self._send(peer, mavlink.MAVLink_ping_message(message.time_usec, message.seq, *source))

    def _time(self, request: Message) -> Message:
        """Return our time [ns] beside the request's; never 0, which would be a request again."""
        return mavlink.MAVLink_timesync_message(max(1, self._time_us() * 1000), request.ts1)

    def _send(self, peer: Hashable, message: Message) -> None:
        self._outbox.append((peer, message))

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the answers to send now, each with its peer."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return when to poll next: -inf for at once, None for never."""
        return -math.inf if self._outbox else None

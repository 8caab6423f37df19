"""Answer TIMESYNC and PING, from which clients compute clock offset and latency. No I/O.

https://mavlink.io/en/services/timesync.html and ping.html. The time in the answer is vehicle time, as in telemetry, so
that a client can relate telemetry to its own clock at any simulation speed.

A module of its own, as each service.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message, sender

_ANSWERS_PER_POLL = 64
"""Further requests between two polls are dropped."""


class TimeService:
    """Answers requests for the time or for an echo. Ignores answers: the vehicle sends no requests."""

    handles = frozenset({"TIMESYNC", "PING"})

    def __init__(self, time_us: Callable[[], int]) -> None:
        """``time_us`` returns the vehicle time since boot [µs]."""
        self._time_us = time_us
        self._outbox: list[tuple[Hashable | None, Message]] = []

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a request."""
        if len(self._outbox) >= _ANSWERS_PER_POLL:
            return
        if message.get_type() == "TIMESYNC":
            if message.tc1 == 0:
                self._send(peer, self._time(message))
        elif message.target_system == 0 and message.target_component == 0:  # an answer has a target
            source = sender(message)
            self._send(peer, mavlink.MAVLink_ping_message(message.time_usec, message.seq, *source))

    def _time(self, request: Message) -> Message:
        """Return vehicle time [ns] and the request's time; never 0, which marks a request."""
        return mavlink.MAVLink_timesync_message(max(1, self._time_us() * 1000), request.ts1)

    def _send(self, peer: Hashable, message: Message) -> None:
        self._outbox.append((peer, message))

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the answers to send now, each with its peer."""
        outbox, self._outbox = self._outbox, []
        return outbox

    def next_deadline(self) -> float | None:
        """Return the time of the next poll: −inf for at once, None for never."""
        return -math.inf if self._outbox else None

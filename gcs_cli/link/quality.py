"""Quality of the link to a vehicle: message rate, recent loss, and round trip by TIMESYNC. Sans-IO.

https://mavlink.io/en/services/timesync.html
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from gcs_cli.vehicle.link_counts import LinkCounts

PERIOD_S = 1.0
PROMPT_S = 0.1
"""Time after a request in which its answer is to be read without delay, so that the round trip is exact."""
_WINDOW = 10
"""Periods over which loss is counted, and requests whose answer is still accepted."""


class LinkQuality(NamedTuple):
    """Quality of the link from the vehicle; None for unknown values."""

    rate_hz: float | None = None
    """Messages per second."""
    loss: float | None = None
    """Share of the messages that were lost in the last 10 s, 0 to 1."""
    round_trip_s: float | None = None
    """Time from the newest answered TIMESYNC request to its answer."""


class LinkMonitor:
    """Sends TIMESYNC requests once per period, and counts the messages that arrive between them."""

    def __init__(self, counts: Callable[[], LinkCounts]) -> None:
        self._counts = counts
        self._due_s: float | None = None
        self._sent_s: deque[tuple[int, float]] = deque(maxlen=_WINDOW)
        self._past: deque[LinkCounts] = deque(maxlen=_WINDOW + 1)
        self.round_trip_s: float | None = None
        """Time from the newest answered request to its answer [s]."""
        self.loss: float | None = None
        """Share of the messages that were lost in the last 10 s, 0 to 1, at the newest request."""
        self._prompt_until_s = -math.inf

    @property
    def quality(self) -> LinkQuality:
        """The quality now."""
        counts = self._counts()
        return LinkQuality(counts.rate_hz, self._loss(counts), self.round_trip_s)

    def _loss(self, counts: LinkCounts) -> float | None:
        past = self._past[0] if self._past else LinkCounts()
        received, lost = counts.received - past.received, max(0, counts.lost - past.lost)
        return lost / (received + lost) if received + lost > 0 else None

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""
        if message.get_type() != "TIMESYNC" or message.tc1 == 0:  # 0: a request of the vehicle
            return
        for stamp, sent_s in self._sent_s:
            if stamp == message.ts1:
                self.round_trip_s = now_s - sent_s
                self._prompt_until_s = -math.inf

    def is_waiting(self, now_s: float) -> bool:
        """Return True if the answer to a request is to be read without delay."""
        return now_s < self._prompt_until_s

    def poll(self, now_s: float) -> list[Message]:
        """Return the request to send now, if any."""
        if self._due_s is not None and now_s < self._due_s:
            return []
        self._due_s = now_s + PERIOD_S
        self._prompt_until_s = now_s + PROMPT_S
        counts = self._counts()
        self.loss = self._loss(counts)
        self._past.append(counts)
        stamp = max(1, round(now_s * 1e9))
        self._sent_s.append((stamp, now_s))
        return [mavlink.MAVLink_timesync_message(0, stamp)]

    def next_deadline(self) -> float | None:
        """Return the time of the next request."""
        return self._due_s

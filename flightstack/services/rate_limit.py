"""How fast a stream of messages may go, so that neither the loops nor the receiver's buffer suffer."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TypeVar

T = TypeVar("T")

MESSAGES_PER_POLL = 16
"""So few that one poll between two ticks delays no tick."""
MESSAGES_PER_S = 4000.0
"""About 1 MB/s of file data. A ground station in Python keeps up with it without losing datagrams."""


def always_has_room(peer: Hashable) -> bool:
    """Return True: for links whose congestion is not known."""
    return True


class RateLimit:
    """Lets ``per_poll`` messages go at once, and ``rate_hz`` of them per second."""

    def __init__(self, per_poll: int = MESSAGES_PER_POLL, rate_hz: float = MESSAGES_PER_S) -> None:
        self._per_poll = per_poll
        self._rate_hz = rate_hz
        self._left = float(per_poll)
        self._at_s: float | None = None

    def allowance(self, now_s: float) -> int:
        """Return how many messages may go now; ``take`` those that do."""
        if self._at_s is not None:
            self._left = min(float(self._per_poll), self._left + max(0.0, now_s - self._at_s) * self._rate_hz)
        self._at_s = now_s
        return int(self._left)

    def take(self, count: int) -> None:
        """Count messages that went."""
        self._left -= count

    def ready_s(self) -> float:
        """Return when one message may go; −inf if at once."""
        if self._at_s is None or self._left >= 1.0:
            return float("-inf")
        # a little later than exactly, so that rounding never leaves a poll with nothing to do
        return self._at_s + (1.0 - self._left) / self._rate_hz + 1e-6


def in_turn(waiting: list[T], turn: int) -> list[T]:
    """Return ``waiting`` from another one on in each ``turn``: who comes first must not always be the same."""
    start = turn % len(waiting) if waiting else 0
    return waiting[start:] + waiting[:start]

"""Rate limit of message streams, which protects the loops and the receiver's buffer."""

from __future__ import annotations

from collections.abc import Hashable
from typing import TypeVar

T = TypeVar("T")

MESSAGES_PER_POLL = 16
"""Largest burst. One poll between two ticks must not delay a tick."""
MESSAGES_PER_S = 8000.0
"""1.9 MB/s of file data, which a ground station in Python receives without losing datagrams."""


def always_has_room(peer: Hashable) -> bool:
    """Return True. For links whose congestion is not known."""
    return True


class RateLimit:
    """A token bucket: ``per_poll`` messages in one burst, ``rate_hz`` messages per second."""

    def __init__(self, per_poll: int = MESSAGES_PER_POLL, rate_hz: float = MESSAGES_PER_S) -> None:
        self._per_poll = per_poll
        self._rate_hz = rate_hz
        self._tokens = float(per_poll)
        self._updated_s: float | None = None

    def allowance(self, now_s: float) -> int:
        """Return the number of messages that may be sent now. Call ``take`` for those that are sent."""
        if self._updated_s is not None:
            self._tokens = min(
                float(self._per_poll), self._tokens + max(0.0, now_s - self._updated_s) * self._rate_hz
            )
        self._updated_s = now_s
        return int(self._tokens)

    def take(self, count: int) -> None:
        """Count sent messages."""
        self._tokens -= count

    def ready_s(self) -> float:
        """Return the link time at which one message may be sent; −inf for at once."""
        if self._updated_s is None or self._tokens >= 1.0:
            return float("-inf")
        # 1 µs late: rounding must not leave a poll without an allowance
        return self._updated_s + (1.0 - self._tokens) / self._rate_hz + 1e-6


def rotated(waiting: list[T], turn: int) -> list[T]:
    """Return ``waiting`` rotated by ``turn``, so that no client is always served first."""
    start = turn % len(waiting) if waiting else 0
    return waiting[start:] + waiting[:start]

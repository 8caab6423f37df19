"""In-memory datagram links for tests and in-process flights, without sockets and clocks.

``memory_link`` is lossless; ``LossyLink`` loses, duplicates, reorders and delays datagrams by a seed.
"""

from __future__ import annotations

import heapq
import random
from collections import deque
from typing import NamedTuple


class MemoryEnd:
    """One end of a lossless link."""

    def __init__(self, inbox: deque[bytes], outbox: deque[bytes]) -> None:
        self._inbox = inbox
        self._outbox = outbox

    def send(self, data: bytes, now_s: float = 0.0) -> None:
        """Send a datagram."""
        self._outbox.append(data)

    def receive(self, now_s: float = 0.0) -> list[bytes]:
        """Return the datagrams that have arrived."""
        arrived = list(self._inbox)
        self._inbox.clear()
        return arrived


def memory_link() -> tuple[MemoryEnd, MemoryEnd]:
    """Return the two ends of a lossless link."""
    one: deque[bytes] = deque()
    other: deque[bytes] = deque()
    return MemoryEnd(one, other), MemoryEnd(other, one)


class Conditions(NamedTuple):
    """Impairments of a link. Probabilities are per datagram and direction."""

    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    """Probability that a datagram is delayed by ``reordering_delay_s`` and thus overtaken."""
    delay_s: float = 0.0
    jitter_s: float = 0.0
    """Maximum additional delay, uniformly distributed."""
    reordering_delay_s: float = 0.1


LOSSLESS = Conditions()


class LossyEnd:
    """One end of a ``LossyLink``."""

    def __init__(self, conditions: Conditions, seed: str) -> None:
        self.conditions = conditions
        """Conditions of datagrams sent from now on."""
        self._random = random.Random(seed)
        self._in_flight: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self.other: LossyEnd = self

    def send(self, data: bytes, now_s: float) -> None:
        """Send a datagram at ``now_s``."""
        conditions, chance = self.conditions, self._random.random
        if chance() < conditions.loss:
            return
        for _ in range(2 if chance() < conditions.duplication else 1):
            arrival_s = now_s + conditions.delay_s + conditions.jitter_s * chance()
            if chance() < conditions.reordering:
                arrival_s += conditions.reordering_delay_s
            self._sent += 1  # keeps the order of simultaneous datagrams
            heapq.heappush(self.other._in_flight, (arrival_s, self._sent, data))

    def receive(self, now_s: float) -> list[bytes]:
        """Return the datagrams that have arrived by ``now_s``, in the order of arrival."""
        arrived = []
        while self._in_flight and self._in_flight[0][0] <= now_s:
            arrived.append(heapq.heappop(self._in_flight)[2])
        return arrived

    def next_arrival(self) -> float | None:
        """Return the arrival time of the next datagram, or None."""
        return self._in_flight[0][0] if self._in_flight else None


class LossyLink:
    """A bidirectional datagram link under ``conditions``, deterministic by seed and calls."""

    def __init__(self, conditions: Conditions = LOSSLESS, seed: int = 0) -> None:
        self.one = LossyEnd(conditions, f"{seed} one")
        self.two = LossyEnd(conditions, f"{seed} two")
        self.one.other, self.two.other = self.two, self.one

    def next_arrival(self) -> float | None:
        """Return the arrival time of the next datagram at either end, or None."""
        arrivals = [end.next_arrival() for end in (self.one, self.two)]
        return min((arrival for arrival in arrivals if arrival is not None), default=None)

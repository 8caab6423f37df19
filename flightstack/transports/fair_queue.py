"""Take turns among peers, so that one who floods delays the others by a bounded time only. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from typing import Generic, TypeVar

MAX_WAITING_OCTETS = 65536
"""What one peer may have waiting; the largest datagram still fits."""
LEAST_COST = 12
"""What a piece counts at least, were it empty: the size of the smallest frame."""
MAX_STRANGERS = 64
"""How many peers that nobody has heard a valid message from may wait at once."""

Key = TypeVar("Key", bound=Hashable)


class FairQueue(Generic[Key]):
    """Data of many peers: each peer's in order, the peers in turns, one piece a turn."""

    def __init__(self, max_octets: int = MAX_WAITING_OCTETS, max_strangers: int = MAX_STRANGERS) -> None:
        self._max_octets = max_octets
        self._max_strangers = max_strangers
        self._waiting: dict[Key, deque[bytes]] = {}  # in the order of turns
        self._octets: dict[Key, int] = {}
        self.dropped = 0
        """Pieces refused because their peer, or all strangers together, had too much waiting."""

    def __len__(self) -> int:
        return len(self._waiting)

    def __contains__(self, key: Key) -> bool:
        return key in self._waiting

    def push(self, key: Key, data: bytes, is_known: Callable[[Key], bool]) -> bool:
        """Let ``data`` of ``key`` wait for its turn; return False when it is dropped.

        ``is_known`` tells who may always join: strangers share a limited number of places.
        """
        cost = max(len(data), LEAST_COST)
        pieces = self._waiting.get(key)
        if pieces is None:
            # counting all as strangers is cheap; who is known is asked only when it matters
            if len(self._waiting) >= self._max_strangers and not is_known(key):
                self.dropped += 1
                return False
            pieces = self._waiting[key] = deque()
            self._octets[key] = 0
        elif self._octets[key] + cost > self._max_octets:
            self.dropped += 1
            return False
        pieces.append(data)
        self._octets[key] += cost
        return True

    def take(self, octets: int) -> Iterator[tuple[Key, bytes]]:
        """Yield pieces, with their peers, in turns: ``octets`` of them, and what the last piece has beyond."""
        while self._waiting and octets > 0:
            key = next(iter(self._waiting))
            pieces = self._waiting.pop(key)
            data = pieces.popleft()
            cost = max(len(data), LEAST_COST)
            octets -= cost
            if pieces:
                self._waiting[key] = pieces  # to the end of the line
                self._octets[key] -= cost
            else:
                del self._octets[key]
            yield key, data

    def forget(self, key: Key) -> None:
        """Drop what ``key`` has waiting."""
        self._waiting.pop(key, None)
        self._octets.pop(key, None)

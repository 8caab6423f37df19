"""A link between a client and the vehicle in simulated time: loss, delay, duplication, reordering, garbage, cuts."""

from __future__ import annotations

import heapq
import math
from random import Random
from typing import NamedTuple

_HELD_BACK_S = 0.1
"""Longest time by which a reordered datagram is held back."""


class Conditions(NamedTuple):
    """Conditions of one direction: probabilities for each datagram, 0 to 1, and a delay [s]."""

    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    garbage: float = 0.0
    """Probability that random bytes come before a datagram and one of its own bytes is changed."""
    delay_s: float = 0.0
    is_cut: bool = False


PERFECT = Conditions()


class Channel:
    """One direction of a link. Equal seeds and equal traffic give equal faults."""

    def __init__(self, seed: int) -> None:
        self.conditions = PERFECT
        self.sent = self.lost = 0
        """Datagrams that were sent, and those of them that do not arrive."""
        self._random = Random(seed)
        self._queue: list[tuple[float, int, bytes]] = []
        self._count = 0

    def set(self, **values: float) -> None:
        """Change conditions by their names; raise ValueError for one outside its range."""
        for name, value in values.items():
            largest = math.inf if name == "delay_s" else 1.0
            if not 0.0 <= value <= largest or math.isinf(value):
                raise ValueError(
                    f"{name} must be {'0 or more' if math.isinf(largest) else '0 to 1'}, not {value:g}"
                )
        self.conditions = self.conditions._replace(**values)  # type: ignore[arg-type]

    def end(self, name: str, value: float) -> None:
        """End a condition that was set to ``value``, unless it has changed since."""
        if getattr(self.conditions, name) == value:
            self.conditions = self.conditions._replace(**{name: getattr(PERFECT, name)})

    def cut(self) -> None:
        """Drop all datagrams, those under way too."""
        self.conditions = self.conditions._replace(is_cut=True)
        self.lost += len(self._queue)
        self._queue.clear()

    def restore(self) -> None:
        """Return to a perfect channel."""
        self.conditions = PERFECT

    @property
    def is_instant(self) -> bool:
        """True if a datagram arrives when it is sent, or never."""
        return self.conditions == PERFECT or self.conditions.is_cut

    def send(self, data: bytes, now_s: float) -> None:
        """Send a datagram at ``now_s``."""
        self.sent += 1
        conditions = self.conditions
        if conditions == PERFECT:
            self._push(now_s, data)
            return
        chance = self._random.random
        if conditions.is_cut or chance() < conditions.loss:
            self.lost += 1
            return
        if chance() < conditions.garbage:
            data = self._random.randbytes(self._random.randrange(1, 40)) + self._changed(data)
        arrival_s = now_s + conditions.delay_s
        if chance() < conditions.reordering:
            arrival_s += _HELD_BACK_S * chance()
        for _ in range(2 if chance() < conditions.duplication else 1):
            self._push(arrival_s, data)

    def passed(self, datagrams: list[bytes]) -> list[bytes]:
        """Send datagrams on a channel that ``is_instant``; return those that arrive."""
        self.sent += len(datagrams)
        if not self.conditions.is_cut:
            return datagrams
        self.lost += len(datagrams)
        return []

    def receive(self, now_s: float) -> list[bytes]:
        """Return the datagrams that have arrived by ``now_s``, in the order of their arrival."""
        arrived = []
        while self._queue and self._queue[0][0] <= now_s:
            arrived.append(heapq.heappop(self._queue)[2])
        return arrived

    @property
    def next_arrival_s(self) -> float:
        """Time at which the next datagram arrives [s]; infinite without one."""
        return self._queue[0][0] if self._queue else math.inf

    def _push(self, arrival_s: float, data: bytes) -> None:
        self._count += 1
        heapq.heappush(self._queue, (arrival_s, self._count, data))

    def _changed(self, data: bytes) -> bytes:
        changed = bytearray(data)
        changed[self._random.randrange(len(data))] ^= self._random.randrange(1, 256)
        return bytes(changed)


class Link:
    """Both directions of a client's link. Its methods change both; use ``to_vehicle`` or ``from_vehicle`` for one.

    >>> link = Link(seed=1)
    >>> link.loss(0.3)
    >>> link.duplication(0.1)
    >>> link.reordering(0.1)
    >>> link.garbage(0.01)
    >>> link.delay_s(0.05)
    >>> link.from_vehicle.cut()
    >>> link.from_vehicle.conditions.is_cut, link.to_vehicle.conditions.is_cut
    (True, False)
    >>> link.restore()
    """

    def __init__(self, seed: int) -> None:
        self.to_vehicle = Channel(2 * seed)
        self.from_vehicle = Channel(2 * seed + 1)

    def cut(self) -> None:
        """Cut the link: nothing arrives in either direction."""
        self.to_vehicle.cut()
        self.from_vehicle.cut()

    def restore(self) -> None:
        """Return to a perfect link."""
        self.to_vehicle.restore()
        self.from_vehicle.restore()

    def loss(self, share: float) -> None:
        """Lose this share of the datagrams, 0 to 1."""
        self._set(loss=share)

    def delay_s(self, seconds: float) -> None:
        """Delay each datagram by this time."""
        self._set(delay_s=seconds)

    def duplication(self, share: float) -> None:
        """Deliver this share of the datagrams twice, 0 to 1."""
        self._set(duplication=share)

    def reordering(self, share: float) -> None:
        """Hold this share of the datagrams back by up to 0.1 s, 0 to 1."""
        self._set(reordering=share)

    def garbage(self, share: float) -> None:
        """Damage this share of the datagrams, 0 to 1: a changed byte, and random bytes before it."""
        self._set(garbage=share)

    def _set(self, **values: float) -> None:
        self.to_vehicle.set(**values)
        self.from_vehicle.set(**values)

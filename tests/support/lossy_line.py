"""A simulated serial line to a target, with seeded loss, corruption, duplication and delay of bytes. No clock.

The line has its own time, which advances while ``read`` waits.
"""

from __future__ import annotations

import heapq
import random
from typing import NamedTuple, Protocol


class Device(Protocol):
    """Device at the end of the line."""

    def give(self, data: bytes) -> None:
        """Take received bytes."""

    def take(self) -> bytes:
        """Return the bytes to send."""

    def poll(self, passed_ms: int) -> None:
        """Advance the device by ``passed_ms``."""


class LineFaults(NamedTuple):
    """Probabilities per byte (``loss``, ``change``) and per write (``doubling``, ``delay``)."""

    loss: float = 0.0
    change: float = 0.0
    doubling: float = 0.0
    delay: float = 0.0
    delay_s: float = 0.3
    """Delay of a write and of all later ones; longer than the timeout of a step."""
    noise: float = 0.0
    """Probability of up to 40 bytes of noise before a write."""


NO_FAULTS = LineFaults()
LATENCY_S = 0.001
POLL_S = 0.01


class LossyLine:
    """Implements ``ByteLink``."""

    name = "the lossy line"

    def __init__(self, device: Device, faults: LineFaults = NO_FAULTS, seed: int = 0) -> None:
        self._device, self.faults = device, faults
        self._random = random.Random(seed)
        self._events: list[tuple[float, int, bool, bytes]] = []
        self._last_s = [0.0, 0.0]
        self._count = 0
        self._polled_s = 0.0
        self.now_s = 0.0
        self.is_closed = False
        self.is_cut = False
        """If True, no byte arrives in either direction."""

    def clock(self) -> float:
        return self.now_s

    def write(self, data: bytes) -> None:
        assert not self.is_closed
        self._send(data, to_device=True)

    def read(self, timeout_s: float) -> bytes:
        assert not self.is_closed
        assert 0.0 < timeout_s < 10.0
        end_s = self.now_s + timeout_s
        while True:
            next_s = self._events[0][0] if self._events else end_s
            until_s = min(next_s, end_s, self._polled_s + POLL_S)
            self.now_s = max(self.now_s, until_s)
            if self.now_s >= self._polled_s + POLL_S:
                self._device.poll(round(POLL_S * 1000))
                self._polled_s += POLL_S
                self._answer()
            elif self._events and self._events[0][0] <= self.now_s:
                _, _, to_device, data = heapq.heappop(self._events)
                if not to_device:
                    return data
                self._device.give(data)
                self._answer()
            elif self.now_s >= end_s:
                return b""

    def close(self) -> None:
        self.is_closed = True

    def _answer(self) -> None:
        if data := self._device.take():
            self._send(data, to_device=False)

    def _send(self, data: bytes, to_device: bool) -> None:
        if self.is_cut:
            return
        faults, chance = self.faults, self._random.random
        arrival_s = self.now_s + LATENCY_S + (faults.delay_s if chance() < faults.delay else 0.0)
        arrival_s = max(arrival_s, self._last_s[to_device])  # the order is kept
        for _ in range(2 if chance() < faults.doubling else 1):
            piece = bytearray()
            if chance() < faults.noise:
                piece += self._random.randbytes(self._random.randrange(40))
            for byte in data:
                if chance() < faults.loss:
                    continue
                piece.append(self._random.randrange(256) if chance() < faults.change else byte)
            self._count += 1
            self._last_s[to_device] = arrival_s
            heapq.heappush(self._events, (arrival_s, self._count, to_device, bytes(piece)))
            arrival_s += LATENCY_S

"""A simulated serial line with a baud rate and the latency timer of a USB bridge, octet by octet. No clock."""

from __future__ import annotations

import math
from collections import deque

from tests.support.lossy_line import Device

ROUNDING_S = 1e-9


class ModelledLine:
    """Implements ``ByteLink``; time advances while ``read`` waits. The target computes in no time."""

    name = "the modelled line"

    def __init__(self, device: Device, baud: float, timer_s: float = 0.0) -> None:
        """``timer_s``: answers are handed on when it expires, at its multiples; 0: at once."""
        self._device, self._octet_s, self._timer_s = device, 10.0 / baud, timer_s
        self._there: deque[tuple[float, int]] = deque()
        self._back: deque[tuple[float, int]] = deque()
        self._free_s = [0.0, 0.0]
        self.now_s = 0.0

    def clock(self) -> float:
        return self.now_s

    def write(self, data: bytes) -> None:
        self._put(self._there, 0, data)

    def read(self, timeout_s: float) -> bytes:
        end_s = self.now_s + timeout_s
        while True:
            handed_s = self._handed_s()
            if self._there and self._there[0][0] < min(handed_s, end_s):
                self.now_s, octet = self._there.popleft()
                self._device.give(bytes([octet]))
                self._put(self._back, 1, self._device.take())
            elif handed_s <= end_s:
                self.now_s = max(self.now_s, handed_s)
                data = bytearray()
                while self._back and self._back[0][0] <= self.now_s + ROUNDING_S:
                    data.append(self._back.popleft()[1])
                return bytes(data)
            else:
                self.now_s = end_s
                return b""

    def close(self) -> None:
        """Do nothing."""

    def _handed_s(self) -> float:
        """Return when the next answer is handed to the host."""
        if not self._back:
            return math.inf
        arrived_s = self._back[0][0]
        if self._timer_s == 0.0:
            return arrived_s
        return math.ceil((max(arrived_s, self.now_s) - ROUNDING_S) / self._timer_s) * self._timer_s

    def _put(self, way: deque[tuple[float, int]], index: int, data: bytes) -> None:
        for octet in data:
            self._free_s[index] = max(self._free_s[index], self.now_s) + self._octet_s
            way.append((self._free_s[index], octet))

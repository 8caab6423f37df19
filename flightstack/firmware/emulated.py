"""The firmware on an emulated Cortex-M4F, as a link of octets like a serial port; see docs/firmware.md."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from flightstack.firmware.emulator import EmulationError, Emulator

__all__ = ["EmulatedTarget", "EmulationError"]


class EmulatedTarget:
    """A ``ByteLink`` to the firmware's image; nothing of it takes time but the processor it runs on.

    The target's clock is simulated. It is ``now_s`` where that is given, the time of the flight for instance.
    Without, the target knows only the time that its host spent waiting: a ``read`` that finds nothing returns at
    once and lets the target be older by the time-out. Either way the same octets come in the same order.
    """

    name = "emulated Cortex-M4F"

    def __init__(self, image: Path, counter: Path, now_s: Callable[[], float] | None = None) -> None:
        """Start the image; ``counter`` is the library that counts instructions. Raise EmulationError."""
        self._emulator = Emulator(image, counter)
        self._now_s = now_s
        self._waited_s = 0.0
        self._sent = b""

    def _exchange(self, data: bytes) -> None:
        now_s = self._waited_s if self._now_s is None else self._now_s()
        self._sent += self._emulator.exchange(data, round(now_s * 1000.0))

    def write(self, data: bytes) -> None:
        """Let the target receive ``data`` and work on it until it waits for more. Raise EmulationError."""
        self._exchange(data)

    def read(self, timeout_s: float) -> bytes:
        """Return what the target has sent; b"" when it is silent for ``timeout_s`` of its own time."""
        if not self._sent:
            self._waited_s += timeout_s
            self._exchange(b"")
        sent, self._sent = self._sent, b""
        return sent

    def close(self) -> None:
        """Switch the target off."""
        self._emulator.close()

    @property
    def instructions(self) -> int:
        """Instructions executed since the start, modulo 2**32."""
        return int(self._emulator.mailbox.instructions)

    @property
    def stack_high_water(self) -> int:
        """Octets of the target's stack that were ever used."""
        return self._emulator.stack_high_water

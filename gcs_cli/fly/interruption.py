"""Ctrl-C and other signals as a flag, for commands that have to leave a vehicle in order."""

from __future__ import annotations

import signal
from types import FrameType
from typing import Any


class Interruption:
    """Turns the first Ctrl-C, SIGTERM or lost terminal into a flag; the second one interrupts at once."""

    def __init__(self) -> None:
        self.reason = ""
        self._before: dict[int, Any] = {}

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if self.reason:
            raise KeyboardInterrupt
        self.reason = (
            "interrupted" if number == signal.SIGINT else f"interrupted ({signal.Signals(number).name})"
        )

    def __enter__(self) -> Interruption:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

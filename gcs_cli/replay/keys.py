"""Keys of a terminal, one by one, without waiting or echo."""

from __future__ import annotations

import os
import sys
import termios
import tty
from typing import Any

_SEQUENCES = {
    b"\x1b[C": "right", b"\x1b[D": "left", b"\x1b[A": "up", b"\x1b[B": "down", b"\x1b[H": "home", b"\x1bOC": "right",
    b"\x1bOD": "left", b"\x1bOA": "up", b"\x1bOB": "down", b"\x1bOH": "home", b"\x1b[1~": "home",
}  # fmt: skip


def names_of(data: bytes) -> list[str]:
    """Return the names of the keys that a terminal sent: ``left``, or the character."""
    names, at = [], 0
    while at < len(data):
        size = next((len(code) for code in _SEQUENCES if data.startswith(code, at)), 1)
        names.append(_SEQUENCES.get(data[at : at + size], chr(data[at])))
        at += size
    return names


class Keys:
    """The keys pressed on stdin, within the ``with`` block; none if it is not a terminal."""

    def __init__(self) -> None:
        self.descriptor = sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else None
        self._before: list[Any] = []

    def read(self) -> list[str]:
        """Return the keys pressed; call when the descriptor is readable."""
        return [] if self.descriptor is None else names_of(os.read(self.descriptor, 1024))

    def __enter__(self) -> Keys:
        if self.descriptor is not None:
            self._before = termios.tcgetattr(self.descriptor)
            tty.setcbreak(self.descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        if self.descriptor is not None:
            termios.tcsetattr(self.descriptor, termios.TCSADRAIN, self._before)

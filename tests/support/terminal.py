"""A program on a terminal of its own."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager

LONG_S = 60
"""Hang guard [s]."""
_LAST = b"<the last output>"
# makes the terminal on stdin the process's own, so that Ctrl-C reaches it
ON_ITS_TERMINAL = """
import fcntl, os, sys, termios
os.setsid()
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""


class Terminal:
    """A process on a terminal of its own."""

    def __init__(self, arguments: list[str], *, is_own: bool = True) -> None:
        """The process gets SIGHUP when a terminal of its own ends."""
        self._terminal, self._inner = pty.openpty()
        self._before = termios.tcgetattr(self._inner)
        self.process = subprocess.Popen(
            [sys.executable, *(["-c", ON_ITS_TERMINAL] if is_own else []), *arguments],
            stdin=self._inner, stdout=self._inner, stderr=self._inner, start_new_session=not is_own,
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"},
        )  # fmt: skip
        self.seen = b""

    def read_until(self, wanted: bytes) -> None:
        while wanted not in self.seen:
            assert select.select([self._terminal], [], [], LONG_S)[0], f"{wanted!r} never came"
            self.seen += os.read(self._terminal, 65536)

    def type(self, keys: bytes) -> None:
        os.write(self._terminal, keys)

    def hang_up(self) -> None:
        """Close the terminal as its window or its connection does."""
        os.close(self._terminal)
        os.close(self._inner)
        self._terminal = self._inner = -1

    def is_restored(self) -> bool:
        """Return True if the main screen, the cursor, the mouse and the line discipline are as before.

        The process has ended; its last output may still be on its way, before that of this one.
        """
        os.write(self._inner, _LAST)
        self.read_until(_LAST)
        ends = (b"\x1b[?1049l", b"\x1b[?25h", b"\x1b[?1000l")
        return all(end in self.seen for end in ends) and termios.tcgetattr(self._inner) == self._before

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if self._terminal >= 0:
            self.hang_up()


@contextmanager
def terminal(arguments: list[str], *, is_own: bool = True) -> Iterator[Terminal]:
    made = Terminal(arguments, is_own=is_own)
    try:
        yield made
    finally:
        made.close()

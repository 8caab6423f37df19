"""Keep the two ends of a lockstep link on one processor.

In lockstep only one end runs at a time. On one processor the hand-over is a change of context, 3 µs each way.
On two it is either the wake-up of a sleeping processor, tens of microseconds, or a wait that spins: that
takes a second processor for nothing, and as soon as anything else wants it, the end that has work to do waits
milliseconds.

One end roams: now and then it lets the scheduler choose its processor, and stays where it was put. The other
follows. Where the system has no such calls (other than Linux), nothing happens; the link works all the same.
"""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path

_SETTLED_FOR = 8192  # exchanges, a fraction of a second at full speed; the choice costs one at most
_FREE_FOR = 16
_PROCESSOR_FIELD = 36  # of /proc/…/stat, counted after the name in parentheses


def _allowed() -> set[int]:
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()


def _move(processors: set[int]) -> None:
    with contextlib.suppress(OSError):  # forbidden, or unplugged: then it stays as it is
        os.sched_setaffinity(0, processors)


def _here() -> int:
    stat = Path("/proc/thread-self/stat").read_text(encoding="ascii", errors="replace")
    return int(stat.rpartition(")")[2].split()[_PROCESSOR_FIELD])


class AffinityLeader:
    """The end that chooses the processor for both."""

    def __init__(self) -> None:
        self._allowed = _allowed()
        self._settled = True

    def step(self) -> int:
        """Be free to move, or settle where we are, in turns; return for how many exchanges."""
        self._settled = not self._settled
        if len(self._allowed) > 1:
            _move({_here()} if self._settled else self._allowed)
        return _SETTLED_FOR if self._settled else _FREE_FOR

    def leave(self) -> None:
        """Be free to move for good."""
        if len(self._allowed) > 1:
            _move(self._allowed)


class AffinityFollower:
    """The end that moves to the processor of the other."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._allowed = _allowed()
        self._processor = -1

    def follow(self) -> None:
        """Move to where the peer's newest packet was handled: over loopback, the processor that sent it."""
        if len(self._allowed) < 2:
            return
        processor = self._connection.getsockopt(socket.SOL_SOCKET, socket.SO_INCOMING_CPU)
        if processor != self._processor and processor in self._allowed:
            self._processor = processor
            _move({processor})

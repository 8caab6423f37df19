"""Run both processes of a lockstep link on the same CPU.

In lockstep only one process runs at a time. On one CPU the hand-over is a context switch, 3 µs each way. On two CPUs it
is a wake-up of tens of microseconds, or a busy wait, which occupies the second CPU and delays the working process by
milliseconds under load.

The leader periodically lets the scheduler choose its CPU and then stays there; the follower moves to the same CPU. On
systems other than Linux, affinity is not set.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterable
from functools import cache
from pathlib import Path

_PINNED_EXCHANGES = 8192  # exchanges: a fraction of a second at full speed
_FREE_EXCHANGES = 16


@cache
def allowed_cpus() -> frozenset[int]:
    """Return the CPUs of this process before a leader or follower moved it: a later one may use all of them too."""
    return frozenset(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else frozenset()


def _set_affinity(cpus: Iterable[int]) -> None:
    with contextlib.suppress(OSError):  # not permitted, or CPU offline
        os.sched_setaffinity(0, cpus)


def _current_cpu() -> int:
    stat = Path("/proc/thread-self/stat").read_text(encoding="ascii", errors="replace")
    after_name = stat.rpartition(")")[2].split()
    return int(after_name[36])  # "processor" in proc_pid_stat(5)


class AffinityLeader:
    """Process that chooses the CPU of both."""

    def __init__(self) -> None:
        self._allowed = allowed_cpus()
        self._is_pinned = True

    def update(self) -> int:
        """Alternate between free and pinned to the current CPU; return the number of exchanges until the next call."""
        self._is_pinned = not self._is_pinned
        if len(self._allowed) > 1:
            _set_affinity({_current_cpu()} if self._is_pinned else self._allowed)
        return _PINNED_EXCHANGES if self._is_pinned else _FREE_EXCHANGES

    def release(self) -> None:
        """Restore the original affinity."""
        if len(self._allowed) > 1:
            _set_affinity(self._allowed)


class AffinityFollower:
    """Process that moves to the CPU of the leader."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._allowed = allowed_cpus()
        self._cpu = -1

    def update(self) -> None:
        """Move to the CPU that handled the peer's newest packet: over loopback the CPU of the sender."""
        if len(self._allowed) < 2:
            return
        cpu = self._connection.getsockopt(socket.SOL_SOCKET, socket.SO_INCOMING_CPU)
        if cpu != self._cpu and cpu in self._allowed:
            self._cpu = cpu
            _set_affinity({cpu})

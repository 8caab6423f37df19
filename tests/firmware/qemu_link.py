"""QEMU with the UART of its machine as standard input and output, and the image's heartbeats as the clock."""

from __future__ import annotations

import os
import select
import subprocess
from collections.abc import Callable, Sequence
from typing import TypeVar

from gcs_cli.pil.conformance.line import Line

RESEND_HEARTBEATS = 2.0
"""Heartbeats of the image, each a second of its time, after which a frame is sent again."""
Found = TypeVar("Found")


MOST_TRIES = 20
"""Of a frame; on a busy machine 38 of 130 frames were lost, one after another by chance."""


class QemuLink:
    """The UART; the command makes it standard input and output."""

    name = "QEMU"

    def __init__(self, command: Sequence[str]) -> None:
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)

    def write(self, data: bytes) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(data)

    def read(self, timeout_s: float) -> bytes:
        assert self.process.stdout is not None
        ready, _, _ = select.select([self.process.stdout], [], [], timeout_s)
        data = os.read(self.process.stdout.fileno(), 4096) if ready else b""
        assert data or not ready, "QEMU has ended"
        return data

    def close(self) -> None:
        self.process.kill()  # SIGTERM may not end it
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            pipe.close()


def heartbeat_line(link: QemuLink) -> Line:
    """Return a line whose time is the number of heartbeats."""
    line = Line(link, RESEND_HEARTBEATS, lambda: float(line.heartbeats))
    return line


def answered(ask: Callable[[], Found | None]) -> Found:
    """Ask until there is an answer: QEMU may deliver a frame in pieces so far apart that the image drops it."""
    for _ in range(MOST_TRIES):
        if (found := ask()) is not None:
            return found
    raise AssertionError(f"no answer to {MOST_TRIES} frames")

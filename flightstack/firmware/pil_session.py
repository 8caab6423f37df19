"""Runs operations of a ``PilClient`` over a ``ByteLink``."""

from __future__ import annotations

import time
from collections.abc import Callable

from flightstack.firmware.pil_client import PilClient, PilTiming
from flightstack.firmware.pil_operations import Result
from flightstack.transports.byte_link import ByteLink

MOST_READS = 100_000
"""Maximum reads per attempt, which bounds an operation on a link with endless data."""


class PilSession:
    """A client and its link. All waits are bounded by the client's timing on the link's clock."""

    def __init__(
        self, link: ByteLink, timing: PilTiming, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.link, self.client, self.clock_s = link, PilClient(timing), clock_s
        self._waited_s = 0.0  # added to the clock: an emulated target waits without real time

    @property
    def now_s(self) -> float:
        """Time of the link: that of the clock, and that which an emulated target waited."""
        return self.clock_s() + self._waited_s

    def finish(self) -> Result:
        """Run the link until the operation ends; return its result, None if it failed. Raise OSError, RuntimeError."""
        client = self.client
        while client.failure is None and client.result is None:
            data = client.poll(self.now_s)
            if data:
                self.link.write(data)
            self._receive()
        return client.result if client.failure is None else None

    def request(self, name: str, attempts: int | None = None) -> Result:
        """Request a message; return it, or None. ``attempts`` replaces those of the timing."""
        client, timing = self.client, self.client.timing
        client.timing = timing if attempts is None else timing._replace(attempts=attempts)
        try:
            client.start_request(name)
            return self.finish()
        finally:
            client.timing = timing

    def _receive(self) -> None:
        """Read until the end or deadline of the operation."""
        client = self.client
        for _ in range(MOST_READS):
            deadline_s = client.next_deadline()
            if deadline_s is None:
                return
            left_s = deadline_s - self.now_s
            if left_s <= 0.0:
                return
            before_s = self.clock_s()
            data = self.link.read(left_s)
            if data:
                client.receive(data, self.now_s)
            else:  # time passed on an emulated target but not on the clock
                self._waited_s += max(0.0, left_s - (self.clock_s() - before_s))
        self._waited_s += max(0.0, (client.next_deadline() or 0.0) - self.now_s)

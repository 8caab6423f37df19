"""Operations of a ``PilClient`` over a ``ByteLink``, and the change of the line's baud rate at run time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from flightstack.core.errors import TargetError
from flightstack.firmware.choice import DEFAULT_BAUD
from flightstack.firmware.pil.client import PilClient, PilTiming
from flightstack.firmware.pil.operations import Result
from flightstack.mavlink.dialect import mavlink
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


PRESENT_ATTEMPTS, RETURN_ATTEMPTS, NEW_ATTEMPTS = 2, 8, 4
"""Attempts of the hello: at the wanted rate, at the rate of a target's start, and after a change.

A target at another rate returns to that of its start after 1 s of octets that it cannot read, and one at a new rate
after 1 s without a frame."""
_HELLO = "FS_PIL_IDENTITY"


@runtime_checkable
class RatedLink(ByteLink, Protocol):
    """A link with a baud rate."""

    def set_baud(self, baud: int) -> None:
        """Change the rate and drop received bytes; raise LineError."""


def negotiate_baud(
    link: RatedLink,
    wanted: int,
    timing: PilTiming,
    clock_s: Callable[[], float] = time.monotonic,
    start_baud: int = DEFAULT_BAUD,
) -> str | None:
    """Bring the line, which is open at the rate ``wanted``, and its target to that rate.

    Return None if the target answers at it, or if it does not answer at all. Else return why the line runs at
    ``start_baud``, the rate of the target's start. Raise TargetError.
    """
    session = PilSession(link, timing, clock_s)
    try:
        attempts = RETURN_ATTEMPTS if wanted == start_baud else PRESENT_ATTEMPTS
        if session.request(_HELLO, attempts) is not None or wanted == start_baud:
            return None
        link.set_baud(start_baud)
        if session.request(_HELLO, RETURN_ATTEMPTS) is None:
            link.set_baud(wanted)  # the error is that of the rate that the user gave
            return None
        if (problem := _changed(session, wanted)) is not None:
            return f"the target {problem}: the line stays at {start_baud} baud"
        link.set_baud(wanted)
        if session.request(_HELLO, NEW_ATTEMPTS) is not None:
            return None
        link.set_baud(start_baud)
        if session.request(_HELLO, RETURN_ATTEMPTS) is None:
            raise TargetError(f"the target on {link.name} did not return from {wanted} baud: reset it")
    except OSError as error:
        raise TargetError(str(error)) from error
    return f"the target did not answer at {wanted} baud: the line stays at {start_baud} baud"


def restore_baud(
    link: RatedLink,
    timing: PilTiming,
    clock_s: Callable[[], float] = time.monotonic,
    start_baud: int = DEFAULT_BAUD,
) -> None:
    """Bring the line, at whose rate the target answers, and the target to ``start_baud``; raise TargetError."""
    session = PilSession(link, timing, clock_s)
    try:
        if _changed(session, start_baud) is None:
            link.set_baud(start_baud)
            session.request(_HELLO, RETURN_ATTEMPTS)
    except OSError as error:
        raise TargetError(str(error)) from error


def _changed(session: PilSession, baud: int) -> str | None:
    """Command a rate; return why the target does not change to it, as a clause about the target, or None."""
    session.client.start_command(mavlink.MAV_CMD_FS_SET_BAUD_RATE, f"cannot run at {baud} baud", float(baud))
    session.finish()
    return session.client.failure

"""Change the baud rate of the line to a target at run time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from flightstack.core.errors import TargetError
from flightstack.firmware.choice import DEFAULT_BAUD
from flightstack.firmware.pil_client import PilTiming
from flightstack.firmware.pil_session import PilSession
from flightstack.mavlink.dialect import mavlink
from flightstack.transports.byte_link import ByteLink

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

"""One ground station or companion: where it is, its link, and what waits to be sent to it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from flightstack.mavlink.link import SILENT_AFTER_S, Link, Message
from flightstack.services.telemetry.streams import Streams


class PeerAddress(NamedTuple):
    """Where a peer is: the channel it uses, and its address there."""

    channel: str
    host: str
    port: int


@dataclass
class Peer:
    """One ground station or companion."""

    link: Link
    streams: Streams
    permanent: bool
    connected: bool = False
    """Whether it has a TCP connection: it is there until the connection ends."""
    is_signed: bool = False
    """Whether only signed frames are taken from it."""
    heard_s: float = -math.inf
    heartbeat_due_s: float = -math.inf
    outbox: list[Message] = field(default_factory=list)

    @property
    def heard(self) -> bool:
        """Whether it has sent a valid message and is not forgotten since: only then it gets heartbeats unasked."""
        return self.heard_s > -math.inf

    def is_silent(self, now_s: float) -> bool:
        """Return True if nothing valid came for SILENT_AFTER_S."""
        return now_s - self.heard_s > SILENT_AFTER_S

    def is_served(self, now_s: float) -> bool:
        """Return True if it gets more than heartbeats.

        The address of a datagram may be forged: a sender that falls silent gets no more. A connection, an address that
        the user configured and a signature are no such sender's.
        """
        known = self.connected or self.permanent or self.is_signed
        return self.heard and (known or not self.is_silent(now_s))

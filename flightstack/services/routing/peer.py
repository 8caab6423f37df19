"""A ground station or companion: address, link, streams and outbox."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from flightstack.mavlink.link import SILENT_AFTER_S, Link, Message
from flightstack.services.telemetry.streams import Streams


class PeerAddress(NamedTuple):
    """Channel of a peer, and its address there."""

    channel: str
    host: str
    port: int


@dataclass
class Peer:
    """A ground station or companion."""

    link: Link
    streams: Streams
    permanent: bool
    connected: bool = False
    """True for a TCP client, which stays until its connection ends."""
    is_signed: bool = False
    """True if only signed frames of it are accepted."""
    heard_s: float = -math.inf
    heartbeat_due_s: float = -math.inf
    outbox: list[Message] = field(default_factory=list)

    @property
    def heard(self) -> bool:
        """True if it has sent a valid message and was not forgotten since. Other peers get no telemetry."""
        return self.heard_s > -math.inf

    def is_silent(self, now_s: float) -> bool:
        """Return True if it has sent no valid message for SILENT_AFTER_S."""
        return now_s - self.heard_s > SILENT_AFTER_S

    def is_served(self, now_s: float) -> bool:
        """Return True if it gets more than heartbeats.

        The address of a datagram may be forged, so a silent sender gets nothing more. This does not apply to TCP
        clients, configured addresses and signed links.
        """
        known = self.connected or self.permanent or self.is_signed
        return self.heard and (known or not self.is_silent(now_s))

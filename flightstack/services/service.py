"""What a MAVLink service of the vehicle is, as the hub of ground links sees it."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import Protocol

from flightstack.mavlink.link import Message


class Service(Protocol):
    """A protocol as a state machine: messages in, messages out, no I/O.

    ``now_s`` is the links' own clock: it goes on while simulated time stands still.
    """

    @property
    def handles(self) -> frozenset[str]:
        """Type names of the messages that ``receive`` wants to see."""
        ...

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``; what is not for this vehicle is ignored, and nothing is raised."""
        ...

    def poll(self, now_s: float) -> Iterable[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; None means every peer that was heard."""
        ...

    def next_deadline(self) -> float | None:
        """Return when to poll next if nothing arrives before; -inf for at once, None for never."""
        ...

"""MANUAL_CONTROL: stick positions of a pilot. The newest message of any sender counts."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.guidance.setpoints import Sticks
from flightstack.mavlink.link import Address, Message
from flightstack.services.streams.link_loss import StreamMonitor

_NOT_SUPPLIED = 0x7FFF


def read_sticks(message: Message) -> Sticks:
    """Return the stick positions of a MANUAL_CONTROL, each −1 to 1.

    x is forward, y right and r yaw, −1000 to 1000; z is the throttle, 0 to 1000 with the centre at 500, as in PX4 and
    QGroundControl. An axis that is not supplied is centred.
    """
    up = 0.0 if message.z == _NOT_SUPPLIED else _axis(2 * message.z - 1000)
    return Sticks(_axis(message.x), _axis(message.y), up, _axis(message.r))


def _axis(value: int) -> float:
    return 0.0 if value == _NOT_SUPPLIED else min(max(value / 1000.0, -1.0), 1.0)


class ManualServer:
    """Passes stick positions to the vehicle and monitors their stream."""

    handles = frozenset({"MANUAL_CONTROL"})

    def __init__(self, own: Address, take_sticks: Callable[[Sticks], None], monitor: StreamMonitor) -> None:
        self._own = own
        self._take_sticks = take_sticks
        self._monitor = monitor

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take stick positions. MANUAL_CONTROL has no target component."""
        if message.target not in (0, self._own.system):
            return
        self._take_sticks(read_sticks(message))
        self._monitor.heard()

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Evaluate the stream's timeout. Send nothing."""
        self._monitor.check()
        return []

    def next_deadline(self) -> float | None:
        """Return the time of the next poll."""
        return self._monitor.next_deadline()

"""Take MANUAL_CONTROL: a pilot's sticks over the link; the last writer wins."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from flightstack.guidance.setpoints import Sticks
from flightstack.mavlink.link import Address, Message
from flightstack.services.streams.link_loss import StreamMonitor

_NOT_SUPPLIED = 0x7FFF


def read_sticks(message: Message) -> Sticks:
    """Return the sticks of a MANUAL_CONTROL.

    x is forward, y right and r yaw, −1000 to 1000; the throttle z is 0 to 1000 with the centre at 500, as PX4 and
    QGroundControl have it. An axis that is not supplied is centred.
    """
    up = 0.0 if message.z == _NOT_SUPPLIED else _axis(2 * message.z - 1000)
    return Sticks(_axis(message.x), _axis(message.y), up, _axis(message.r))


def _axis(value: int) -> float:
    return 0.0 if value == _NOT_SUPPLIED else min(max(value / 1000.0, -1.0), 1.0)


class ManualServer:
    """Hands the sticks to the vehicle and watches over their stream."""

    handles = frozenset({"MANUAL_CONTROL"})

    def __init__(self, own: Address, take_sticks: Callable[[Sticks], None], watch: StreamMonitor) -> None:
        self._own = own
        self._take_sticks = take_sticks
        self._watch = watch

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take the sticks; MANUAL_CONTROL names a system only."""
        if message.target not in (0, self._own.system):
            return
        self._take_sticks(read_sticks(message))
        self._watch.heard(now_s)

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Send nothing; note a stream that has fallen silent."""
        self._watch.check(now_s)
        return []

    def next_deadline(self) -> float | None:
        """Return None: a loss counts on the vehicle's clock too, which moves on only between polls."""
        return None

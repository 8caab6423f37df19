"""Messages as they come from a link, for history, plot and inspector."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message

DECODER = Link(255, 190)


def received(message: Message, system: int = 1, component: int = 1) -> Message:
    (decoded,) = DECODER.decode(Link(system, component).encode(message))
    return decoded


def attitude(roll: float, system: int = 1, component: int = 1) -> Message:
    message = mavlink.MAVLink_attitude_message(1000, roll, 0.0, 0.0, 0.0, 0.0, 0.0)
    return received(message, system, component)

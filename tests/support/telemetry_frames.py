"""Messages as they come from a link, for history, plot and inspector."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message

LINK, DECODER = Link(1, 1), Link(255, 190)


def received(message: Message) -> Message:
    (decoded,) = DECODER.decode(LINK.encode(message))
    return decoded


def attitude(roll: float) -> Message:
    return received(mavlink.MAVLink_attitude_message(1000, roll, 0.0, 0.0, 0.0, 0.0, 0.0))

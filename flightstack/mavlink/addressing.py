"""Who a message is for, and who sent it."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.mavlink.link import Message


class Address(NamedTuple):
    """A MAVLink system and component; 0 means all."""

    system: int
    component: int


def sender(message: Message) -> Address:
    """Return who sent ``message``."""
    return Address(message.get_srcSystem(), message.get_srcComponent())


def is_for(message: Message, own: Address) -> bool:
    """Tell whether a message with a target is for ``own``; 0 is for everyone."""
    return message.target_system in (0, own.system) and message.target_component in (0, own.component)


def is_from(message: Message, peer: Address) -> bool:
    """Tell whether ``message`` comes from ``peer``, whose component may be 0 for any."""
    return message.get_srcSystem() == peer.system and peer.component in (0, message.get_srcComponent())

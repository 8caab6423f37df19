"""Forward messages between the peers of a vehicle, by the rules of MAVLink's routing guide. Pure.

https://mavlink.io/en/guide/routing.html. The router learns which systems and components each peer has. A message with
a target goes to the peers of that target, a broadcast to every peer that was heard, and neither back to its sender.
Frames are forwarded unchanged: sequence numbers and signatures stay valid.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from typing import Generic, NamedTuple, TypeVar

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_unknown, sender

MAX_ADDRESSES = 32
"""Systems and components stored per peer; a new one replaces the oldest."""
REPETITION_S = 1.0
MAX_REMEMBERED = 1024
_RADIO = 166  # RADIO of the SiK radios' dialect, which is not part of the project's
ONE_LINK_ONLY = frozenset({mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_SETUP_SIGNING, _RADIO})
"""Never forwarded: the report of a radio about its own link, and the secret key."""


Peer = TypeVar("Peer", bound=Hashable)


class Route(NamedTuple, Generic[Peer]):
    """Destinations of a message."""

    local: bool
    """True if the target is this vehicle's system or all systems."""
    forward: tuple[Peer, ...]
    """Peers to forward it to."""


class Router(Generic[Peer]):
    """Learns the addresses of each peer from received messages, and selects the destinations of each message."""

    def __init__(self, own: Address) -> None:
        self._own = own
        self._heard: dict[Peer, OrderedDict[Address, None]] = {}
        self._passed: OrderedDict[bytes, tuple[Peer, float]] = OrderedDict()
        self.repetitions = 0
        """Frames that were not forwarded because another peer had sent them before: the network has a loop."""

    def route(self, message: Message, peer: Peer, now_s: float) -> Route[Peer]:
        """Return the destinations of ``message`` from ``peer``, and learn its source address.

        The checksum of an unknown message cannot be verified, nor its target read. It is forwarded to all peers if its
        sender has sent a valid message before, and its source is not learned.
        """
        if is_unknown(message):
            to_all: tuple[Peer, ...] = self._others(peer) if peer in self._heard else ()
            return Route(False, self._unless_repeated(message, peer, to_all, now_s))
        source = sender(message)
        target = Address(getattr(message, "target_system", 0), getattr(message, "target_component", 0))
        local = target.system in (0, self._own.system)
        if source == self._own:  # a loop, or a second vehicle with the same system id
            return Route(local, ())
        self._learn(peer, source)
        return Route(local, self._unless_repeated(message, peer, self._peers_of(target, peer), now_s))

    def forget(self, peer: Peer) -> None:
        """Remove the addresses of a peer."""
        self._heard.pop(peer, None)

    # ------------------------------------------------------------------ addresses of peers

    def _learn(self, peer: Peer, source: Address) -> None:
        addresses = self._heard.setdefault(peer, OrderedDict())
        if source not in addresses:
            addresses[source] = None
            if len(addresses) > MAX_ADDRESSES:
                addresses.popitem(last=False)

    def addresses_of(self, peer: Peer) -> list[Address]:
        """Return the addresses learned from ``peer``, at most MAX_ADDRESSES."""
        return list(self._heard.get(peer, ()))

    @property
    def remembered(self) -> int:
        """Number of stored frames, by which repetitions are detected; at most MAX_REMEMBERED."""
        return len(self._passed)

    def _others(self, peer: Peer) -> tuple[Peer, ...]:
        return tuple(other for other in self._heard if other != peer)

    def _peers_of(self, target: Address, peer: Peer) -> tuple[Peer, ...]:
        """Return the peers, other than ``peer``, that have ``target``."""
        if target.system == 0:
            return self._others(peer)
        if target == self._own:
            return ()
        if target.component != 0:
            exact = tuple(other for other in self._others(peer) if target in self._heard[other])
            if exact or target.system == self._own.system:
                return exact
        # all components of a system, or a component not heard yet of a known system
        return tuple(
            other
            for other in self._others(peer)
            if any(address.system == target.system for address in self._heard[other])
        )

    # ------------------------------------------------------------------ loops

    def _unless_repeated(
        self, message: Message, peer: Peer, peers: tuple[Peer, ...], now_s: float
    ) -> tuple[Peer, ...]:
        """Return ``peers``, or none if another peer has sent the same frame within REPETITION_S."""
        if not peers or message.get_msgId() in ONE_LINK_ONLY:
            return ()
        frame = bytes(message.get_msgbuf())
        first, until_s = self._passed.get(frame, (peer, now_s + REPETITION_S))
        if first != peer and now_s < until_s:
            self.repetitions += 1
            return ()
        self._passed[frame] = (peer, now_s + REPETITION_S)
        self._passed.move_to_end(frame)
        if len(self._passed) > MAX_REMEMBERED:
            self._passed.popitem(last=False)
        return peers

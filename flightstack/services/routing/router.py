"""Pass messages on between the peers of a vehicle, by the rules of MAVLink's routing guide. Pure.

https://mavlink.io/en/guide/routing.html. The vehicle remembers which systems and components it heard from which
peer. What is addressed to one of them goes there, what is addressed to nobody in particular goes to every peer that
was heard, and nothing goes back to where it came from. Frames are passed on as they are: sequence numbers and
signatures stay valid.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from typing import Generic, NamedTuple, TypeVar

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_unknown, sender

MAX_ADDRESSES = 32
"""Systems and components remembered of one peer; the one heard first gives way."""
REPETITION_S = 1.0
MAX_REMEMBERED = 1024
_RADIO = 166  # of the dialect of SiK radios, which is not ours
ONE_LINK_ONLY = frozenset({mavlink.MAVLINK_MSG_ID_RADIO_STATUS, mavlink.MAVLINK_MSG_ID_SETUP_SIGNING, _RADIO})
"""Never passed on: a radio's report about its own link, and the secret key."""


Peer = TypeVar("Peer", bound=Hashable)


class Route(NamedTuple, Generic[Peer]):
    """Where a message goes."""

    local: bool
    """Whether it may concern this vehicle: it is for its system, or for all."""
    forward: tuple[Peer, ...]
    """Peers to pass it on to."""


class Router(Generic[Peer]):
    """Learns from received messages which peer has which address, and decides where each message goes."""

    def __init__(self, own: Address) -> None:
        self._own = own
        self._heard: dict[Peer, OrderedDict[Address, None]] = {}
        self._passed: OrderedDict[bytes, tuple[Peer, float]] = OrderedDict()
        self.repetitions = 0
        """Frames not passed on because another peer had brought them before: the network has a loop."""

    def route(self, message: Message, peer: Peer, now_s: float) -> Route[Peer]:
        """Return where ``message`` of ``peer`` goes, and learn from it.

        The checksum of an unknown message cannot be verified, nor its target read: it is passed on to all if it
        comes from a peer that has sent a valid one, and nothing is learned from it.
        """
        if is_unknown(message):
            to_all: tuple[Peer, ...] = self._others(peer) if peer in self._heard else ()
            return Route(False, self._fresh(message, peer, to_all, now_s))
        source = sender(message)
        target = Address(getattr(message, "target_system", 0), getattr(message, "target_component", 0))
        local = target.system in (0, self._own.system)
        if source == self._own:  # our own words: a loop, or a second vehicle of the same number
            return Route(local, ())
        self._learn(peer, source)
        return Route(local, self._fresh(message, peer, self._places(target, peer), now_s))

    def forget(self, peer: Peer) -> None:
        """Forget a peer that is gone."""
        self._heard.pop(peer, None)

    # ------------------------------------------------------------------ addresses of peers

    def _learn(self, peer: Peer, source: Address) -> None:
        addresses = self._heard.setdefault(peer, OrderedDict())
        if source not in addresses:
            addresses[source] = None
            if len(addresses) > MAX_ADDRESSES:
                addresses.popitem(last=False)

    def addresses_of(self, peer: Peer) -> list[Address]:
        """Return the addresses that were heard from ``peer``, at most MAX_ADDRESSES."""
        return list(self._heard.get(peer, ()))

    @property
    def remembered(self) -> int:
        """Frames that are remembered, so that none is passed on twice; at most MAX_REMEMBERED."""
        return len(self._passed)

    def _others(self, peer: Peer) -> tuple[Peer, ...]:
        return tuple(other for other in self._heard if other != peer)

    def _places(self, target: Address, peer: Peer) -> tuple[Peer, ...]:
        """Return the peers, other than ``peer``, that ``target`` is to be found at."""
        if target.system == 0:
            return self._others(peer)
        if target == self._own:
            return ()
        if target.component != 0:
            exact = tuple(other for other in self._others(peer) if target in self._heard[other])
            if exact or target.system == self._own.system:
                return exact
        # all components of a system; or one not heard yet, of a system that was
        return tuple(
            other
            for other in self._others(peer)
            if any(address.system == target.system for address in self._heard[other])
        )

    # ------------------------------------------------------------------ loops

    def _fresh(
        self, message: Message, peer: Peer, places: tuple[Peer, ...], now_s: float
    ) -> tuple[Peer, ...]:
        """Return ``places``, or none when another peer has brought this very frame a moment ago."""
        if not places or message.get_msgId() in ONE_LINK_ONLY:
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
        return places

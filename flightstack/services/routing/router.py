"""Where a message goes: to peers, by the rules of MAVLink's routing guide, and to services. Pure.

https://mavlink.io/en/guide/routing.html. The router learns which systems and components each peer has. A message with
a target goes to the peers of that target, a broadcast to every peer that was heard, and neither back to its sender.
Frames are forwarded unchanged: sequence numbers and signatures stay valid.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Hashable, Iterable, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

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


class Service(Protocol):
    """A MAVLink protocol as a state machine without I/O.

    ``now_s`` is the link clock, which runs on while simulated time stands still.
    """

    @property
    def handles(self) -> frozenset[str]:
        """Type names of the messages that ``receive`` takes."""
        ...

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take a message from ``peer``. Ignore messages for other vehicles; never raise."""
        ...

    def poll(self, now_s: float) -> Iterable[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; None stands for every peer that was heard."""
        ...

    def next_deadline(self) -> float | None:
        """Return the link time of the next poll if no message arrives before; None for never.

        −inf stands for every poll. The hub takes this at its word: before that time it does not poll the service.
        """
        ...


@runtime_checkable
class CountsVehicleTime(Protocol):
    """A service whose poll is due by the vehicle's clock."""

    def idle_s(self) -> float:
        """Return the vehicle time for which ``poll`` does nothing, if no message arrives [s]."""
        ...


OWN_MESSAGES = frozenset(
    {"HEARTBEAT", "MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_REQUEST", "MISSION_REQUEST_INT"}
)
"""Messages that come each second, or by the thousand in a transfer, and change no service but their own."""


class Schedule:
    """Polls each service when it is due, and all of them after a message: in flight one of thirteen is due.

    A message for one service may change another: a command sets a parameter, which the parameter server announces.
    After one of ``OWN_MESSAGES``, only its services are polled.
    """

    def __init__(self, services: Sequence[Service]) -> None:
        self._services = services
        self._own: dict[str, list[int]] = {
            kind: [index for index, service in enumerate(services) if kind in service.handles]
            for kind in OWN_MESSAGES
        }
        self._clocks = {
            i: service for i, service in enumerate(services) if isinstance(service, CountsVehicleTime)
        }
        self._due_s: dict[int, float] = {}  # by the index of the service; not of those that are never due
        self.wake()

    def wake(self, message_type: str = "") -> None:
        """Poll all services at the next poll, or those that a message of this type may change."""
        if message_type in self._own:
            self._due_s.update(dict.fromkeys(self._own[message_type], -math.inf))
            return
        self._due_s = dict.fromkeys(range(len(self._services)), -math.inf)

    def idle_s(self, now_s: float) -> float:
        """Return the time for which no service is due, if link clock and vehicle clock run alike [s]."""
        idle_s = math.inf
        for index, due_s in self._due_s.items():
            clock = self._clocks.get(index) if due_s == -math.inf else None
            idle_s = min(idle_s, due_s - now_s if clock is None else clock.idle_s())
        return idle_s

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return the messages to send now, each with its peer; None stands for every peer that was heard."""
        addressed: list[tuple[Hashable | None, Message]] = []
        due = sorted([index for index, due_s in self._due_s.items() if due_s <= now_s])  # in sending order
        for index in due:
            addressed += self._services[index].poll(now_s)
        for index in due:
            due_s = self._services[index].next_deadline()
            if due_s is None:
                del self._due_s[index]
            else:
                self._due_s[index] = due_s
        return addressed

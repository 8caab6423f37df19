"""All ground stations and companions of the vehicle, without I/O: links, services and telemetry.

Each peer has a link of its own (sequence numbers, rates). Times here are the links' own clock: the wall clock
in a process, simulated time in tests. Telemetry counts simulated time too (``mavlink.streams``).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator

from flightstack.commands import VehicleContext
from flightstack.ground.facts import AutopilotFacts
from flightstack.ground.peer import GROUND, Peer, PeerAddress
from flightstack.ground.service import Service
from flightstack.ground.services import make_services
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from flightstack.mavlink.services.addressing import Address
from flightstack.mavlink.streams import API_RATES_HZ, GROUND_RATES_HZ, Streams
from flightstack.mavlink.telemetry import MAKERS, heartbeat, status_texts

HEARTBEAT_S = 1.0
PEER_FORGOTTEN_S = 30.0
MAX_PEERS = 32


class GroundHub:
    """Receives bytes of any peer on any channel and returns the bytes to send."""

    def __init__(self, vehicle: VehicleContext, facts: AutopilotFacts, system_id: int) -> None:
        self.vehicle = vehicle
        self._autopilot = vehicle.autopilot
        self._facts = facts
        self._own = Address(system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._peers: dict[PeerAddress, Peer] = {}
        self._services = make_services(self._own, vehicle, facts, self._peer_at)
        self._by_type: dict[str, list[Service]] = {}
        for service in self._services:
            for kind in service.handles:
                self._by_type.setdefault(kind, []).append(service)
        self._shown = (facts.armed, facts.mode)

    # ------------------------------------------------------------------ peers

    def add_peer(self, address: PeerAddress, permanent: bool = False) -> Peer:
        """Begin to talk to ``address``; a permanent one gets heartbeats before it was ever heard."""
        rates = GROUND_RATES_HZ if address.channel == GROUND else API_RATES_HZ
        peer = Peer(Link(*self._own), Streams(rates), permanent)
        self._peers[address] = peer
        return peer

    def drop_peer(self, address: PeerAddress) -> None:
        """Forget a peer whose connection has ended."""
        self._peers.pop(address, None)

    def is_heard(self, address: PeerAddress) -> bool:
        """Tell whether a valid message of ``address`` has come, not too long ago."""
        peer = self._peers.get(address)
        return peer is not None and peer.heard

    def _peer_at(self, address: Hashable) -> Peer:
        """Find the peer that a service names: one that it heard, in the same call."""
        assert isinstance(address, PeerAddress)
        return self._peers[address]

    @property
    def last_heard_s(self) -> float:
        """When any peer was last heard; −inf if none ever was."""
        return max((peer.heard_s for peer in self._peers.values()), default=-math.inf)

    def _forget_silent(self, now_s: float) -> None:
        for address, peer in list(self._peers.items()):
            if now_s - peer.heard_s > PEER_FORGOTTEN_S:
                if peer.permanent:
                    peer.heard_s = -math.inf
                else:
                    del self._peers[address]

    # ------------------------------------------------------------------ receiving

    def receive(self, address: PeerAddress, data: bytes, now_s: float) -> None:
        """Take a datagram; whatever it holds, nothing is raised."""
        peer = self._peers.get(address)
        if peer is None:
            if len(self._peers) >= MAX_PEERS:
                return
            peer = self.add_peer(address)
        for message in peer.link.decode(data):
            peer.heard_s = now_s
            for service in self._by_type.get(message.get_type(), ()):
                service.receive(message, address, now_s)

    # ------------------------------------------------------------------ sending

    def poll(self, now_s: float) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield (address, bytes) of all that is to be sent now."""
        changed = self._note_changes()
        for service in self._services:
            self._collect(service.poll(now_s))
        self._spread_texts()
        for address, peer in list(self._peers.items()):
            for message in self._due(peer, changed, now_s):
                yield address, peer.link.encode(message)
        self._forget_silent(now_s)

    def _collect(self, addressed: Iterable[tuple[Hashable | None, Message]]) -> None:
        for address, message in addressed:
            if address is None:
                self._to_all(message)
            elif isinstance(address, PeerAddress) and address in self._peers:
                self._peers[address].outbox.append(message)

    def _due(self, peer: Peer, changed: bool, now_s: float) -> Iterator[Message]:
        if (peer.heard or peer.permanent) and (changed or now_s >= peer.heartbeat_due_s):
            peer.heartbeat_due_s = now_s + HEARTBEAT_S
            yield heartbeat(self._facts)
        if peer.outbox:
            yield from peer.outbox
            peer.outbox.clear()
        if peer.heard:
            yield from peer.streams.due(self._facts, now_s)

    def _note_changes(self) -> bool:
        """Announce reached items; tell whether mode or arming changed."""
        facts = self._facts
        reached = self._autopilot.now.reached
        for seq in reached:
            self._to_all(mavlink.MAVLink_mission_item_reached_message(seq))
        shown = (facts.armed, facts.mode)
        changed = shown != self._shown
        self._shown = shown
        if changed or reached:
            self._to_all(MAKERS[mavlink.MAVLINK_MSG_ID_MISSION_CURRENT](facts))
        reached.clear()
        return changed

    def _spread_texts(self) -> None:
        texts = self._autopilot.now.texts
        for text in texts:
            for message in status_texts(text.severity, text.text):
                self._to_all(message)
        texts.clear()

    def _to_all(self, message: Message) -> None:
        for peer in self._peers.values():
            if peer.heard:
                peer.outbox.append(message)

    def farewell(self) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield the last bytes of an orderly end: waiting answers, then a heartbeat that says so."""
        for service in self._services:
            self._collect(service.poll(0.0))
        self._spread_texts()
        for address, peer in self._peers.items():
            for message in [*peer.outbox, heartbeat(self._facts, leaving=True)]:
                yield address, peer.link.encode(message)
            peer.outbox.clear()

"""One vehicle over one link, sans-IO: datagrams in and out, heartbeats, the view and a service."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address as Component
from flightstack.mavlink.link import Link, Message
from flightstack.mavlink.signing import LinkSigning, without_signature
from flightstack.transports.udp import Address
from gcs_cli.link.subscription import Subscription
from gcs_cli.vehicle.vehicle_view import update
from gcs_cli.vehicle.view_types import VehicleView

SYSTEM_ID = 255
COMPONENT_ID = 190  # MAV_COMP_ID_MISSIONPLANNER, as most ground stations use
HEARTBEAT_PERIOD_S = 1.0
_BROADCAST = 0
_MOST_PEERS = 32


class Service(Protocol):
    """A client side of a MAVLink service: a state machine without I/O."""

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest."""


class Session:
    """The ground station's side of a link.

    The first peer that sends an autopilot's heartbeat is the vehicle; datagrams of others are dropped unless the
    vehicle is lost. With ``peer``, only datagrams from that address are accepted, and with ``system_id``, only that
    vehicle. Heartbeats are sent once per second of this clock and of vehicle time, because a simulation that is faster
    than real time measures their timeout in its own time. ``heartbeat_type`` is the MAV_TYPE that this side announces,
    ``own_system`` its system id. ``record`` gets every frame, sent and received, without its signature.
    """

    def __init__(
        self,
        peer: Address | None = None,
        record: Callable[[bytes], None] | None = None,
        signing: LinkSigning | None = None,
        system_id: int | None = None,
        heartbeat_type: int = mavlink.MAV_TYPE_GCS,
        own_system: int = SYSTEM_ID,
    ) -> None:
        self.view = VehicleView()
        self.peer = peer
        self.own = Component(own_system, COMPONENT_ID)
        """System and component of this side."""
        self.foreign_systems: set[int] = set()
        """System ids of other vehicles."""
        self._only_peer = peer
        self._system_id = system_id
        self.bad = 0
        self._links: dict[Address, Link] = {}
        self._signing = signing
        self._out = Link(*self.own, signing=signing)
        self.record = record
        self.observe: Callable[[Message], None] | None = None
        """Called with every message from the vehicle."""
        self._heartbeat_type = heartbeat_type
        self._service: Service | None = None
        self._heartbeat_due_s = 0.0
        self._heartbeat_due_vehicle_s = math.inf

    @property
    def target(self) -> tuple[int, int]:
        """System and component of the vehicle; (0, 0), broadcast, before its first heartbeat."""
        identity = self.view.identity
        return (_BROADCAST, _BROADCAST) if identity is None else (identity.system_id, identity.component_id)

    def subscribe(self, rates_hz: Mapping[int, float]) -> None:
        """Request messages from the vehicle, id -> rate [Hz], until another service is used."""
        self.use(Subscription(lambda: self.target, rates_hz))

    def keep_vehicle(self) -> None:
        """Accept no other vehicle from now on, even if this one is lost."""
        assert self.view.identity is not None
        self._system_id = self.view.identity.system_id

    def use(self, service: Service | None) -> None:
        """Replace the service that exchanges messages with the vehicle."""
        self._service = service

    def receive(self, data: bytes, peer: Address, now_s: float) -> None:
        """Process a datagram."""
        if self._only_peer not in (None, peer):
            return
        heard = self.view.identity is not None and not self.view.lost(now_s)
        if heard and peer != self.peer:
            return
        if len(self._links) > _MOST_PEERS:
            self._links.clear()
        link = self._links.setdefault(peer, Link(*self.own, signing=self._signing))
        bad_before = link.bad
        for message in link.decode(data):
            if link.is_authentic(message) and (heard or self._is_vehicle(message, peer, now_s)):
                self._process(message, now_s)
        self.bad += link.bad - bad_before

    def _is_vehicle(self, message: Message, peer: Address, now_s: float) -> bool:
        """Return True if the message is from our vehicle; without one, accept the first autopilot's heartbeat."""
        if self.view.identity is not None and peer == self.peer and not self._is_other_system(message):
            return True
        candidate = VehicleView() if self._is_other_system(message) else self.view
        if update(candidate, message, now_s).last_heartbeat_s != now_s:
            return False
        if self._system_id not in (None, message.get_srcSystem()):
            self.foreign_systems.add(message.get_srcSystem())
            return False
        self.view, self.peer = candidate, peer
        self._heartbeat_due_s = now_s
        return True

    def _is_other_system(self, message: Message) -> bool:
        return (message.get_srcSystem(), message.get_srcComponent()) != self.target

    def _process(self, message: Message, now_s: float) -> None:
        if self.record is not None:
            self.record(without_signature(bytes(message.get_msgbuf()), message.crc_extra))
        self.view = update(self.view, message, now_s)
        if self.observe is not None:
            self.observe(message)
        if self._service is not None and not self._is_other_system(message):
            self._service.receive(message, now_s)

    def poll(self, now_s: float) -> list[bytes]:
        """Return the datagrams to send now to ``peer``."""
        if self.peer is None:
            return []
        frames = []
        vehicle_s = self.view.time_s
        if now_s >= self._heartbeat_due_s or (vehicle_s or 0.0) >= self._heartbeat_due_vehicle_s:
            frames.append(self.encode(self._heartbeat(mavlink.MAV_STATE_ACTIVE)))
            self._heartbeat_due_s = now_s + HEARTBEAT_PERIOD_S
            self._heartbeat_due_vehicle_s = math.inf if vehicle_s is None else vehicle_s + HEARTBEAT_PERIOD_S
        if self._service is not None:
            frames += [self.encode(message) for message in self._service.poll(now_s)]
        return frames

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest; None without a peer."""
        if self.peer is None:
            return None
        service = None if self._service is None else self._service.next_deadline()
        return self._heartbeat_due_s if service is None else min(self._heartbeat_due_s, service)

    def farewell(self) -> list[bytes]:
        """Return the HEARTBEAT in state POWEROFF, which ends the link in order."""
        return [] if self.peer is None else [self.encode(self._heartbeat(mavlink.MAV_STATE_POWEROFF))]

    def encode(self, message: Message) -> bytes:
        """Return the frame of a message from this ground station."""
        frame = self._out.encode(message)
        if self.record is not None:
            self.record(without_signature(frame, message.crc_extra))
        return frame

    def _heartbeat(self, state: int) -> Message:
        return mavlink.MAVLink_heartbeat_message(
            self._heartbeat_type, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, state, 3
        )

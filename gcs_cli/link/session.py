"""One vehicle on a link, sans-IO: messages in and datagrams out, heartbeats, the view and services."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address as Component
from flightstack.mavlink.link import Message
from flightstack.mavlink.signing import LinkSigning
from flightstack.transports.udp import Address
from gcs_cli.link.quality import LinkMonitor, LinkQuality
from gcs_cli.link.subscription import Subscription
from gcs_cli.link.wire import SYSTEM_ID, Wire
from gcs_cli.vehicle.view_builder import ViewBuilder, update
from gcs_cli.vehicle.view_types import LOST_AFTER_S, VehicleView

HEARTBEAT_PERIOD_S = 1.0
GREETING_PERIOD_S = 0.1
"""Period of heartbeats to ``peer`` until it is heard: a vehicle that starts hears them soon."""
_ROUNDING_S = 0.5e-6
"""Above the rounding of an hour's sum of periods."""
_BROADCAST = 0


class Service(Protocol):
    """A client side of a MAVLink service: a state machine without I/O."""

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from the vehicle."""

    def poll(self, now_s: float) -> list[Message]:
        """Return the messages to send now."""

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest."""


class Session:
    """The ground station's side of the link to one vehicle.

    The first peer that sends an autopilot's heartbeat is the vehicle; datagrams of others are dropped unless the
    vehicle is lost. With ``peer``, only datagrams from that address are accepted, and with ``system_id``, only that
    vehicle. Heartbeats are sent to a vehicle once per second of this clock and of vehicle time, because a simulation
    that is faster than real time measures their timeout in its own time; without ``counts_vehicle_time``, this clock is
    the vehicle's.
    ``heartbeat_type`` is the MAV_TYPE that this side announces, ``own_system`` its system id. ``record`` gets every
    frame, sent and received, without its signature. Sessions of several vehicles on one link share its ``wire``. With
    ``monitors``, the round trip is measured.
    """

    def __init__(
        self,
        peer: Address | None = None,
        record: Callable[[bytes], None] | None = None,
        signing: LinkSigning | None = None,
        system_id: int | None = None,
        heartbeat_type: int = mavlink.MAV_TYPE_GCS,
        own_system: int = SYSTEM_ID,
        *,
        wire: Wire | None = None,
        monitors: bool = False,
        counts_vehicle_time: bool = True,
    ) -> None:
        self._builder = ViewBuilder(VehicleView())
        self.peer = peer
        self.observe: Callable[[Message], None] | None = None
        """Called with every message from the vehicle's system."""
        self.wire = Wire(signing, record, own_system) if wire is None else wire
        self._only_peer = peer
        self._system_id = system_id
        self._heartbeat_type = heartbeat_type
        self.service: Service | None = None
        """The service that exchanges messages with the vehicle, besides the attached ones."""
        self._subscription = Subscription(lambda: self._builder.identity, {})
        self._monitor = LinkMonitor(lambda: self._builder.link)
        self._monitors = monitors
        self._background: list[Service] = [self._monitor] if monitors else []
        self._services: tuple[Service, ...] = ()
        self._collect_services()
        self._heartbeat_due_s = 0.0
        self._heartbeat_due_vehicle_s = -math.inf  # as soon as the vehicle's time is known
        self._counts_vehicle_time = counts_vehicle_time

    @property
    def view(self) -> VehicleView:
        """The state of the vehicle, which is built when it is read; for the thread that receives."""
        return self._builder.view

    @view.setter
    def view(self, view: VehicleView) -> None:
        self._builder = ViewBuilder(view)

    @property
    def own(self) -> Component:
        """System and component of this side."""
        return self.wire.own

    @property
    def target(self) -> tuple[int, int]:
        """System and component of the vehicle; (0, 0), broadcast, before its first heartbeat."""
        identity = self._builder.identity
        return (_BROADCAST, _BROADCAST) if identity is None else (identity.system_id, identity.component_id)

    @property
    def quality(self) -> LinkQuality:
        """Rate, loss and round trip of the link."""
        return self._monitor.quality

    def awaits_round_trip(self, now_s: float) -> bool:
        """Return True if received data is to be read without delay, so that the round trip is exact."""
        return self._monitor.is_waiting(now_s)

    @property
    def bad(self) -> int:
        """Received bytes and frames that are no valid messages."""
        return self.wire.bad

    @property
    def record(self) -> Callable[[bytes], None] | None:
        """Receiver of every frame, sent and received."""
        return self.wire.record

    @record.setter
    def record(self, record: Callable[[bytes], None] | None) -> None:
        self.wire.record = record

    def subscribe(self, rates_hz: Mapping[int, float]) -> None:
        """Request messages from the vehicle, id -> rate [Hz], instead of those of an earlier call."""
        self._subscription = Subscription(lambda: self._builder.identity, rates_hz)
        self._collect_services()

    def keep_vehicle(self) -> None:
        """Accept no other vehicle from now on, even if this one is lost."""
        assert self._builder.identity is not None
        self._system_id = self._builder.identity.system_id

    def use(self, service: Service | None) -> None:
        """Replace the service that exchanges messages with the vehicle."""
        self.service = service
        self._collect_services()

    def attach(self, service: Service) -> None:
        """Run a service beside that of ``use`` until ``detach``."""
        self._background.append(service)
        self._collect_services()

    def detach(self, service: Service) -> None:
        """End a service of ``attach``."""
        self._background.remove(service)
        self._collect_services()

    @property
    def is_passive(self) -> bool:
        """True if no service may send something after a message: none is attached, and the request has its result."""
        is_over = self.service is None or getattr(self.service, "result", None) is not None
        return is_over and not self._background

    def _collect_services(self) -> None:
        chosen = [] if self.service is None else [self.service]
        self._services = (*chosen, self._subscription, *self._background)

    def is_heard(self, now_s: float) -> bool:
        """Return True if the vehicle is connected: it was heard, and its heartbeat has not timed out."""
        heartbeat_s = self._builder.last_heartbeat_s
        return self.peer is not None and heartbeat_s is not None and not now_s - heartbeat_s > LOST_AFTER_S

    def receive(self, data: bytes, peer: Address, now_s: float) -> None:
        """Process a datagram."""
        self.receive_all((data,), peer, now_s)

    def receive_all(self, datagrams: Iterable[bytes], peer: Address, now_s: float) -> None:
        """Process datagrams that have arrived together."""
        if self._only_peer not in (None, peer) or (peer != self.peer and self.is_heard(now_s)):
            return
        is_known = peer == self.peer and self.is_heard(now_s)
        for message in self.wire.decode_all(datagrams, peer):
            if is_known and peer == self.peer:  # an observer may disconnect
                self._process(message, now_s)
            else:
                self.take(message, peer, now_s)

    def take(self, message: Message, peer: Address, now_s: float) -> None:
        """Process a decoded message of the vehicle, or of another system on its link."""
        if self.is_heard(now_s):
            if peer != self.peer:
                return
        elif not self._is_vehicle(message, peer, now_s):
            return
        self._process(message, now_s)

    def _process(self, message: Message, now_s: float) -> None:
        """Fold a message of the vehicle's peer into the view, and give it to observer and services."""
        is_own = self._builder.add(message, now_s)
        if self.observe is not None:
            self.observe(message)
        if is_own:
            for service in self._services:
                service.receive(message, now_s)
            if self._monitors:
                self._builder.note_quality(self._monitor.round_trip_s, self._monitor.loss)

    def _is_vehicle(self, message: Message, peer: Address, now_s: float) -> bool:
        """Return True if the message is from our vehicle; without one, accept the first autopilot's heartbeat."""
        is_own = (message.get_srcSystem(), message.get_srcComponent()) == self.target
        if is_own and self._builder.identity is not None and peer == self.peer:
            return True
        candidate = self.view if is_own else VehicleView()
        if update(candidate, message, now_s).last_heartbeat_s != now_s:
            return False
        if self._system_id not in (None, message.get_srcSystem()):
            return False
        self.view, self.peer = candidate, peer
        self._heartbeat_due_s = now_s
        return True

    def disconnect(self) -> None:
        """Accept the vehicle from any peer: its connection was closed."""
        self.peer = None

    def poll(self, now_s: float) -> list[bytes]:
        """Return the datagrams to send now to ``peer``.

        After ``disconnect`` nothing can be sent, but services still notice the loss of the vehicle and their timeouts.
        """
        if self.peer is None and self._builder.identity is None:
            return []
        frames = []
        if self.peer is not None and self.heartbeat_is_due(now_s):
            frames.append(self.encode(self._heartbeat(mavlink.MAV_STATE_ACTIVE)))
            self._note_heartbeat(now_s)
        for service in self._services:
            messages = service.poll(now_s)
            frames += [self.encode(message) for message in messages if self.peer is not None]
        return frames

    def heartbeat_is_due(self, now_s: float) -> bool:
        """Return True if the next ``poll`` sends a heartbeat."""
        vehicle_s = self._builder.time_s
        return now_s + _ROUNDING_S >= self._heartbeat_due_s or (
            self._counts_vehicle_time and vehicle_s is not None and vehicle_s >= self._heartbeat_due_vehicle_s
        )

    def _note_heartbeat(self, now_s: float) -> None:
        """Count a heartbeat: the next ones keep their times, so that those of both sides stay together."""
        due_s = self._heartbeat_due_s
        self.skip_heartbeat(now_s)
        if now_s + _ROUNDING_S < due_s:  # it was due in vehicle time alone
            self._heartbeat_due_s = due_s
        elif now_s - due_s < self._heartbeat_period_s - _ROUNDING_S:
            self._heartbeat_due_s = due_s + self._heartbeat_period_s

    @property
    def _heartbeat_period_s(self) -> float:
        return GREETING_PERIOD_S if self._builder.identity is None else HEARTBEAT_PERIOD_S

    def skip_heartbeat(self, now_s: float) -> None:
        """Send the next heartbeat one period from now: the peer just got one."""
        self._heartbeat_due_s = now_s + self._heartbeat_period_s
        vehicle_s = self._builder.time_s
        if vehicle_s is not None and self._counts_vehicle_time:
            self._heartbeat_due_vehicle_s = vehicle_s + HEARTBEAT_PERIOD_S

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest; None without a vehicle."""
        if self.peer is None and self._builder.identity is None:
            return None
        due_s = [service.next_deadline() for service in self._services]
        due_s.append(None if self.peer is None else self._heartbeat_due_s)
        return min((time_s for time_s in due_s if time_s is not None), default=None)

    def farewell(self) -> list[bytes]:
        """Return the HEARTBEAT in state POWEROFF, which ends the link in order."""
        return [] if self.peer is None else [self.encode(self._heartbeat(mavlink.MAV_STATE_POWEROFF))]

    def encode(self, message: Message) -> bytes:
        """Return the frame of a message from this ground station."""
        return self.wire.encode(message, self.peer)

    def _heartbeat(self, state: int) -> Message:
        return heartbeat(state, self._heartbeat_type)


def heartbeat(state: int, kind: int = mavlink.MAV_TYPE_GCS) -> Message:
    """Return the HEARTBEAT of a ground station in a MAV_STATE."""
    return mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, state, 3)

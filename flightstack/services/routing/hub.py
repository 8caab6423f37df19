"""Hub of all ground stations and companions: links, services and telemetry. No I/O.

Each peer has its own link (sequence numbers, message rates). Times are on the link clock: wall time in a process,
simulated time in tests. Telemetry rates count simulated time too (``telemetry.streams``).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Set

from flightstack.core.port_numbers import API, TCP
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import FrameReader
from flightstack.mavlink.link import Address, Link, Message, is_unknown
from flightstack.mavlink.signing import Signing
from flightstack.plan.kept_plans import KeptPlans
from flightstack.services.commands.context import VehicleContext
from flightstack.services.files.ftp_server import FtpServer
from flightstack.services.logs.log_server import LogServer
from flightstack.services.mission.mission_server import MissionService
from flightstack.services.registry import make_services
from flightstack.services.routing.peer import Peer, PeerAddress
from flightstack.services.routing.router import Router, Schedule, Service
from flightstack.services.routing.signing_setup import NEVER_FORWARDED, link_signing, signing_setup
from flightstack.services.telemetry.streams import ROUNDING_S, Streams, default_rates_hz
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.services.telemetry.vehicle import status_texts, system_time_at
from flightstack.vehicle.assembly import VehicleParts
from flightstack.vehicle.flight_state import ItemReached, Text
from flightstack.vehicle.status import VehicleInfo

HEARTBEAT_S = 1.0
PEER_FORGOTTEN_S = 30.0
MAX_PEERS = 64
"""Limit of peers that are not permanent."""
KEPT_TEXTS = 16
"""Texts that are kept until a peer is heard, so that a ground station gets the texts of the start."""
FORWARDED_A_POLL = 64
MAX_TO_FORWARD = 4096


class GroundHub:
    """Takes the bytes that peers send on all channels, and returns the bytes to send."""

    def __init__(
        self, vehicle: VehicleContext, parts: VehicleParts, telemetry: Telemetry, info: VehicleInfo
    ) -> None:
        self.vehicle = vehicle
        self._now = parts.now
        self._journal = parts.journal
        self._area = parts.area
        self._telemetry = telemetry
        self._own = Address(info.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._peers: dict[PeerAddress, Peer] = {}
        self._setup = signing_setup(self._own, parts)
        self._congested: Set[PeerAddress] = frozenset()
        self._polled_s = -math.inf
        services = make_services(self._own, vehicle, parts, telemetry, info, self._peer_at, self._has_room)
        self._services = [*services, self._setup]
        self._schedule = Schedule(self._services)
        self._file_services = [
            service for service in self._services if isinstance(service, FtpServer | LogServer)
        ]
        vehicle.params.subscribe(lambda _name, _value: self._schedule.wake())
        self._by_type: dict[str, list[Service]] = {}
        for service in self._services:
            for kind in service.handles:
                self._by_type.setdefault(kind, []).append(service)
        self._shown = parts.now.status
        self._home = parts.area.home
        self._texts: list[Text] = []
        self.signing: Signing | None = None
        """Signing of the links; set by ``use_signing``."""
        self._router: Router[PeerAddress] = Router(self._own)
        self._to_forward: deque[tuple[PeerAddress, bytes]] = deque(maxlen=MAX_TO_FORWARD)
        self._forget_due_s = -math.inf
        self.last_heard_s = -math.inf
        """Link time at which any peer was last heard, dropped ones included; −inf if none was."""

    def use_signing(self, signing: Signing, store: Callable[[bytes], None]) -> None:
        """Sign messages to peers that are added from now on, and check the signatures of their messages.

        ``store`` saves a new key from a ground station on this machine, and may raise OSError.
        """
        self.signing = signing
        self._setup.use(signing, store)

    # ------------------------------------------------------------------ peers

    def add_peer(self, address: PeerAddress, permanent: bool = False) -> Peer:
        """Add a peer. A permanent one gets heartbeats before it is heard."""
        rates = default_rates_hz(address.channel == API, self._telemetry.has_sensors)
        signing = link_signing(self.signing, address)
        link = Link(*self._own, keeps_unknown=True, signing=signing)
        signed = signing is not None and signing.requires_signature
        peer = Peer(link, Streams(rates, self._telemetry.streamed), permanent, address.channel == TCP, signed)
        self._peers[address] = peer
        return peer

    @property
    def forward_backlog(self) -> int:
        """Number of frames waiting to be forwarded, at most MAX_TO_FORWARD."""
        return len(self._to_forward)

    def addresses(self) -> list[tuple[PeerAddress, bool]]:
        """Return the address of every peer, with True for a permanent one."""
        return [(address, peer.permanent) for address, peer in self._peers.items()]

    def adopt_plans(self, other: GroundHub) -> None:
        """Take over the plans of the hub before a reboot."""
        self.restore_plans(other.plans())

    def plans(self) -> KeptPlans:
        """Return the plans in force."""
        return self._missions().plans()

    def restore_plans(self, plans: KeptPlans) -> str | None:
        """Restore plans that were in force before; return the first refusal, or None."""
        return self._missions().restore(plans)

    @property
    def sends_files(self) -> bool:
        """True while data of files or logs is left to send to a peer with room."""
        return any(service.is_busy for service in self._file_services)

    def _missions(self) -> MissionService:
        return next(service for service in self._services if isinstance(service, MissionService))

    def drop_peer(self, address: PeerAddress) -> None:
        """Remove a peer whose connection has ended."""
        self._peers.pop(address, None)
        self._router.forget(address)

    def heard_s(self, address: PeerAddress) -> float:
        """Return the link time of the last valid message of ``address``; −inf if the peer is unknown or was dropped."""
        peer = self._peers.get(address)
        return -math.inf if peer is None else peer.heard_s

    def _peer_at(self, address: Hashable) -> Peer:
        """Return the peer of a message that a service handles."""
        assert isinstance(address, PeerAddress)
        return self._peers[address]

    def _has_room(self, address: Hashable) -> bool:
        """Return False for a peer that gets no file data now: it is congested or silent."""
        peer = self._peers.get(address) if isinstance(address, PeerAddress) else None
        return peer is None or (address not in self._congested and peer.is_served(self._polled_s))

    def _forget_silent(self, now_s: float) -> None:
        if now_s < self._forget_due_s:
            return
        self._forget_due_s = now_s + HEARTBEAT_S
        for address, peer in list(self._peers.items()):
            if now_s - peer.heard_s > PEER_FORGOTTEN_S and not peer.connected:
                if peer.permanent:
                    peer.heard_s = -math.inf
                    self._router.forget(address)
                else:
                    self.drop_peer(address)

    def _admit(self, address: PeerAddress, data: bytes, now_s: float) -> Peer | None:
        """Add the sender of a valid frame, if a slot is free and the signature (where required) is valid.

        A new peer may replace a silent one.
        """
        signing = link_signing(self.signing, address)
        frames = [frame.data for frame in FrameReader().feed(data) if frame.known]
        if not any(signing is None or signing.authenticates(frame) for frame in frames):
            return None
        temporary = [(peer.heard_s, where) for where, peer in self._peers.items() if not peer.permanent]
        if len(temporary) >= MAX_PEERS:
            _, longest_silent = min(temporary)
            if not self._peers[longest_silent].is_silent(now_s):
                return None
            self.drop_peer(longest_silent)
        return self.add_peer(address)

    # ------------------------------------------------------------------ receiving

    def receive(self, address: PeerAddress, data: bytes, now_s: float) -> None:
        """Take a datagram or a part of a stream. Never raise, whatever it contains.

        A message without the signature that the link requires (RADIO_STATUS may come unsigned) has no effect: its
        sender does not count as heard, and the router learns nothing from it.
        """
        peer = self._peers.get(address) or self._admit(address, data, now_s)
        if peer is None:
            return
        for message in peer.link.decode(data):
            if not peer.link.is_authentic(message):
                continue
            if not is_unknown(message):
                peer.heard_s = self.last_heard_s = now_s
            route = self._router.route(message, address, now_s)
            if route.forward and message.get_type() not in NEVER_FORWARDED:
                frame = bytes(message.get_msgbuf())
                self._to_forward.extend((other, frame) for other in route.forward)
            if route.local:
                kind = message.get_type()
                self._schedule.wake(kind)
                for service in self._by_type.get(kind, ()):
                    service.receive(message, address, now_s)

    # ------------------------------------------------------------------ sending

    def poll(
        self, now_s: float, congested: Set[PeerAddress] = frozenset()
    ) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield (address, bytes) to send now.

        ``congested`` peers get answers and texts, but no telemetry or file data.

        The caller may take a part of the iterator now and the rest later, but before its next call of ``poll``. It may
        call ``receive`` in between.
        """
        self._congested, self._polled_s = congested, now_s
        changed = self._note_changes()
        if addressed := self._schedule.poll(now_s):
            self._collect(addressed)
        self._send_texts()
        self._telemetry.begin_poll()
        for address, peer in list(self._peers.items()):
            if self._peers.get(address) is peer:  # the caller may have dropped it since
                for frame in self._frames(peer, changed, now_s, streams=address not in congested):
                    yield address, frame
        if self._to_forward:
            yield from self._forwarded(now_s)
        self._forget_silent(now_s)

    def poll_motion(self, now_s: float) -> Iterator[tuple[PeerAddress, list[bytes]]]:
        """Yield (address, frames) of streams that are due, if nothing else is."""
        telemetry = self._telemetry
        telemetry.begin_poll()
        for address, peer in self._peers.items():
            if peer.is_served(now_s):
                due = peer.streams.due(telemetry.time_us * 1e-6, now_s)
                yield address, telemetry.frames(due, peer.link)

    def motion_idle_s(self, now_s: float) -> float:
        """Return the time for which no stream is due, as ``idle_s``."""
        vehicle_s, idle_s = self._now.time_us * 1e-6, math.inf
        for peer in self._peers.values():
            if peer.is_served(now_s):
                idle_s = min(idle_s, peer.streams.idle_s(vehicle_s))
        return idle_s

    def idle_s(self, now_s: float, motion: bool = True) -> float:
        """Return the time for which ``poll`` sends nothing, unless a message arrives or an event happens [s].

        0 or less if it may send something now. Without ``motion``, nothing but streams of the motion. The link clock
        and the vehicle clock must run alike.
        """
        has_changed = self._now.status != self._shown or self._area.home != self._home
        if has_changed or self._to_forward or self._journal.has_events or (self._texts and self._is_heard):
            return 0.0
        vehicle_s = self._now.time_us * 1e-6
        idle_s = min(self._schedule.idle_s(now_s), self._forget_due_s - now_s)
        for peer in self._peers.values():
            is_served = peer.is_served(now_s)
            if peer.outbox and (is_served or peer.outbox != _kept_texts(peer)):
                return 0.0
            idle_s = min(idle_s, peer.heartbeat_due_s - now_s)
            if is_served:
                idle_s = min(idle_s, peer.streams.idle_s(vehicle_s, motion))
        return idle_s

    def _forwarded(self, now_s: float) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield queued frames to forward, at most FORWARDED_A_POLL."""
        for _ in range(min(FORWARDED_A_POLL, len(self._to_forward))):
            address, frame = self._to_forward.popleft()
            peer = self._peers.get(address)
            if peer is not None and peer.is_served(now_s):
                yield address, frame

    def _collect(self, addressed: Iterable[tuple[Hashable | None, Message]]) -> None:
        for address, message in addressed:
            if address is None:
                self._send_to_all(message)
            elif isinstance(address, PeerAddress) and address in self._peers:
                self._peers[address].outbox.append(message)

    def _frames(self, peer: Peer, changed: bool, now_s: float, streams: bool) -> list[bytes]:
        """Return the frames to send to ``peer`` now. Keep texts for a silent peer, which may be heard again."""
        due: list[Message] = []
        telemetry, is_served = self._telemetry, peer.is_served(now_s)
        is_due = now_s + ROUNDING_S >= peer.heartbeat_due_s
        if (changed or is_due) and (peer.heard or peer.permanent):
            if is_due:  # one for a change comes in between: the times of the others stay
                peer.heartbeat_due_s = now_s + HEARTBEAT_S
            due += telemetry.messages(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        if is_served:
            due += peer.outbox
            peer.outbox.clear()
        else:
            peer.outbox[:] = _kept_texts(peer)
        frames = [peer.link.encode(message) for message in due]
        if is_served and streams:
            frames += telemetry.frames(peer.streams.due(telemetry.time_us * 1e-6, now_s), peer.link)
        return frames

    def _note_changes(self) -> bool:
        """Announce reached items and a change of home; return True if mode or arming has changed."""
        reached = self._take_events()
        changed = self._now.status != self._shown
        self._shown = self._now.status
        if self._area.home != self._home:
            self._home = self._area.home
            self._announce(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        if changed or reached:
            self._announce(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)
        return changed

    def _take_events(self) -> bool:
        """Take the events of the journal, and queue its texts; return True if an item was reached."""
        reached = False
        for event in self._journal.take_events():
            if isinstance(event, ItemReached):
                reached = True
                self._send_to_all(mavlink.MAVLink_mission_item_reached_message(event.seq))
            else:
                self._texts.append(event)
        return reached

    def _send_texts(self) -> None:
        """Send queued texts to the peers that were heard; keep the newest until there is one.

        SYSTEM_TIME before a text carries its time, which STATUSTEXT does not.
        """
        self._take_events()  # texts of the services in this poll
        if not self._texts:
            return
        if not self._is_heard:
            del self._texts[:-KEPT_TEXTS]
            return
        sent_us = None
        for time_us, severity, text in self._texts:
            if time_us != sent_us:
                self._send_to_all(system_time_at(time_us))
                sent_us = time_us
            for message in status_texts(severity, text):
                self._send_to_all(message)
        self._texts.clear()

    @property
    def _is_heard(self) -> bool:
        return any(peer.heard for peer in self._peers.values())

    def _announce(self, message_id: int) -> None:
        for message in self._telemetry.requested(message_id):
            self._send_to_all(message)

    def _send_to_all(self, message: Message) -> None:
        for peer in self._peers.values():
            if peer.heard:
                peer.outbox.append(message)

    def farewell(self) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield the bytes to send at shutdown: queued answers, then a heartbeat with MAV_STATE_POWEROFF."""
        for service in self._services:
            self._collect(service.poll(0.0))
        self._send_texts()
        for address, peer in self._peers.items():
            for message in peer.outbox:
                yield address, peer.link.encode(message)
            peer.outbox.clear()
        for address, peer in self._peers.items():
            yield address, peer.link.encode(self._telemetry.farewell())


def _kept_texts(peer: Peer) -> list[Message]:
    """Return what is kept for a peer that is not served, until it is heard again."""
    return [message for message in peer.outbox if message.get_type() == "STATUSTEXT"][-KEPT_TEXTS:]

"""All ground stations and companions of the vehicle, without I/O: links, services and telemetry.

Each peer has a link of its own (sequence numbers, rates). Times here are the links' own clock: the wall clock
in a process, simulated time in tests. Telemetry counts simulated time too (``mavlink.streams``).
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
from flightstack.services.commands import VehicleContext
from flightstack.services.mission.mission_service import MissionService
from flightstack.services.routing.peer import Peer, PeerAddress
from flightstack.services.routing.router import Router
from flightstack.services.routing.signing_setup import NEVER_FORWARDED, link_signing, signing_setup
from flightstack.services.services import Service, make_services
from flightstack.services.telemetry.streams import API_RATES_HZ, GROUND_RATES_HZ, Streams
from flightstack.services.telemetry.telemetry import Telemetry
from flightstack.services.telemetry.vehicle import status_texts
from flightstack.vehicle.assembly import VehicleParts
from flightstack.vehicle.journal import ItemReached, Text
from flightstack.vehicle.status import VehicleInfo

HEARTBEAT_S = 1.0
PEER_FORGOTTEN_S = 30.0
MAX_PEERS = 64
"""Peers that came by themselves; those addressed unasked, and TCP clients, have limits of their own."""
KEPT_TEXTS = 16
"""Texts that wait while no peer is heard, so that a ground station learns what happened at the start."""
FORWARDED_A_POLL = 64
MAX_TO_FORWARD = 4096


class GroundHub:
    """Receives bytes of any peer on any channel and returns the bytes to send."""

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
        self._by_type: dict[str, list[Service]] = {}
        for service in self._services:
            for kind in service.handles:
                self._by_type.setdefault(kind, []).append(service)
        self._shown = parts.now.status
        self._home = parts.area.home
        self._texts: list[Text] = []
        self.signing: Signing | None = None
        """What peers are signed with; set by ``use_signing``."""
        self._router: Router[PeerAddress] = Router(self._own)
        self._to_forward: deque[tuple[PeerAddress, bytes]] = deque(maxlen=MAX_TO_FORWARD)
        self._forget_due_s = -math.inf
        self.last_heard_s = -math.inf
        """When any peer was last heard, forgotten ones too; −inf if none ever was."""

    def use_signing(self, signing: Signing, store: Callable[[bytes], None]) -> None:
        """Sign what is sent to peers that are added from now on, and check what they send.

        A new key that a ground station of this machine sends is kept by ``store``, which may raise OSError.
        """
        self.signing = signing
        self._setup.use(signing, store)

    # ------------------------------------------------------------------ peers

    def add_peer(self, address: PeerAddress, permanent: bool = False) -> Peer:
        """Begin to talk to ``address``; a permanent one gets heartbeats before it was ever heard."""
        rates = API_RATES_HZ if address.channel == API else GROUND_RATES_HZ
        signing = link_signing(self.signing, address)
        link = Link(*self._own, keeps_unknown=True, signing=signing)
        signed = signing is not None and signing.requires_signature
        peer = Peer(link, Streams(rates), permanent, address.channel == TCP, signed)
        self._peers[address] = peer
        return peer

    @property
    def forward_backlog(self) -> int:
        """Frames that wait to be passed on to peers, at most MAX_TO_FORWARD."""
        return len(self._to_forward)

    def addresses(self) -> list[tuple[PeerAddress, bool]]:
        """Return every peer's address, and whether it is permanent."""
        return [(address, peer.permanent) for address, peer in self._peers.items()]

    def adopt_plans(self, other: GroundHub) -> None:
        """Take the plans that another hub's vehicle holds; before a reboot it was this one's."""
        self.restore_plans(other.plans())

    def plans(self) -> KeptPlans:
        """Return the plans in force."""
        return self._missions().plans()

    def restore_plans(self, plans: KeptPlans) -> str | None:
        """Put plans in force that were before; return the first reason against one of them, or None."""
        return self._missions().restore(plans)

    def _missions(self) -> MissionService:
        return next(service for service in self._services if isinstance(service, MissionService))

    def drop_peer(self, address: PeerAddress) -> None:
        """Forget a peer whose connection has ended."""
        self._peers.pop(address, None)
        self._router.forget(address)

    def heard_s(self, address: PeerAddress) -> float:
        """Return when the last valid message of ``address`` came; −inf if none did, or too long ago."""
        peer = self._peers.get(address)
        return -math.inf if peer is None else peer.heard_s

    def _peer_at(self, address: Hashable) -> Peer:
        """Find the peer that a service names: one that it heard, in the same call."""
        assert isinstance(address, PeerAddress)
        return self._peers[address]

    def _has_room(self, address: Hashable) -> bool:
        """Return False for a peer that is not to get file data now: it reads too slowly, or has fallen silent."""
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
        """Add the sender of a valid frame, signed where a signature is required, if there is room."""
        signing = link_signing(self.signing, address)
        frames = [frame.data for frame in FrameReader().feed(data) if frame.known]
        if not any(signing is None or signing.authenticates(frame) for frame in frames):
            return None
        passing = [(peer.heard_s, where) for where, peer in self._peers.items() if not peer.permanent]
        if len(passing) >= MAX_PEERS:
            _, longest_silent = min(passing)
            if not self._peers[longest_silent].is_silent(now_s):
                return None
            self.drop_peer(longest_silent)
        return self.add_peer(address)

    # ------------------------------------------------------------------ receiving

    def receive(self, address: PeerAddress, data: bytes, now_s: float) -> None:
        """Take a datagram, or a piece of a stream; whatever it holds, nothing is raised.

        A message without the signature that the link requires (RADIO_STATUS may come so) has no effect: its
        sender does not count as heard, and no route is learned from it.
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
                for service in self._by_type.get(message.get_type(), ()):
                    service.receive(message, address, now_s)

    # ------------------------------------------------------------------ sending

    def poll(
        self, now_s: float, congested: Set[PeerAddress] = frozenset()
    ) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield (address, bytes) of all that is to be sent now.

        Telemetry and file data wait for peers that are ``congested``, answers and texts do not.

        A caller with little time may take some of it now and the rest later, but before its next call of ``poll``;
        ``receive`` may be called in between.
        """
        self._congested, self._polled_s = congested, now_s
        changed = self._note_changes()
        for service in self._services:
            self._collect(service.poll(now_s))
        self._spread_texts()
        self._telemetry.begin_poll()
        for address, peer in list(self._peers.items()):
            if self._peers.get(address) is peer:  # it may have gone while its turn had not come
                due = self._due(peer, changed, now_s, streams=address not in congested)
                frames = [peer.link.encode_shared(message) for message in due]
                for frame in frames:
                    yield address, frame
        yield from self._forwarded(now_s)
        self._forget_silent(now_s)

    def _forwarded(self, now_s: float) -> Iterator[tuple[PeerAddress, bytes]]:
        """Pass on what peers sent each other, so much at a time."""
        for _ in range(min(FORWARDED_A_POLL, len(self._to_forward))):
            address, frame = self._to_forward.popleft()
            peer = self._peers.get(address)
            if peer is not None and peer.is_served(now_s):
                yield address, frame

    def _collect(self, addressed: Iterable[tuple[Hashable | None, Message]]) -> None:
        for address, message in addressed:
            if address is None:
                self._to_all(message)
            elif isinstance(address, PeerAddress) and address in self._peers:
                self._peers[address].outbox.append(message)

    def _due(self, peer: Peer, changed: bool, now_s: float, streams: bool) -> Iterator[Message]:
        """Yield what ``peer`` is to get now; texts wait for one that has fallen silent, and may speak again."""
        if (peer.heard or peer.permanent) and (changed or now_s >= peer.heartbeat_due_s):
            peer.heartbeat_due_s = now_s + HEARTBEAT_S
            yield from self._telemetry.messages(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        if not peer.is_served(now_s):
            texts = [message for message in peer.outbox if message.get_type() == "STATUSTEXT"]
            peer.outbox[:] = texts[-KEPT_TEXTS:]
            return
        yield from peer.outbox
        peer.outbox.clear()
        if streams:
            yield from peer.streams.due(self._telemetry, now_s)

    def _note_changes(self) -> bool:
        """Announce reached items and a change of home; return True if mode or arming changed."""
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
        """Take the journal's events: texts wait for ``_spread_texts``; return True if an item was reached."""
        reached = False
        for event in self._journal.take_events():
            if isinstance(event, ItemReached):
                reached = True
                self._to_all(mavlink.MAVLink_mission_item_reached_message(event.seq))
            else:
                self._texts.append(event)
        return reached

    def _spread_texts(self) -> None:
        """Send the texts to the peers that were heard; until there is one, the newest wait."""
        self._take_events()  # of the services in this poll
        if not any(peer.heard for peer in self._peers.values()):
            del self._texts[:-KEPT_TEXTS]
            return
        for text in self._texts:
            for message in status_texts(text.severity, text.text):
                self._to_all(message)
        self._texts.clear()

    def _announce(self, message_id: int) -> None:
        for message in self._telemetry.requested(message_id):
            self._to_all(message)

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
            for message in [*peer.outbox, self._telemetry.farewell()]:
                yield address, peer.link.encode(message)
            peer.outbox.clear()

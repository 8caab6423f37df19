"""The vehicles on one link, a session each. Sans-IO."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message
from flightstack.mavlink.signing import LinkSigning
from flightstack.transports.udp import Address
from gcs_cli.link.session import HEARTBEAT_PERIOD_S, Session, heartbeat
from gcs_cli.link.wire import Wire


class Datagram(NamedTuple):
    """Bytes to send to a peer."""

    data: bytes
    peer: Address


class Fleet:
    """Sessions of all vehicles on a link. ``selected`` is the vehicle that commands go to.

    The first vehicle is selected. If it is lost, the next vehicle with a heartbeat is, unless the selection was
    ``keep``-ed. With ``system_id``, only that vehicle is ever selected. ``peers``: the addresses to send to before a
    vehicle is heard. ``only``: ignore datagrams of other peers.
    """

    def __init__(
        self,
        peers: Collection[Address] = (),
        only: Address | None = None,
        record: Callable[[bytes], None] | None = None,
        signing: LinkSigning | None = None,
        system_id: int | None = None,
    ) -> None:
        self.peers = peers
        self.wire = Wire(signing, record)
        self.observe: Callable[[Message, float], None] | None = None
        """Called with every message on the link, those of other ground stations and of components too, and its time."""
        self.systems: set[int] = set()
        """Ids of systems whose autopilot, component 1, has sent any message."""
        self._only = only
        self.chosen = system_id
        """System id of the only vehicle to select; None: any."""
        self._kept = False
        self._rates_hz: Mapping[int, float] = {}
        self._sessions: dict[int, Session] = {}
        self._selected = self._new_session(system_id)
        self._greeting_due_s = -math.inf

    def _new_session(self, system_id: int | None) -> Session:
        session = Session(system_id=system_id, wire=self.wire, monitors=True)
        session.subscribe(self._rates_hz)
        return session

    @property
    def sessions(self) -> Mapping[int, Session]:
        """Sessions by system id, of every vehicle that has sent a heartbeat."""
        return self._sessions

    @property
    def selected(self) -> Session:
        """The session that commands use; without a vehicle before the first heartbeat."""
        return self._selected

    def select(self, system_id: int) -> Session:
        """Select a vehicle by its system id, and keep it; raise KeyError if it was never heard."""
        self._selected = self._sessions[system_id]
        self._kept = True
        return self._selected

    @property
    def is_kept(self) -> bool:
        """True if the selection does not move to another vehicle when this one is lost."""
        return self._kept or self.chosen is not None

    def keep(self) -> None:
        """Keep the selected vehicle, even if it is lost."""
        self._kept = True

    @property
    def selection(self) -> tuple[int | None, Session]:
        """The chosen system id and the selected session."""
        return self.chosen, self._selected

    @selection.setter
    def selection(self, selection: tuple[int | None, Session]) -> None:
        self.chosen, self._selected = selection

    def choose(self, system_id: int | None) -> None:
        """Select only this vehicle from now on, heard or not; None: leave the selection as it is."""
        if system_id is None or system_id == self.chosen:
            return
        self.chosen = system_id
        session = self._sessions.get(system_id)
        self._selected = self._new_session(system_id) if session is None else session

    def subscribe(self, rates_hz: Mapping[int, float]) -> None:
        """Request messages, id -> rate [Hz], from every vehicle, those that are heard later too."""
        self._rates_hz = rates_hz
        for session in {self._selected, *self._sessions.values()}:
            session.subscribe(rates_hz)

    def receive(self, data: bytes, peer: Address, now_s: float) -> None:
        """Process a datagram."""
        if self._only not in (None, peer):
            return
        for message in self.wire.decode(data, peer):
            if self.observe is not None:
                self.observe(message, now_s)
            self._take(message, peer, now_s)

    def _take(self, message: Message, peer: Address, now_s: float) -> None:
        system = message.get_srcSystem()
        session = self._sessions.get(system)
        if session is None:
            if message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self.systems.add(system)
            if message.get_type() != "HEARTBEAT":
                return
            session = self._candidate(system)
            session.take(message, peer, now_s)
            if session.view.identity is None:
                return
            session.keep_vehicle()
            self._sessions[system] = session
        else:
            session.take(message, peer, now_s)
        if session is not self._selected and self._may_replace(session, now_s):
            self._selected = session

    def _candidate(self, system: int) -> Session:
        """Return the session for a vehicle that has no session yet."""
        free = self._selected.view.identity is None and self.chosen in (None, system)
        return self._selected if free else self._new_session(system)

    def _may_replace(self, session: Session, now_s: float) -> bool:
        """Return True if ``session`` becomes the selected one, whose vehicle is unknown or lost."""
        is_kept = self._kept and self._selected.view.identity is not None
        is_wanted = self.chosen in (None, session.target[0])
        return is_wanted and not is_kept and session.is_heard(now_s) and not self._selected.is_heard(now_s)

    def poll(self, now_s: float) -> list[Datagram]:
        """Return the datagrams to send now."""
        out = [Datagram(frame, peer) for peer in self._greeted(now_s) for frame in [self._hello(peer)]]
        served: set[Address] = set()
        for session in self._sessions.values():
            peer = session.peer
            if peer in served:  # one heartbeat serves all vehicles behind a peer
                session.skip_heartbeat(now_s)
            due = session.heartbeat_is_due(now_s)
            frames = session.poll(now_s)
            if peer is None:
                continue
            out += [Datagram(frame, peer) for frame in frames]
            if due:
                served.add(peer)
        return out

    def _greeted(self, now_s: float) -> Collection[Address]:
        """Return the peers to send a heartbeat to although no vehicle has answered."""
        if self._sessions or now_s < self._greeting_due_s:
            return []
        self._greeting_due_s = now_s + HEARTBEAT_PERIOD_S
        return self.peers

    def _hello(self, peer: Address, state: int = mavlink.MAV_STATE_ACTIVE) -> bytes:
        return self.wire.encode(heartbeat(state), peer)

    def next_deadline(self) -> float | None:
        """Return the time at which to call ``poll`` at the latest; None without a peer."""
        if not self._sessions:
            return self._greeting_due_s if self.peers else None
        due_s = (session.next_deadline() for session in self._sessions.values())
        return min((time_s for time_s in due_s if time_s is not None), default=None)

    def disconnect(self, peer: Address) -> None:
        """Accept the vehicles behind ``peer`` from any peer: its connection was closed."""
        for session in self._sessions.values():
            if session.peer == peer:
                session.disconnect()

    def receivers(self) -> list[Address]:
        """Return the peers with vehicles; before the first heartbeat, the addresses to send to first."""
        heard = {session.peer for session in self._sessions.values() if session.peer is not None}
        return sorted(heard if self._sessions else self.peers)

    def farewell(self) -> list[Datagram]:
        """Return the HEARTBEATs in state POWEROFF, which end the link in order."""
        return [Datagram(self._hello(peer, mavlink.MAV_STATE_POWEROFF), peer) for peer in self.receivers()]

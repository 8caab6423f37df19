"""All ground stations and companions of the vehicle, without I/O: links, services and telemetry.

Each peer has a link of its own (sequence numbers, rates). Times here are the links' own clock: the wall clock
in a process, simulated time in tests. Telemetry counts simulated time too (``mavlink.streams``).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from flightstack.autopilot import NOTICE, WARNING, Autopilot
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link, Message
from flightstack.mavlink.services.addressing import Address
from flightstack.mavlink.services.command_server import Command, CommandServer
from flightstack.mavlink.services.mission_server import (
    CurrentRequested,
    MissionCleared,
    MissionRefused,
    MissionReplaced,
    MissionServer,
)
from flightstack.mavlink.streams import API_RATES_HZ, GROUND_RATES_HZ, Streams
from flightstack.mavlink.telemetry import MAKERS, autopilot_version, heartbeat, messages, status_texts
from flightstack.vehicle_commands import (
    ACCEPTED,
    DENIED,
    HANDLERS,
    UNSUPPORTED,
    Answer,
    execute,
    select_custom_mode,
)
from flightstack.vehicle_facts import AutopilotFacts

HEARTBEAT_S = 1.0
PEER_FORGOTTEN_S = 30.0
MAX_PEERS = 32
GROUND = "ground"
"""The channel of ground stations; any other gets the rates of an API client."""
SHUT_DOWN = 2.0
LINK_COMMANDS = (
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
)


class PeerAddress(NamedTuple):
    """Where a peer is: the channel it uses, and its address there."""

    channel: str
    host: str
    port: int


@dataclass
class Peer:
    """One ground station or companion."""

    link: Link
    streams: Streams
    permanent: bool
    heard_s: float = -math.inf
    heartbeat_due_s: float = -math.inf
    outbox: list[Message] = field(default_factory=list)

    @property
    def heard(self) -> bool:
        """Whether it has ever sent a valid message: only then telemetry is streamed to it."""
        return self.heard_s > -math.inf


class GroundHub:
    """Receives bytes of any peer on any channel and returns the bytes to send."""

    def __init__(self, autopilot: Autopilot, facts: AutopilotFacts, system_id: int) -> None:
        self._autopilot = autopilot
        self._facts = facts
        self._system_id = system_id
        self._peers: dict[PeerAddress, Peer] = {}
        own = Address(system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._missions = MissionServer(own, autopilot.check_mission)
        self._commands = CommandServer(own, [*HANDLERS, *LINK_COMMANDS])
        self._shown = (facts.armed, facts.mode)
        self.shutdown_requested = False

    # ------------------------------------------------------------------ peers

    def add_peer(self, address: PeerAddress, permanent: bool = False) -> Peer:
        """Begin to talk to ``address``; a permanent one gets heartbeats before it was ever heard."""
        rates = GROUND_RATES_HZ if address.channel == GROUND else API_RATES_HZ
        peer = Peer(Link(self._system_id, mavlink.MAV_COMP_ID_AUTOPILOT1), Streams(rates), permanent)
        self._peers[address] = peer
        return peer

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
            self._handle(address, peer, message, now_s)

    def _handle(self, address: PeerAddress, peer: Peer, message: Message, now_s: float) -> None:
        command = self._commands.receive(message, address, now_s)
        if command is not None:
            self._execute(peer, command)
        elif message.get_type() == "SET_MODE":
            if message.target_system in (0, self._system_id):
                self._report(select_custom_mode(self._autopilot, message.custom_mode), "Mode change")
        else:
            self._missions.receive(message, address, now_s)
            self._take_mission_events()

    def _take_mission_events(self) -> None:
        for event in self._missions.events():
            if isinstance(event, MissionReplaced):
                self._autopilot.set_mission(event.items)
                self._autopilot.say(NOTICE, f"Mission of {len(event.items)} items loaded")
            elif isinstance(event, MissionCleared):
                self._autopilot.set_mission(())
            elif isinstance(event, CurrentRequested):
                self._report_text(self._autopilot.set_current_item(event.seq), "Mission item")
            elif isinstance(event, MissionRefused):
                self._autopilot.say(WARNING, f"Mission refused: {event.reason}")

    # ------------------------------------------------------------------ commands

    def _execute(self, peer: Peer, command: Command) -> None:
        answer = self._answer(peer, command)
        self._commands.answer(command, answer.result)
        self._report(answer, "Command refused")

    def _report(self, answer: Answer, what: str) -> None:
        if answer.result not in (ACCEPTED, UNSUPPORTED):
            self._report_text(answer.reason, what)

    def _report_text(self, reason: str | None, what: str) -> None:
        if reason:
            self._autopilot.say(WARNING, f"{what}: {reason}")

    def _answer(self, peer: Peer, command: Command) -> Answer:
        """Commands of a link are answered here, the others by the vehicle."""
        number, p = command.command, command.params
        if number == mavlink.MAV_CMD_REQUEST_MESSAGE:
            return self._request_message(peer, p[0], p[1])
        if number == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            done = math.isfinite(p[0]) and peer.streams.set_interval(int(p[0]), p[1])
            return Answer(ACCEPTED) if done else Answer(DENIED, "no such message or interval")
        if number == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN:
            if p[0] != SHUT_DOWN:
                return Answer(UNSUPPORTED)
            if self._facts.armed and not self._facts.landed:
                return Answer(DENIED, "the vehicle is in the air")
            self.shutdown_requested = True
            return Answer(ACCEPTED)
        return execute(self._autopilot, command)

    def _request_message(self, peer: Peer, wanted: float, argument: float) -> Answer:
        number = int(wanted) if math.isfinite(wanted) else -1
        if number == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            peer.outbox.append(autopilot_version(self._system_id))
        elif number == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL and math.isfinite(argument):
            about = int(argument)
            if not 0 <= about <= 0xFFFF:
                return Answer(DENIED, f"message {argument:g} has no place in MESSAGE_INTERVAL")
            peer.outbox.append(
                mavlink.MAVLink_message_interval_message(about, peer.streams.interval_us(about))
            )
        elif number in MAKERS:
            peer.outbox.extend(messages(number, self._facts))
        else:
            return Answer(DENIED, f"message {wanted:g} is not available")
        return Answer(ACCEPTED)

    # ------------------------------------------------------------------ sending

    def poll(self, now_s: float) -> Iterator[tuple[PeerAddress, bytes]]:
        """Yield (address, bytes) of all that is to be sent now."""
        self._take_mission_events()
        changed = self._note_changes()
        self._missions.current_seq = self._facts.mission_current
        self._collect(self._missions.poll(now_s))
        self._collect(self._commands.poll(now_s))
        self._take_mission_events()
        self._spread_texts()
        for address, peer in list(self._peers.items()):
            for message in self._due(peer, changed, now_s):
                yield address, peer.link.encode(message)
        self._forget_silent(now_s)

    def _collect(self, addressed: list[tuple[Hashable, Message]]) -> None:
        for address, message in addressed:
            if isinstance(address, PeerAddress) and address in self._peers:
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
        self._spread_texts()
        self._collect(self._commands.poll(0.0))
        for address, peer in self._peers.items():
            for message in [*peer.outbox, heartbeat(self._facts, leaving=True)]:
                yield address, peer.link.encode(message)
            peer.outbox.clear()

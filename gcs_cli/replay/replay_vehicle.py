"""The vehicle of a replay, sans-IO: clock, peers, telemetry, and answers to clients.

It is a recording: commands, uploads and changes of parameters are refused with DENIED and a text.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Sequence

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import whole
from flightstack.mavlink.ftp_messages import FtpError, Opcode, Packet, ftp_message, next_sequence, read_packet
from flightstack.mavlink.link import Link, Message, is_for, sender
from flightstack.transports.vehicle_ports import Place
from gcs_cli.replay.logged_plans import item_message
from gcs_cli.replay.playback import Playback

HEARTBEAT_S = 1.0
PEER_TIMEOUT_S = 15.0
MAX_PEERS = 32
PARAMETERS_PER_POLL = 40
SPEEDS = (0.1, 1000.0)
_MAX_ID = 0xFF_FFFF
TEXT = b"Command refused: this is the replay of a log"
_QUIET = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION, mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION, mavlink.MAV_CMD_REQUEST_FLIGHT_INFORMATION,
}  # fmt: skip
"""Commands that clients send by themselves; refused without a text."""


class ReplayVehicle:
    """Plays ``playback`` at ``speed`` to ``peers``, and to every peer that sends a message."""

    def __init__(
        self,
        playback: Playback,
        peers: Sequence[Place],
        now_s: float,
        speed: float = 1.0,
        begin_s: float = 0.0,
        system: int | None = None,
    ) -> None:
        """``system``: system id, by default that of the log."""
        self.at_s = self._clamped(playback, begin_s)
        self.speed = speed
        self.is_paused = False
        self.refused = 0
        """Number of refused commands and changes."""
        self._playback = playback
        self.address = playback.vehicle if system is None else playback.vehicle._replace(system=system)
        self._link = Link(*self.address)
        self._first = tuple(peers)
        self._heard_s: dict[Place, float] = {}
        self._connected: set[Place] = set()
        """Peers with a connection, which stay until they close it."""
        self._decoders: dict[Place, Link] = {}
        self._now_s = now_s
        self._heartbeat_due_s = now_s
        self._content: tuple[int, ...] = ()
        """Modes and state of the last heartbeat: a change is sent at once."""
        self._shows_state = True
        self._outbox: list[tuple[Place, Message]] = []
        self._parameters: deque[tuple[Place, Message]] = deque()

    @staticmethod
    def _clamped(playback: Playback, at_s: float) -> float:
        return min(max(0.0, at_s), playback.duration_s)

    @property
    def duration_s(self) -> float:
        """Duration of the log."""
        return self._playback.duration_s

    @property
    def has_ended(self) -> bool:
        """True at the end of the log."""
        return self.at_s >= self.duration_s

    @property
    def peers(self) -> tuple[Place, ...]:
        """Peers that telemetry is sent to."""
        return (*self._first, *(peer for peer in self._heard_s if peer not in self._first))

    # -- control

    def seek(self, at_s: float) -> None:
        """Continue at another time."""
        self.at_s = self._clamped(self._playback, at_s)
        self._shows_state, self._heartbeat_due_s = True, self._now_s

    def change_speed(self, factor: float) -> None:
        """Multiply the speed."""
        self.speed = min(max(SPEEDS[0], self.speed * factor), SPEEDS[1])

    def admit(self, peer: Place, now_s: float) -> None:
        """Send to a peer that has opened a connection."""
        self._heard_s[peer], self._decoders[peer] = now_s, Link(0, 0)
        self._connected.add(peer)
        self._shows_state, self._heartbeat_due_s = True, now_s

    def forget(self, peer: Place) -> None:
        """Remove a peer that has closed its connection."""
        self._connected.discard(peer)
        self._heard_s.pop(peer, None)
        self._decoders.pop(peer, None)

    def heard_s(self, peer: Place) -> float:
        """Return the time of the last valid message of a peer; -inf without one."""
        return self._heard_s.get(peer, -math.inf)

    # -- time

    def poll(self, now_s: float) -> list[tuple[Place, bytes]]:
        """Advance to ``now_s``; return the frames to send, each with its peer."""
        begin_s, elapsed_s = self.at_s, max(0.0, now_s - self._now_s)
        self._now_s = max(now_s, self._now_s)
        if not self.is_paused:
            self.at_s = min(self.duration_s, begin_s + self.speed * elapsed_s)
        messages: list[Message] = []
        beat = self._playback.heartbeat(self.at_s)
        content = (beat.base_mode, beat.custom_mode, beat.system_status)
        if now_s >= self._heartbeat_due_s or content != self._content:
            self._heartbeat_due_s, self._content = now_s + HEARTBEAT_S, content
            messages.append(beat)
            self._shows_state = self._shows_state or self.is_paused
        if self._shows_state:
            messages += self._playback.state(begin_s)
            self._shows_state = False
        messages += self._playback.messages(begin_s, self.at_s)
        self._forget_silent(now_s)
        peers = self.peers
        frames = [self._link.encode(message) for message in messages]
        sent = [(peer, frame) for frame in frames for peer in peers]
        answers = [*self._outbox, *itertools.islice(self._parameters, PARAMETERS_PER_POLL)]
        for _ in range(len(answers) - len(self._outbox)):
            self._parameters.popleft()
        self._outbox.clear()
        return sent + [(peer, self._link.encode(message)) for peer, message in answers]

    def farewell(self) -> list[tuple[Place, bytes]]:
        """Return the HEARTBEAT in state POWEROFF, which ends the links in order."""
        beat = self._playback.heartbeat(self.at_s)
        last = mavlink.MAVLink_heartbeat_message(
            beat.type, beat.autopilot, beat.base_mode, beat.custom_mode, mavlink.MAV_STATE_POWEROFF, 3
        )
        frame = self._link.encode(last)
        return [(peer, frame) for peer in self.peers]

    def _forget_silent(self, now_s: float) -> None:
        silent = {peer for peer, heard_s in self._heard_s.items() if now_s - heard_s > PEER_TIMEOUT_S}
        for peer in silent - self._connected:
            self.forget(peer)

    # -- messages of clients

    def receive(self, data: bytes, peer: Place, now_s: float) -> None:
        """Process a datagram; invalid bytes and messages for others are ignored."""
        decoder = self._decoders.get(peer) or Link(0, 0)
        for message in decoder.decode(data):
            if peer not in self._heard_s:
                if len(self._heard_s) >= MAX_PEERS:
                    return
                self._shows_state = True
                self._heartbeat_due_s = now_s
            self._heard_s[peer], self._decoders[peer] = now_s, decoder
            answer = ANSWERS.get(message.get_type())
            if answer is not None and (message.get_type() in _BROADCAST or is_for(message, self.address)):
                answer(self, message, peer)

    def _say(self, peer: Place, message: Message) -> None:
        self._outbox.append((peer, message))

    def _refuse(self, peer: Place) -> None:
        self.refused += 1
        self._say(peer, mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_WARNING, TEXT))

    def _on_command(self, message: Message, peer: Place) -> None:
        result, asks = mavlink.MAV_RESULT_DENIED, message.command == mavlink.MAV_CMD_REQUEST_MESSAGE
        if asks and self._send_requested(whole(message.param1, 0, _MAX_ID), peer):
            result = mavlink.MAV_RESULT_ACCEPTED
        origin = message.get_srcSystem(), message.get_srcComponent()
        self._say(peer, mavlink.MAVLink_command_ack_message(message.command, result, 255, 0, *origin))
        if message.command not in _QUIET:
            self._refuse(peer)

    def _send_requested(self, number: int, peer: Place) -> bool:
        """Send the newest message of an id; return False if there is none."""
        if number == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            found = self._playback.version()
        else:
            state = self._playback.state(self.at_s)
            found = next((message for message in state if message.get_msgId() == number), None)
        if found is not None:
            self._say(peer, found)
        return found is not None

    def _on_parameter_list(self, _: Message, peer: Place) -> None:
        others = (entry for entry in self._parameters if entry[0] != peer)  # a repeated request begins anew
        self._parameters = deque(others)
        self._parameters.extend((peer, message) for message in self._playback.parameters)

    def _on_parameter_read(self, message: Message, peer: Place) -> None:
        found = self._parameter(message)
        if found is not None:
            self._say(peer, found)

    def _on_parameter_set(self, message: Message, peer: Place) -> None:
        self._on_parameter_read(message, peer)
        self._refuse(peer)

    def _parameter(self, message: Message) -> Message | None:
        index = getattr(message, "param_index", -1)
        for found in self._playback.parameters:
            name = found.param_id if isinstance(found.param_id, str) else found.param_id.decode("ascii")
            if index == found.param_index or (index < 0 and name.rstrip("\0") == message.param_id):
                return found
        return None

    def _on_mission_list(self, message: Message, peer: Place) -> None:
        target = message.get_srcSystem(), message.get_srcComponent()
        count = len(self._playback.plan(message.mission_type, self.at_s))
        self._say(peer, mavlink.MAVLink_mission_count_message(*target, count, message.mission_type))

    def _on_mission_request(self, message: Message, peer: Place) -> None:
        target = message.get_srcSystem(), message.get_srcComponent()
        items = self._playback.plan(message.mission_type, self.at_s)
        if message.seq < len(items):
            self._say(peer, item_message(items[message.seq], target))
        else:
            wrong = mavlink.MAV_MISSION_INVALID_SEQUENCE
            self._say(peer, mavlink.MAVLink_mission_ack_message(*target, wrong, message.mission_type))

    def _on_mission_change(self, message: Message, peer: Place) -> None:
        target = message.get_srcSystem(), message.get_srcComponent()
        denied = mavlink.MAV_MISSION_DENIED
        self._say(peer, mavlink.MAVLink_mission_ack_message(*target, denied, message.mission_type))
        self._refuse(peer)

    def _on_log_list(self, _: Message, peer: Place) -> None:
        self._say(peer, mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))

    def _on_ftp(self, message: Message, peer: Place) -> None:
        request = read_packet(message)
        error = bytes([FtpError.FILE_NOT_FOUND])
        answer = Packet(next_sequence(request.sequence), 0, Opcode.NAK, 1, request.opcode, data=error)
        self._say(peer, ftp_message(sender(message), answer))

    def _on_timesync(self, message: Message, peer: Place) -> None:
        if message.tc1 == 0:
            self._say(peer, mavlink.MAVLink_timesync_message(round(self._now_s * 1e9), message.ts1))


_BROADCAST = ("TIMESYNC",)
"""Messages without a target."""
ANSWERS: dict[str, Callable[[ReplayVehicle, Message, Place], None]] = {
    "COMMAND_LONG": ReplayVehicle._on_command,
    "COMMAND_INT": ReplayVehicle._on_command,
    "PARAM_REQUEST_LIST": ReplayVehicle._on_parameter_list,
    "PARAM_REQUEST_READ": ReplayVehicle._on_parameter_read,
    "PARAM_SET": ReplayVehicle._on_parameter_set,
    "MISSION_REQUEST_LIST": ReplayVehicle._on_mission_list,
    "MISSION_REQUEST_INT": ReplayVehicle._on_mission_request,
    "MISSION_REQUEST": ReplayVehicle._on_mission_request,
    "MISSION_COUNT": ReplayVehicle._on_mission_change,
    "MISSION_CLEAR_ALL": ReplayVehicle._on_mission_change,
    "FILE_TRANSFER_PROTOCOL": ReplayVehicle._on_ftp,
    "LOG_REQUEST_LIST": ReplayVehicle._on_log_list,
    "TIMESYNC": ReplayVehicle._on_timesync,
}

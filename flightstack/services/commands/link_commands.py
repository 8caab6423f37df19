"""Commands of one link: its message intervals, single messages and log stream."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Message, is_for
from flightstack.services.commands.context import ACCEPTED, DENIED, REJECTED, UNSUPPORTED, Answer, Command
from flightstack.services.files.component_metadata import ComponentMetadata
from flightstack.services.logs.log_stream import LogStream
from flightstack.services.routing.peer import Peer
from flightstack.services.telemetry.telemetry import Telemetry

LINK_COMMANDS = frozenset(
    {
        mavlink.MAV_CMD_REQUEST_MESSAGE,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_GET_MESSAGE_INTERVAL,
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION,
        mavlink.MAV_CMD_GET_HOME_POSITION,
        mavlink.MAV_CMD_LOGGING_START,
        mavlink.MAV_CMD_LOGGING_STOP,
    }
)
DEPRECATED_REQUESTS: dict[int, int] = {
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION: mavlink.MAVLINK_MSG_ID_PROTOCOL_VERSION,
    mavlink.MAV_CMD_GET_HOME_POSITION: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
}
"""Deprecated commands that REQUEST_MESSAGE replaces, and the message that each requests."""
ULOG = 0.0
"""Format of LOGGING_START."""
HIGHEST_MESSAGE_ID = 0xFFFFFF


def _message_id(value: float) -> int:
    """Return ``value`` as a message id, or −1 if it is none."""
    return int(value) if math.isfinite(value) and 0.0 <= value <= HIGHEST_MESSAGE_ID else -1


class LinkCommands:
    """Executes the commands of a link, and the deprecated REQUEST_DATA_STREAM."""

    handles = frozenset({"REQUEST_DATA_STREAM"})

    def __init__(
        self,
        own: Address,
        telemetry: Telemetry,
        peer_at: Callable[[Hashable], Peer],
        log_stream: LogStream,
        metadata: ComponentMetadata,
    ) -> None:
        self._own = own
        self._log_stream = log_stream
        self._metadata = metadata
        self._telemetry = telemetry
        self._peer_at = peer_at

    def answer(self, peer: Peer, command: Command) -> Answer:
        """Execute one of ``LINK_COMMANDS`` for ``peer``."""
        number, argument = _message_id(command.params[0]), command.params[1]
        if command.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            done = peer.streams.set_interval(number, argument)
            return Answer(ACCEPTED) if done else Answer(DENIED, "no such message or interval")
        if command.command == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            return self._send_interval(peer, number)
        if command.command in (mavlink.MAV_CMD_LOGGING_START, mavlink.MAV_CMD_LOGGING_STOP):
            return self._stream_log(command)
        if command.command in DEPRECATED_REQUESTS:
            return self._send_message(peer, DEPRECATED_REQUESTS[command.command], 0.0)
        return self._send_message(peer, number, argument)

    def _send_message(self, peer: Peer, number: int, argument: float) -> Answer:
        if number == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            return self._send_interval(peer, _message_id(argument))
        if number == mavlink.MAVLINK_MSG_ID_COMPONENT_METADATA:
            peer.outbox.append(self._metadata.message(self._telemetry.boot_ms))
            return Answer(ACCEPTED)
        if number == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            peer.streams.add_standard_modes()
        if not self._telemetry.is_available(number):
            return Answer(
                DENIED
            )  # no text: ground stations routinely request messages of gimbals and cameras
        messages = self._telemetry.requested(number, argument)
        peer.outbox.extend(messages)
        return Answer(ACCEPTED if messages else DENIED)

    def _stream_log(self, command: Command) -> Answer:
        """LOGGING_START (format 0, ULog) streams the log of the current or next flight; LOGGING_STOP ends it."""
        if command.command == mavlink.MAV_CMD_LOGGING_STOP:
            self._log_stream.stop()
            return Answer(ACCEPTED)
        if command.params[0] != ULOG:
            return Answer(UNSUPPORTED)
        refusal = self._log_stream.start(command.peer, command.source)
        return Answer(ACCEPTED) if refusal is None else Answer(REJECTED, refusal)

    def _send_interval(self, peer: Peer, message_id: int) -> Answer:
        if not 0 <= message_id <= 0xFFFF:
            return Answer(DENIED, "that message has no place in MESSAGE_INTERVAL")
        interval_us = peer.streams.interval_us(message_id)
        peer.outbox.append(mavlink.MAVLink_message_interval_message(message_id, interval_us))
        return Answer(ACCEPTED)

    def receive(self, message: Message, peer: Hashable, now_s: float) -> None:
        """Take REQUEST_DATA_STREAM: set the rate of a message group, or stop it."""
        if is_for(message, self._own):
            rate_hz = float(message.req_message_rate) if message.start_stop else 0.0
            self._peer_at(peer).streams.set_group(message.req_stream_id, rate_hz)

    def poll(self, now_s: float) -> list[tuple[Hashable | None, Message]]:
        """Return nothing: answers go to the outbox of the peer."""
        return []

    def next_deadline(self) -> float | None:
        """Return None."""
        return None

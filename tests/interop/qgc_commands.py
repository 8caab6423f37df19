"""QGroundControl's commands: one at a time, judged by their acknowledgement, a few of them repeated."""

from __future__ import annotations

import time
from typing import Any

from flightstack.mavlink.dialect import mavlink
from tests.interop.qgc_link import AUTOPILOT, Station

ACK_TIMEOUT_S = 3.0
TRIES = 3
RETRIED = (
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_PREFLIGHT_STORAGE,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS,
)
"""Vehicle/MavCommandQueue.cc, _shouldRetry: a lost ARM must not come true six seconds later."""
MESSAGE_TIMEOUT_S = 1.0
ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED


class Commands:
    """Vehicle/MavCommandQueue.cc and Vehicle/RequestMessageCoordinator.cc."""

    def __init__(self, station: Station) -> None:
        self._station = station

    def long(self, command: int, *params: float) -> int:
        """Send a COMMAND_LONG and return its result: sendWorker, _sendFromList, handleCommandAck."""
        return self._send(command, lambda confirmation: self._long(command, confirmation, *params))[0]

    def integer(self, command: int, frame: int, first: tuple[float, ...], place: tuple[float, ...]) -> int:
        """Send a COMMAND_INT (sendCommandInt): four parameters, then degrees, degrees and metres."""
        latitude, longitude, altitude_m = place
        x, y = int(latitude * 1e7), int(longitude * 1e7)
        message = mavlink.MAVLink_command_int_message(
            self._station.system, AUTOPILOT, frame, command, 0, 0, *first, x, y, altitude_m
        )
        return self._send(command, lambda _: message)[0]

    def request(self, kind: str, *params: float) -> Any | int:
        """Ask for a message and return it, or the result that refused it: requestMessage, _cmdResultHandler.

        The message may come before or after the acknowledgement, but no later than a second after it.
        """
        result, messages = self.request_many(kind, *params)
        return messages[0] if result == ACCEPTED else result

    def request_many(self, kind: str, *params: float) -> tuple[int, list[Any]]:
        """Ask for a message of which several may come; return the result, and those that came by then.

        ``kind`` is the message's name, or its number for those that pymavlink does not know.
        """
        message_id = int(kind) if kind.isdigit() else getattr(mavlink, f"MAVLINK_MSG_ID_{kind}")
        command = mavlink.MAV_CMD_REQUEST_MESSAGE
        result, messages = self._send(
            command, lambda confirmation: self._long(command, confirmation, message_id, *params), kind
        )
        if result == ACCEPTED and not messages:
            message = self._station.wait(kind, within_s=MESSAGE_TIMEOUT_S)
            assert message is not None, f"{kind}: acknowledged, but it never came"
            messages.append(message)
        return result, messages

    def _long(self, command: int, confirmation: int, *params: float) -> Any:
        values = (*params, *[0.0] * (7 - len(params)))
        return mavlink.MAVLink_command_long_message(
            self._station.system, AUTOPILOT, command, confirmation, *values
        )

    def _send(self, command: int, make: Any, also: str = "") -> tuple[int, list[Any]]:
        """Send and wait for the result; return it and the messages of type ``also`` that came before."""
        before = []
        for attempt in range(TRIES if command in RETRIED else 1):
            self._station.send(make(attempt))
            end_s = time.monotonic() + ACK_TIMEOUT_S
            while (left_s := end_s - time.monotonic()) > 0.0:
                message = self._station.wait("COMMAND_ACK", also, within_s=left_s)
                if message is None:
                    break
                if message.get_type() == also:
                    before.append(message)
                elif message.command != command:
                    continue  # "ack not in list"
                elif message.result == mavlink.MAV_RESULT_IN_PROGRESS:
                    end_s = time.monotonic() + ACK_TIMEOUT_S
                else:
                    return int(message.result), before
        raise AssertionError(f"the vehicle did not respond to command {command}: {self._station.texts[-5:]}")

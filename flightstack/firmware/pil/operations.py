"""Operations on a target besides steps: set a number, request a message, command. Pure."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Protocol, TypeAlias

from flightstack.core.float32 import as_float32
from flightstack.firmware.pil.steps import PilReport
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import Frame
from flightstack.mavlink.link import Link, Message

TARGET_SYSTEM, TARGET_COMPONENT = 1, 1


Result: TypeAlias = PilReport | tuple[PilReport, ...] | Message | float | None


class Operation(Protocol):
    """Messages of an operation; the client handles timeouts."""

    @property
    def failure(self) -> str | None:
        """Reason of its failure, or None."""

    @property
    def result(self) -> Result:
        """Result, or None until then."""

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return the frames to send in an attempt; ``sequence`` is the first one's."""

    def take_message(self, message: Message) -> None:
        """Process a message of the target other than a report."""

    def silence(self, attempts: int) -> str:
        """Return why the operation fails after ``attempts`` unanswered attempts."""


class SetNumber:
    """Sets a number and waits for its confirmation."""

    def __init__(self, name: str, value: float) -> None:
        self.result: float | None = None
        self.failure: str | None = None
        self._name, self._value = name, as_float32(value)
        self._reported: float | None = None

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return a PARAM_SET."""
        message = mavlink.MAVLink_param_set_message(
            TARGET_SYSTEM, TARGET_COMPONENT, self._name.encode(), self._value, mavlink.MAV_PARAM_TYPE_REAL32
        )
        return [codec.encode(message)]

    def take_message(self, message: Message) -> None:
        """Process a PARAM_VALUE or PARAM_ERROR of the number; another value may be an old message."""
        kind = message.get_type()
        if kind not in ("PARAM_VALUE", "PARAM_ERROR") or message.param_id != self._name:
            return
        if kind == "PARAM_ERROR":
            what = "has no number" if message.error == 1 else "refuses"
            self.failure = f"{what} {self._name}={self._value:g}"
        elif _bits(message.param_value) == _bits(self._value):
            self.result = float(message.param_value)
        else:
            self._reported = float(message.param_value)

    def silence(self, attempts: int) -> str:
        """Return why the number could not be set."""
        if self._reported is not None:
            return f"keeps {self._name}={self._reported:g} instead of {self._value:g}"
        return f"did not confirm {self._name}, sent {attempts} times"


class Request:
    """Requests a message."""

    def __init__(self, name: str) -> None:
        self.result: Message | None = None
        self.failure: str | None = None
        self._name = name
        self._id: int = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return MAV_CMD_REQUEST_MESSAGE."""
        command = mavlink.MAV_CMD_REQUEST_MESSAGE
        message = mavlink.MAVLink_command_long_message(
            TARGET_SYSTEM, TARGET_COMPONENT, command, 0, self._id, 0, 0, 0, 0, 0, 0
        )
        return [codec.encode(message)]

    def take_message(self, message: Message) -> None:
        """Process the message, or the refusal of the request."""
        if message.get_type() == self._name:
            self.result = message
        elif _is_refusal(message):
            self.failure = f"does not support {self._name}: it runs other firmware"

    def silence(self, attempts: int) -> str:
        """Return why the request fails."""
        return f"did not answer {attempts} requests for {self._name}: check its firmware and the baud rate"


class Command:
    """Sends a command and waits for its acknowledgement."""

    def __init__(self, number: int, refusal: str, values: Sequence[float]) -> None:
        """``refusal`` is the failure of a refused command, as a clause about the target."""
        self.result: Message | None = None
        self.failure: str | None = None
        self._number, self._refusal, self._values = number, refusal, [*values, *[0.0] * 7][:7]

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return the COMMAND_LONG."""
        message = mavlink.MAVLink_command_long_message(
            TARGET_SYSTEM, TARGET_COMPONENT, self._number, 0, *self._values
        )
        return [codec.encode(message)]

    def take_message(self, message: Message) -> None:
        """Process the acknowledgement; after a temporary rejection the command is resent."""
        if message.get_type() != "COMMAND_ACK" or message.command != self._number:
            return
        if message.result == mavlink.MAV_RESULT_ACCEPTED:
            self.result = message
        elif message.result not in _NOT_REFUSED:
            self.failure = self._refusal

    def silence(self, attempts: int) -> str:
        """Return why the command fails."""
        return f"did not acknowledge command {self._number}, sent {attempts} times"


_NOT_REFUSED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_IN_PROGRESS,
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
)


def _is_refusal(message: Message) -> bool:
    """Return True for a refusal of the request other than a temporary one."""
    if message.get_type() != "COMMAND_ACK" or message.command != mavlink.MAV_CMD_REQUEST_MESSAGE:
        return False
    return message.result not in _NOT_REFUSED


def message_of(codec: Link, frame: Frame) -> Message | None:
    """Decode a verified frame; return None for an unknown message."""
    return next(codec.decode(frame.data), None) if frame.known else None


def _bits(value: float) -> bytes:
    return struct.pack("<f", value)

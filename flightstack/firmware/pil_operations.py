"""Operations on a target: run a step, set a number, request a message. Pure.

Steps and reports are packed and unpacked by ``struct`` instead of pymavlink for speed. A test checks that the bytes
equal pymavlink's.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from flightstack.core.float32 import as_float32
from flightstack.mavlink.dialect import LAYOUT_BY_NAME, mavlink
from flightstack.mavlink.frames import HEADER_V1, HEADER_V2, MAGIC_V1, Frame, pack_frame
from flightstack.mavlink.link import Link, Message

TARGET_SYSTEM, TARGET_COMPONENT = 1, 1
OWN_SYSTEM, OWN_COMPONENT = 1, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER

REPEATED, OUT_OF_ORDER, OVERRUN, BAD_INPUT = 1 << 16, 1 << 17, 1 << 18, 1 << 19
"""Bits of FS_PIL_REPORT.status above those of the loops."""

_STEP, _REPORT = LAYOUT_BY_NAME["FS_PIL_STEP"], LAYOUT_BY_NAME["FS_PIL_REPORT"]
REPORT_ID = _REPORT.message_id
_STEP_PAYLOAD, _REPORT_PAYLOAD = struct.Struct(_STEP.format), struct.Struct(_REPORT.format)


class PilReport(NamedTuple):
    """One FS_PIL_REPORT."""

    step: int
    status: int
    cost: tuple[int, ...]
    """Cost of outer loop, inner loop, mixer and whole step, in the target's unit."""
    outputs: tuple[float, ...]
    """Attitude target (5), reference (10), wrench (4), wrench achieved (4), rotor commands (8)."""

    @classmethod
    def of(cls, frame: bytes) -> PilReport:
        """Read a complete, verified frame."""
        header = HEADER_V1 if frame[0] == MAGIC_V1 else HEADER_V2
        payload = frame[header : header + frame[1]][: _REPORT_PAYLOAD.size]
        values = _REPORT_PAYLOAD.unpack(payload.ljust(_REPORT_PAYLOAD.size, b"\0"))
        return cls(values[0], values[1], values[2:6], values[6:])

    @property
    def is_repeated(self) -> bool:
        """True for a repeated report of a step computed before."""
        return bool(self.status & REPEATED)

    @property
    def is_out_of_order(self) -> bool:
        """True if nothing was computed because the target expects ``step``."""
        return bool(self.status & OUT_OF_ORDER)


class Operation(Protocol):
    """Messages of an operation; the client handles timeouts."""

    failure: str | None

    @property
    def result(self) -> PilReport | Message | float | None:
        """Result, or None until then."""

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return the frame to send in an attempt."""

    def take_message(self, message: Message) -> None:
        """Process a message of the target other than a report."""

    def silence(self, attempts: int) -> str:
        """Return why the operation fails after ``attempts`` unanswered attempts."""


class Step:
    """One step of the loops."""

    def __init__(self, number: int, flags: int, numbers: Sequence[float]) -> None:
        self.result: PilReport | None = None
        self.failure: str | None = None
        self.is_refused = False
        self._number = number
        self._expected: int | None = None
        try:
            payload = _STEP_PAYLOAD.pack(number, flags, *numbers)
        except OverflowError:  # beyond float32
            payload = _STEP_PAYLOAD.pack(number, flags, *map(as_float32, numbers))
        self._payload = payload.rstrip(b"\0") or b"\0"

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return the frame of the step."""
        return pack_frame(
            _STEP.message_id, self._payload, _STEP.crc_extra, sequence, OWN_SYSTEM, OWN_COMPONENT
        )

    def take_report(self, report: PilReport) -> bool:
        """Process a report; return True if it is of this step. Set ``is_refused`` if another step is expected."""
        if report.is_out_of_order:
            ahead = (report.step - self._number) & 0xFFFF_FFFF
            if ahead > 1:  # else an old or duplicate step reached the target
                self._expected, self.is_refused = report.step, True
            return False
        if report.step != self._number:
            return False
        if report.status & BAD_INPUT:
            self.failure = f"stopped its rotors at step {self._number} because of invalid input"
            self.result = report  # kept for the record
            return True
        self.result = report
        return True

    def take_message(self, message: Message) -> None:
        """Ignore the message."""

    def silence(self, attempts: int) -> str:
        """Return why the step fails."""
        if self._expected is not None:
            return f"expects step {self._expected}, not {self._number}: it may have been restarted"
        return f"did not answer step {self._number}, sent {attempts} times"


class SetNumber:
    """Sets a number and waits for its confirmation."""

    def __init__(self, name: str, value: float) -> None:
        self.result: float | None = None
        self.failure: str | None = None
        self._name, self._value = name, as_float32(value)
        self._reported: float | None = None

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return a PARAM_SET."""
        return codec.encode(
            mavlink.MAVLink_param_set_message(
                TARGET_SYSTEM,
                TARGET_COMPONENT,
                self._name.encode(),
                self._value,
                mavlink.MAV_PARAM_TYPE_REAL32,
            )
        )

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

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return MAV_CMD_REQUEST_MESSAGE."""
        command = mavlink.MAV_CMD_REQUEST_MESSAGE
        return codec.encode(
            mavlink.MAVLink_command_long_message(
                TARGET_SYSTEM, TARGET_COMPONENT, command, 0, self._id, 0, 0, 0, 0, 0, 0
            )
        )

    def take_message(self, message: Message) -> None:
        """Process the message, or the refusal of the request."""
        if message.get_type() == self._name:
            self.result = message
        elif _is_refusal(message):
            self.failure = f"does not support {self._name}: it runs other firmware"

    def silence(self, attempts: int) -> str:
        """Return why the request fails."""
        return f"did not answer {attempts} requests for {self._name}: check its firmware and the baud rate"


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

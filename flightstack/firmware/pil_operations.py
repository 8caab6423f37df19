"""What the link to a target can be busy with: a step, a number, a message. Pure.

Steps and reports go by the thousand: they are packed and read by ``struct``, not as pymavlink's objects. A test holds
the octets equal.
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
    """Outer loop, inner loop, mixer, whole step, in the unit that the target names."""
    outputs: tuple[float, ...]
    """Attitude target (5), reference (10), wrench (4), wrench achieved (4), rotor commands (8)."""

    @classmethod
    def of(cls, frame: bytes) -> PilReport:
        """Read a whole frame whose checksum is right."""
        header = HEADER_V1 if frame[0] == MAGIC_V1 else HEADER_V2
        payload = frame[header : header + frame[1]][: _REPORT_PAYLOAD.size]
        values = _REPORT_PAYLOAD.unpack(payload.ljust(_REPORT_PAYLOAD.size, b"\0"))
        return cls(values[0], values[1], values[2:6], values[6:])

    @property
    def is_repeated(self) -> bool:
        """Whether the step was computed before and is only answered again."""
        return bool(self.status & REPEATED)

    @property
    def is_out_of_order(self) -> bool:
        """Whether nothing was computed, because ``step`` was expected."""
        return bool(self.status & OUT_OF_ORDER)


class Operation(Protocol):
    """What an operation sends and takes; the client does the waiting."""

    failure: str | None

    @property
    def result(self) -> PilReport | Message | float | None:
        """What the operation brought; None while it is under way."""

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return what to send; each call is an attempt."""

    def take_message(self, message: Message) -> None:
        """Take a message of the target's other than a report."""

    def silence(self, attempts: int) -> str:
        """Return why the operation fails when the target has not answered ``attempts`` times."""


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
        except OverflowError:  # beyond float32, which is infinite for the target
            payload = _STEP_PAYLOAD.pack(number, flags, *map(as_float32, numbers))
        self._payload = payload.rstrip(b"\0") or b"\0"

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return the frame of the step."""
        return pack_frame(
            _STEP.message_id, self._payload, _STEP.crc_extra, sequence, OWN_SYSTEM, OWN_COMPONENT
        )

    def take_report(self, report: PilReport) -> bool:
        """Take a report; return whether it is this step's. ``is_refused``: it shows that the target is elsewhere."""
        if report.is_out_of_order:
            ahead = (report.step - self._number) & 0xFFFF_FFFF
            if ahead > 1:  # else the target is where we are: an old or doubled step came to it
                self._expected, self.is_refused = report.step, True
            return False
        if report.step != self._number:
            return False
        if report.status & BAD_INPUT:
            self.failure = f"stopped its rotors at step {self._number}: it was given bad input"
            self.result = report  # what it says of the step is kept
            return True
        self.result = report
        return True

    def take_message(self, message: Message) -> None:
        """Take a message of the target's; a step has no use for any."""

    def silence(self, attempts: int) -> str:
        """Return why the step fails."""
        if self._expected is not None:
            return f"expects step {self._expected}, not {self._number}: it has lost its place (was it restarted?)"
        return f"did not answer step {self._number}, sent {attempts} times"


class SetNumber:
    """Sets one number and waits until it is read back."""

    def __init__(self, name: str, value: float) -> None:
        self.result: float | None = None
        self.failure: str | None = None
        self._name, self._value = name, as_float32(value)
        self._told: float | None = None

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
        """Take a PARAM_VALUE or PARAM_ERROR of the number; a value that is another may be an old message."""
        kind = message.get_type()
        if kind not in ("PARAM_VALUE", "PARAM_ERROR") or message.param_id != self._name:
            return
        if kind == "PARAM_ERROR":
            what = "has no number" if message.error == 1 else "refuses"
            self.failure = f"{what} {self._name}={self._value:g}"
        elif _bits(message.param_value) == _bits(self._value):
            self.result = float(message.param_value)
        else:
            self._told = float(message.param_value)

    def silence(self, attempts: int) -> str:
        """Return why the number could not be set."""
        if self._told is not None:
            return f"keeps {self._name}={self._told:g} instead of {self._value:g}"
        return f"did not confirm {self._name}, sent {attempts} times"


class Request:
    """Asks for a message."""

    def __init__(self, name: str) -> None:
        self.result: Message | None = None
        self.failure: str | None = None
        self._name = name
        self._id: int = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")

    def frame(self, codec: Link, sequence: int) -> bytes:
        """Return the command that asks."""
        command = mavlink.MAV_CMD_REQUEST_MESSAGE
        return codec.encode(
            mavlink.MAVLink_command_long_message(
                TARGET_SYSTEM, TARGET_COMPONENT, command, 0, self._id, 0, 0, 0, 0, 0, 0
            )
        )

    def take_message(self, message: Message) -> None:
        """Take the message, or the answer that there is none."""
        if message.get_type() == self._name:
            self.result = message
        elif _is_refusal(message):
            self.failure = f"does not know {self._name}: other firmware runs there"

    def silence(self, attempts: int) -> str:
        """Return why there is no message."""
        asked = f"did not answer when asked for {self._name}, {attempts} times"
        return f"{asked}: is the firmware on it, and the baud rate right?"


_NOT_REFUSED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_IN_PROGRESS,
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
)


def _is_refusal(message: Message) -> bool:
    """Tell whether a message says that the one asked for does not exist; who has no room for it is asked again."""
    if message.get_type() != "COMMAND_ACK" or message.command != mavlink.MAV_CMD_REQUEST_MESSAGE:
        return False
    return message.result not in _NOT_REFUSED


def message_of(codec: Link, frame: Frame) -> Message | None:
    """Decode a frame whose checksum is right; None for what the dialect lacks."""
    return next(codec.decode(frame.data), None) if frame.known else None


def _bits(value: float) -> bytes:
    return struct.pack("<f", value)

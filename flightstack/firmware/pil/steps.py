"""Steps of the loops on a target: their frames, and the reports that answer them. Pure.

They are packed and unpacked by ``struct`` instead of pymavlink for speed. A test checks that the bytes equal
pymavlink's.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, MAX_ROTORS, SETPOINT_SIZE, STATE_SIZE, LoopFlags
from flightstack.core.float32 import as_float32
from flightstack.mavlink.dialect import LAYOUT_BY_NAME, mavlink
from flightstack.mavlink.frames import HEADER_V1, HEADER_V2, MAGIC_V1, pack_frame
from flightstack.mavlink.link import Link, Message

OWN_SYSTEM, OWN_COMPONENT = 1, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER

REPEATED, OUT_OF_ORDER, OVERRUN, BAD_INPUT = 1 << 16, 1 << 17, 1 << 18, 1 << 19
"""Bits of FS_PIL_REPORT.status above those of the loops."""
WANT_REFERENCE = 8
"""Bit of FS_PIL_TICK.flags beside ``LoopFlags``."""

_STEP, _REPORT = LAYOUT_BY_NAME["FS_PIL_STEP"], LAYOUT_BY_NAME["FS_PIL_REPORT"]
_TICK, _OUTPUT = LAYOUT_BY_NAME["FS_PIL_TICK"], LAYOUT_BY_NAME["FS_PIL_OUTPUT"]
_FORMATS = {layout.message_id: struct.Struct(layout.format) for layout in (_STEP, _REPORT, _TICK, _OUTPUT)}
REPORT_IDS = (_REPORT.message_id, _OUTPUT.message_id)

REFERENCE_AT, WRENCH_AT, ROTORS_AT, OUTPUTS = 5, 15, 23, 23 + MAX_ROTORS
"""Places in ``PilReport.outputs``, which begin with the attitude target."""
REFERENCE_ATTITUDE_SIZE = 4
_NOTHING = (0.0,) * SETPOINT_SIZE


class StepInput(NamedTuple):
    """Flags and numbers of a step."""

    flags: int
    """``LoopFlags``."""
    numbers: Sequence[float]
    """State (13), then setpoint (11), which begins with the attitude target if the flags have SET_TARGET."""


class PilReport(NamedTuple):
    """One FS_PIL_REPORT or FS_PIL_OUTPUT."""

    step: int
    status: int
    cost: tuple[int, ...]
    """Cost of outer loop, inner loop, mixer and whole step, in the target's unit."""
    outputs: tuple[float, ...]
    """Attitude target (5), reference (10), wrench (4), wrench achieved (4), rotor commands (8)."""

    @classmethod
    def of(cls, frame: bytes, message_id: int = _REPORT.message_id) -> PilReport:
        """Read a complete, verified frame. The outputs of an FS_PIL_OUTPUT are its values as they came."""
        header = HEADER_V1 if frame[0] == MAGIC_V1 else HEADER_V2
        layout = _FORMATS[message_id]
        payload = frame[header : header + frame[1]][: layout.size]
        values = layout.unpack(payload.ljust(layout.size, b"\0"))
        if message_id == _OUTPUT.message_id:
            return cls(values[0], values[1], (0, 0, 0, values[2]), values[3:])
        return cls(values[0], values[1], values[2:6], values[6:])

    @property
    def is_repeated(self) -> bool:
        """True for a repeated report of a step computed before."""
        return bool(self.status & REPEATED)

    @property
    def is_out_of_order(self) -> bool:
        """True if nothing was computed because the target expects ``step``."""
        return bool(self.status & OUT_OF_ORDER)


class Step:
    """One step of the loops, in full or, for a slow line, as a tick with a short answer."""

    def __init__(self, number: int, step: StepInput, short_rotors: int = 0) -> None:
        """``short_rotors`` is the vehicle's number of rotors for a short step, 0 for a full one."""
        self.number = number
        self.result: PilReport | None = None
        self.failure: str | None = None
        self.is_refused = False
        self.attempts = 0
        """Number of times that it was sent."""
        self._flags, self._rotors = step.flags, short_rotors
        self._expected: int | None = None
        self._layout = _TICK if short_rotors else _STEP
        values = _short_values(step) if short_rotors else _full_values(step)
        pack = _FORMATS[self._layout.message_id].pack
        try:
            payload = pack(number, step.flags, *values)
        except OverflowError:  # beyond float32
            payload = pack(number, step.flags, *map(as_float32, values))
        self._payload = payload.rstrip(b"\0") or b"\0"

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return the frame of the step."""
        self.attempts += 1
        layout = self._layout
        return [
            pack_frame(
                layout.message_id,
                self._payload,
                layout.crc_extra,
                sequence & 255,
                OWN_SYSTEM,
                OWN_COMPONENT,
            )
        ]

    def take_report(self, report: PilReport) -> bool:
        """Process a report; return True if it is of this step. Set ``is_refused`` if another step is expected."""
        if report.is_out_of_order:
            ahead = (report.step - self.number) & 0xFFFF_FFFF
            if ahead > 1:  # else an old or duplicate step reached the target
                self._expected, self.is_refused = report.step, True
            return False
        if report.step != self.number:
            return False
        if report.status & BAD_INPUT:
            self.failure = f"stopped its rotors at step {self.number} because of invalid input"
        self.result = self._expanded(report) if self._rotors else report
        return True

    def _expanded(self, report: PilReport) -> PilReport:
        """Return a short report in the form of a full one, with NaN for the values that it lacks."""
        values, at = report.outputs, self._rotors
        outputs = [math.nan] * ROTORS_AT + [0.0] * MAX_ROTORS
        outputs[ROTORS_AT : ROTORS_AT + at] = values[:at]
        if self._flags & LoopFlags.OUTER_DUE:
            outputs[:ATTITUDE_TARGET_SIZE] = values[at : at + ATTITUDE_TARGET_SIZE]
            at += ATTITUDE_TARGET_SIZE
        if self._flags & WANT_REFERENCE:
            end = REFERENCE_AT + REFERENCE_ATTITUDE_SIZE
            outputs[REFERENCE_AT:end] = values[at : at + REFERENCE_ATTITUDE_SIZE]
        return report._replace(outputs=tuple(outputs))

    def take_message(self, message: Message) -> None:
        """Ignore the message."""

    def silence(self, attempts: int) -> str:
        """Return why the step fails."""
        if self._expected is not None:
            return f"expects step {self._expected}, not {self.number}: it may have been restarted"
        return f"did not answer step {self.number}, sent {attempts} times"


class Window:
    """Several steps in one flight of bytes: the latency of the link is paid once."""

    def __init__(self, first: int, steps: Sequence[StepInput]) -> None:
        self.steps = [Step((first + index) & 0xFFFF_FFFF, step) for index, step in enumerate(steps)]
        self.is_refused = False

    @property
    def _waiting(self) -> list[Step]:
        return [step for step in self.steps if step.result is None]

    @property
    def failure(self) -> str | None:
        """Reason of a failed step, or None."""
        return next((step.failure for step in self.steps if step.failure is not None), None)

    @property
    def result(self) -> tuple[PilReport, ...] | None:
        """The reports in the order of the steps, or None until all are there."""
        reports = tuple(step.result for step in self.steps if step.result is not None)
        return reports if len(reports) == len(self.steps) else None

    def frames(self, codec: Link, sequence: int) -> list[bytes]:
        """Return the frames of the steps without a report."""
        waiting = enumerate(self._waiting)
        return [frame for index, step in waiting for frame in step.frames(codec, sequence + index)]

    def take_report(self, report: PilReport) -> bool:
        """Process a report; return True if it is of one of the steps.

        After a lost step the target refuses those behind it. They are sent again after the timeout, all together: a
        refusal may be of a step that was sent twice.
        """
        waiting = self._waiting
        if report.is_out_of_order:
            waiting[0].take_report(report)
            return False
        return any(step.number == report.step and step.take_report(report) for step in waiting)

    def take_message(self, message: Message) -> None:
        """Ignore the message."""

    def silence(self, attempts: int) -> str:
        """Return why the steps fail."""
        return self._waiting[0].silence(attempts)


def _full_values(step: StepInput) -> Sequence[float]:
    """Return state and setpoint; zeros, which are not sent, for a setpoint that no loop reads."""
    if step.flags & (LoopFlags.OUTER_DUE | LoopFlags.SET_TARGET):
        return step.numbers
    return (*step.numbers[:STATE_SIZE], *_NOTHING)


def _short_values(step: StepInput) -> Sequence[float]:
    """Return attitude and rates, then what the flags demand, then zeros, which are not sent."""
    numbers = step.numbers
    inner, outer, setpoint = numbers[6:STATE_SIZE], numbers[:6], numbers[STATE_SIZE:]
    if step.flags & LoopFlags.SET_TARGET:
        values = (*inner, *setpoint[:ATTITUDE_TARGET_SIZE])
    elif step.flags & LoopFlags.OUTER_DUE:
        values = (*inner, *outer, *setpoint)
    else:
        values = tuple(inner)
    return values + (0.0,) * (STATE_SIZE + SETPOINT_SIZE - len(values))

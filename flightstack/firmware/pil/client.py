"""Client of loops that run on a target, without I/O.

``start_…`` begins an operation, ``poll`` returns bytes to send, ``receive`` processes received bytes, and ``result`` or
``failure`` is the outcome. One operation runs at a time: a request, a step, or a window of steps. A step is resent
until its report arrives; the target computes it once and repeats the report: no step is skipped or computed twice.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from flightstack.firmware.pil.operations import Command, Operation, Request, Result, SetNumber, message_of
from flightstack.firmware.pil.steps import (
    OWN_COMPONENT,
    OWN_SYSTEM,
    REPORT_IDS,
    PilReport,
    Step,
    StepInput,
    Window,
)
from flightstack.mavlink.frames import Frame, FrameReader
from flightstack.mavlink.link import Link, Message

__all__ = ["PilClient", "PilCounters", "PilReport", "PilTiming"]

MOST_TEXTS = 50


class PilTiming(NamedTuple):
    """Timeouts of the protocol [s of the driving clock]."""

    timeout_s: float = 0.25
    """Timeout before an operation is resent."""
    attempts: int = 20
    """Number of attempts before the target counts as lost."""
    step_s: float = 0.0
    """Additional timeout for each further step of a window: the time of an exchange on the line."""


DEFAULT_TIMING = PilTiming()


@dataclass
class PilCounters:
    """Counters of the link."""

    operations: int = 0
    answers: int = 0
    resent: int = 0
    late: int = 0
    """Duplicate or late reports, of another step than the current one."""
    repeated: int = 0
    """Reports repeated by the target because the first one was lost or late."""
    out_of_order: int = 0
    frames: int = 0
    bad: int = 0
    """Runs of bytes that are no frame."""
    octets_sent: int = 0
    octets_received: int = 0


class PilClient:
    """Runs steps, sets numbers and requests messages on one target."""

    def __init__(self, timing: PilTiming = DEFAULT_TIMING) -> None:
        self.timing = timing
        self.listener: Callable[[Frame, float], bool] | None = None
        """Takes the frames of a stream beside the operations: True for a frame that it has processed."""
        self._codec = Link(OWN_SYSTEM, OWN_COMPONENT)
        self._reader = FrameReader()
        self._sequence = 0
        self._operation: Operation | None = None
        self._deadline_s: float | None = None
        self._attempts = 0
        self._step = -1
        self.counters = PilCounters()
        self.texts: deque[tuple[int, str]] = deque(maxlen=MOST_TEXTS)
        """Severity and text of the newest status texts of the target."""
        self.failure: str | None = None
        """Reason of the failed operation, as a clause about the target, or None."""

    def start_step(self, flags: int, numbers: Sequence[float], short_rotors: int = 0) -> None:
        """Run the next step; ``numbers`` (24,) are the state with the setpoint or attitude target.

        ``short_rotors`` is the vehicle's number of rotors for a short step and report, 0 for full ones.
        """
        self._step = (self._step + 1) & 0xFFFF_FFFF
        self.start(Step(self._step, StepInput(flags, numbers), short_rotors))

    def start_window(self, steps: Sequence[StepInput]) -> None:
        """Run the next steps, sent together; their number must not exceed the target's FS_PIL_IDENTITY.window."""
        first = (self._step + 1) & 0xFFFF_FFFF
        self._step = (self._step + len(steps)) & 0xFFFF_FFFF
        self.start(Window(first, steps))

    def start_set(self, name: str, value: float) -> None:
        """Set a number of the target; its float32 value must be confirmed bit by bit."""
        self.start(SetNumber(name, value))

    def start_request(self, name: str) -> None:
        """Request the message of this name."""
        self.start(Request(name))

    def start_command(self, number: int, refusal: str, *values: float) -> None:
        """Send a command; ``refusal`` is the failure if it is refused."""
        self.start(Command(number, refusal, values))

    @property
    def result(self) -> Result:
        """Result of the operation: a report, those of a window, the confirmed number or a message; None until then."""
        return None if self._operation is None else self._operation.result

    @property
    def steps(self) -> Sequence[Step]:
        """Steps of the current operation."""
        operation = self._operation
        if isinstance(operation, Window):
            return operation.steps
        return [operation] if isinstance(operation, Step) else []

    @property
    def step(self) -> int:
        """Number of the newest step."""
        return self._step

    def receive(self, data: bytes, now_s: float) -> None:
        """Process received bytes; count messages that do not belong to the current operation."""
        counters, reader = self.counters, self._reader
        counters.octets_received += len(data)
        faults = reader.faults
        frames = reader.feed(data)
        counters.bad += reader.faults - faults
        for frame in frames:
            counters.frames += 1
            if self.listener is not None and self.listener(frame, now_s):
                continue
            if frame.message_id in REPORT_IDS:
                self._take_report(PilReport.of(frame.data, frame.message_id))
            elif (message := message_of(self._codec, frame)) is not None:
                self._take_message(message)
            self._settle()

    def _take_message(self, message: Message) -> None:
        if message.get_type() == "STATUSTEXT":
            self.texts.append((message.severity, message.text))
        if self._is_active and self._operation is not None:
            self._operation.take_message(message)

    def _take_report(self, report: PilReport) -> None:
        counters, operation = self.counters, self._operation
        counters.repeated += report.is_repeated
        counters.out_of_order += report.is_out_of_order
        if not self._is_active or not isinstance(operation, Step | Window):
            counters.late += 1
        elif operation.take_report(report):
            self._attempts = 1  # the link works: a window may need several attempts
        else:
            counters.late += not report.is_out_of_order
            if operation.is_refused:  # resend at once
                operation.is_refused = False
                self._deadline_s = -math.inf

    def _settle(self) -> None:
        operation = self._operation
        if operation is None or self._deadline_s is None:
            return
        if operation.failure is not None:
            self.failure, self._deadline_s = operation.failure, None
        elif operation.result is not None:
            self.counters.answers += 1
            self._deadline_s = None

    def poll(self, now_s: float) -> bytes:
        """Return the bytes to send now."""
        operation = self._operation
        if operation is None or self._deadline_s is None or now_s < self._deadline_s:
            return b""
        if self._attempts == self.timing.attempts:
            self.failure, self._deadline_s = operation.silence(self._attempts), None
            return b""
        if self._attempts:
            self.counters.resent += 1
            self._drop_partial()
        self._attempts += 1
        frames = operation.frames(self._codec, self._sequence)
        self._deadline_s = now_s + self.timing.timeout_s + (len(frames) - 1) * self.timing.step_s
        self._sequence = (self._sequence + len(frames)) & 255
        data = b"".join(frames)
        self.counters.octets_sent += len(data)
        return data

    def _drop_partial(self) -> None:
        """Drop an incomplete frame after a timeout, or it would absorb the next one."""
        if self._reader.has_partial and self.listener is None:  # the next frame of a stream completes it
            self.counters.bad += 1
            self._reader = FrameReader()

    def next_deadline(self) -> float | None:
        """Return when to poll next without received data; -inf for immediately, None for never."""
        return self._deadline_s

    @property
    def _is_active(self) -> bool:
        return self._deadline_s is not None and self._attempts > 0

    def start(self, operation: Operation) -> None:
        """Run an operation."""
        self.counters.operations += 1
        self._operation = operation
        self.failure = None
        self._deadline_s = -math.inf
        self._attempts = 0

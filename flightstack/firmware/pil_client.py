"""The flight stack's side of the link to loops that run on a target, without I/O.

``start_…`` begins an operation, ``poll`` returns the octets to send, ``receive`` takes those that came, and
``result`` or ``failure`` says how it ended. One operation at a time. A step is sent again until its own report comes:
the target computes it once and repeats the report, so that nothing is skipped and nothing runs twice.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from flightstack.firmware.pil_operations import (
    OWN_COMPONENT,
    OWN_SYSTEM,
    REPORT_ID,
    Operation,
    PilReport,
    Request,
    SetNumber,
    Step,
    message_of,
)
from flightstack.mavlink.frames import FrameReader
from flightstack.mavlink.link import Link, Message

__all__ = ["PilClient", "PilCounters", "PilReport", "PilTiming"]

MOST_TEXTS = 50


class PilTiming(NamedTuple):
    """Waits of the protocol [s of whatever clock drives it]."""

    timeout_s: float = 0.25
    """Before an operation is sent again."""
    attempts: int = 20
    """Times that it is sent before the target counts as lost."""


DEFAULT_TIMING = PilTiming()


@dataclass
class PilCounters:
    """What happened on the link so far."""

    operations: int = 0
    answers: int = 0
    resent: int = 0
    late: int = 0
    """Reports of another step than the one under way: doubled, or too late."""
    repeated: int = 0
    """Reports that the target sent again: it had computed the step, and its first report was lost or late."""
    out_of_order: int = 0
    frames: int = 0
    bad: int = 0
    """Stretches of octets that made no frame."""
    octets_sent: int = 0
    octets_received: int = 0


class PilClient:
    """Runs steps, sets numbers and asks for messages, on one target."""

    def __init__(self, timing: PilTiming = DEFAULT_TIMING) -> None:
        self.timing = timing
        self._codec = Link(OWN_SYSTEM, OWN_COMPONENT)
        self._reader = FrameReader()
        self._sequence = 0
        self._operation: Operation | None = None
        self._deadline_s: float | None = None
        self._attempts = 0
        self._step = -1
        self.counters = PilCounters()
        self.texts: deque[tuple[int, str]] = deque(maxlen=MOST_TEXTS)
        """Severity and text of the newest texts of the target."""
        self.failure: str | None = None
        """Why the operation failed, as a clause about the target; None while it has not."""

    def start_step(self, flags: int, numbers: Sequence[float]) -> None:
        """Run the next step; ``numbers`` (24,) are the state and the setpoint, or the state and a given target."""
        self._step = (self._step + 1) & 0xFFFF_FFFF
        self._start(Step(self._step, flags, numbers))

    def start_set(self, name: str, value: float) -> None:
        """Set a number of the target's and see it confirmed, bit for bit as float32."""
        self._start(SetNumber(name, value))

    def start_request(self, name: str) -> None:
        """Ask for the message of this name."""
        self._start(Request(name))

    @property
    def result(self) -> PilReport | Message | float | None:
        """What the operation brought: a report, a number as read back, a message; None while it is under way."""
        return None if self._operation is None else self._operation.result

    @property
    def attempts(self) -> int:
        """How often the operation was sent."""
        return self._attempts

    @property
    def step(self) -> int:
        """Number of the newest step."""
        return self._step

    def receive(self, data: bytes, now_s: float) -> None:
        """Take octets from the target; what is not for the operation under way is counted."""
        counters, reader = self.counters, self._reader
        counters.octets_received += len(data)
        faults = reader.faults
        frames = reader.feed(data)
        counters.bad += reader.faults - faults
        for frame in frames:
            counters.frames += 1
            if frame.message_id == REPORT_ID:
                self._take_report(PilReport.of(frame.data))
            elif (message := message_of(self._codec, frame)) is not None:
                self._take_message(message)
            self._settle()

    def _take_message(self, message: Message) -> None:
        if message.get_type() == "STATUSTEXT":
            self.texts.append((message.severity, message.text))
        if self._is_under_way and self._operation is not None:
            self._operation.take_message(message)

    def _take_report(self, report: PilReport) -> None:
        counters, operation = self.counters, self._operation
        counters.repeated += report.is_repeated
        counters.out_of_order += report.is_out_of_order
        if not self._is_under_way or not isinstance(operation, Step):
            counters.late += 1
        elif not operation.take_report(report):
            counters.late += not report.is_out_of_order
            if operation.is_refused:  # to wait would change nothing
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
        """Return the octets to send now."""
        operation = self._operation
        if operation is None or self._deadline_s is None or now_s < self._deadline_s:
            return b""
        if self._attempts == self.timing.attempts:
            self.failure, self._deadline_s = operation.silence(self._attempts), None
            return b""
        if self._attempts:
            self.counters.resent += 1
            self._forget_partial()
        self._attempts += 1
        self._deadline_s = now_s + self.timing.timeout_s
        data = operation.frame(self._codec, self._sequence)
        self._sequence = (self._sequence + 1) & 255
        self.counters.octets_sent += len(data)
        return data

    def _forget_partial(self) -> None:
        """After a silence, the rest of a frame does not come: it must not swallow the next one."""
        if self._reader.has_partial:
            self.counters.bad += 1
            self._reader = FrameReader()

    def next_deadline(self) -> float | None:
        """Return when to poll next if nothing arrives before; -inf for at once, None for never."""
        return self._deadline_s

    @property
    def _is_under_way(self) -> bool:
        return self._deadline_s is not None and self._attempts > 0

    def _start(self, operation: Operation) -> None:
        self.counters.operations += 1
        self._operation = operation
        self.failure = None
        self._deadline_s = -math.inf
        self._attempts = 0

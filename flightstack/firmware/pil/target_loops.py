"""Loops on a target behind a ``ByteLink``: identification, numbers and steps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, FloatArray, LoopFlags
from flightstack.core.errors import TargetError, WrongFirmwareError
from flightstack.core.float32 import as_float32
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE, SETPOINT_AT, TARGET_AT
from flightstack.firmware.numbers import FIRST_NUMBERS
from flightstack.firmware.pil.client import DEFAULT_TIMING, PilCounters, PilTiming
from flightstack.firmware.pil.identity import check_identity, described
from flightstack.firmware.pil.operations import Operation
from flightstack.firmware.pil.record import PilRecord, TracedLink
from flightstack.firmware.pil.session import PilSession
from flightstack.firmware.pil.steps import WANT_REFERENCE, StepInput
from flightstack.firmware.sources import source_hash
from flightstack.transports.byte_link import ByteLink

NOTHING = (0.0,) * (TARGET_AT - SETPOINT_AT - ATTITUDE_TARGET_SIZE)
FINAL_ATTEMPTS = 6
"""Attempts to read the target's counters at the end."""


class TargetLoops:
    """Loops on a target; implements ``c_loops.LoopExecutor``.

    A changed number is set and confirmed before the next step. All waits are bounded by the client's timing on the
    link's clock, which advances by the timeout of a read without data.
    """

    def __init__(
        self,
        link: ByteLink,
        numbers: Mapping[str, float],
        timing: PilTiming = DEFAULT_TIMING,
        clock_s: Callable[[], float] = time.monotonic,
        expected_hash: bytes | None = None,
        short: bool = False,
        note: str | None = None,
    ) -> None:
        """Check the target and set ``numbers``; raise TargetError, WrongFirmwareError.

        ``expected_hash`` is the source hash required of the target, by default that of this installation. ``short``
        steps send and report only what a flight needs, for a slow line: of the stages, the output has the rotor speed
        commands, in outer ticks the attitude target, once per outer period the attitude reference, else NaN.
        ``note`` is a sentence about the link for version and record.
        """
        self.session = PilSession(link, timing, clock_s)
        self._link, self._client = link, self.session.client
        self._numbers: dict[str, float] = {}
        self._pending: list[tuple[str, float]] = []  # set one by one: integrals are scaled at each
        self._is_setting = False  # the client sets the first one of them
        self._is_closed = False
        self.ending: str | None = None
        """Reason of the target's failure, or None."""
        self.input: FloatArray = np.zeros(INPUT_SIZE)
        self.output: FloatArray = np.zeros(OUTPUT_SIZE)
        identity = self._identify(source_hash() if expected_hash is None else expected_hash)
        self.identity = described(identity)
        self._window = max(1, identity.window)
        self._short = ShortSteps(numbers) if short else None
        self.record = PilRecord(link.name, self.identity, self._counters(), note)
        self.version = _version(self.identity, note)
        for name, value in (*FIRST_NUMBERS.items(), *numbers.items()):
            self.set(name, value)
        self.send_numbers()

    def _identify(self, expected_hash: bytes) -> Any:
        """Return the target's FS_PIL_IDENTITY; raise WrongFirmwareError for other firmware."""
        identity = self._request("FS_PIL_IDENTITY")
        problem = check_identity(identity, expected_hash)
        if problem is not None:
            raise WrongFirmwareError(f"{self._link.name}: {problem}")
        return identity

    # ------------------------------------------------------------------ LoopExecutor

    def set(self, name: str, value: float) -> None:
        """Set a number before the next step."""
        value = as_float32(value) + 0.0  # + 0.0 turns -0 into 0: not every target's FPU supports -0
        if self._numbers.get(name) != value:
            self._numbers[name] = value
            self._pending.append((name, value))

    def get(self, name: str) -> float:
        """Return a number as of the next step; raise KeyError if it was never set."""
        return self._numbers[name]

    def step(self, flags: int) -> None:
        """Run a tick on the target from ``input`` to ``output``; raise TargetError."""
        self.send_numbers()
        client, short = self._client, self._short
        if short is None:
            client.start_step(flags, sent_numbers(flags, self.input))
        else:
            flags |= short.wanted(flags)
            client.start_step(flags, sent_numbers(flags, self.input), short.rotors)
        self._run_steps([flags])
        (step,) = client.steps
        assert step.result is not None
        outputs = step.result.outputs
        self.output[:-1] = outputs if short is None else short.with_target(flags, self.input, outputs)
        self.output[-1] = step.result.status & 0xFFFF

    def run(self, flags: Sequence[int], inputs: FloatArray) -> FloatArray:
        """Run ticks on ``inputs`` (n, 29), several of them in one exchange; return the outputs (n, 32)."""
        self.send_numbers()
        outputs = np.empty((len(inputs), OUTPUT_SIZE))
        for begin in range(0, len(inputs), self._window):
            end = min(begin + self._window, len(inputs))
            steps = [StepInput(flags[at], sent_numbers(flags[at], inputs[at])) for at in range(begin, end)]
            self._client.start_window(steps)
            self._run_steps(flags[begin:end])
            for at, step in enumerate(self._client.steps, begin):
                assert step.result is not None
                outputs[at, :-1], outputs[at, -1] = step.result.outputs, step.result.status & 0xFFFF
        return outputs

    def _run_steps(self, flags: Sequence[int]) -> None:
        """Finish the steps of the client and record them, also those before a failure."""
        began_s = self.session.clock_s()
        try:
            self._finish()
        finally:  # a step that ended in the safe state has a report too
            share_s = (self.session.clock_s() - began_s) / len(flags)
            for flag, step in zip(flags, self._client.steps, strict=True):
                if step.result is not None:
                    self.record.add(flag, step.result, step.attempts, share_s)

    def rest(self) -> None:
        """Do nothing: a target in lockstep waits for the next step."""

    def hold(self) -> None:
        """Do nothing: a target in lockstep waits for the next step."""

    def close(self) -> None:
        """Read the target's counters and close the link; a second call does nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            responds = any(step.result is not None for step in self._client.steps)
            if self.ending is None or responds:
                self.record.status = self._final_counters()
            if isinstance(self._link, TracedLink):
                self.record.trace = self._link.trace
        finally:
            self._link.close()

    def write_record(self, log: Path) -> None:
        """Write the record of steps and link beside the flight's log; raise OSError."""
        texts = [text for _, text in self._client.texts]
        self.record.write(log, self._client.counters, texts, self.ending)

    # ------------------------------------------------------------------ link

    @property
    def counters(self) -> PilCounters:
        """Counters of the link."""
        return self._client.counters

    def _finish(self) -> Any:
        """Run the link until the operation ends; return its result or raise TargetError."""
        client = self._client
        try:
            result = self.session.finish()
        except (OSError, RuntimeError) as error:  # link or emulated processor failed
            self.ending = str(error)
            raise TargetError(str(error)) from error
        if client.failure is not None:
            sentence = f"the target on {self._link.name} {client.failure}"
            if client.texts:
                sentence += f"; its last message: {client.texts[-1][1]}"
            self.ending = sentence
            raise TargetError(sentence)
        return result

    def run_operation(self, operation: Operation) -> Any:
        """Run an operation and return its result; raise TargetError."""
        self._client.start(operation)
        return self._finish()

    def _request(self, name: str) -> Any:
        self._client.start_request(name)
        return self._finish()

    def command(self, number: int, refusal: str, *values: float) -> None:
        """Send a command; raise TargetError with ``refusal``, a clause about the target, if it is refused."""
        self._client.start_command(number, refusal, *values)
        self._finish()

    def poll_numbers(self) -> str | None:
        """Send the next number that was changed, without waiting; return why the target refuses it, or None."""
        client = self._client
        if self._is_setting and client.failure is not None:
            return client.failure
        if self._is_setting and client.result is not None:
            del self._pending[0]
            self._is_setting = False
        if self._pending:
            if not self._is_setting:
                client.start_set(*self._pending[0])
                self._is_setting = True
            if data := client.poll(self.session.now_s):
                self._link.write(data)
        return None

    def send_numbers(self) -> None:
        """Set the numbers that were changed; raise TargetError."""
        self._is_setting = False
        while self._pending:
            self._client.start_set(*self._pending[0])
            self._finish()
            del self._pending[0]

    def _final_counters(self) -> dict[str, Any] | None:
        """Return the target's counters, or None if it does not respond."""
        client, ending = self._client, self.ending
        client.timing = client.timing._replace(attempts=min(client.timing.attempts, FINAL_ATTEMPTS))
        try:
            return self._counters()
        except TargetError:
            return None
        finally:
            self.ending = ending

    def _counters(self) -> dict[str, Any]:
        """Request FS_PIL_STATUS; raise TargetError."""
        status: dict[str, Any] = self._request("FS_PIL_STATUS").to_dict()
        status.pop("mavpackettype", None)
        return status


class ShortSteps:
    """Omissions of short steps, and the steps that request the attitude reference.

    The commander compares attitude and reference in each outer tick, with the row of the tick before.
    """

    def __init__(self, numbers: Mapping[str, float]) -> None:
        self.rotors = round(numbers["FS_ROTORS"])
        self._divisor = round(numbers["FS_OUTER_DIV"])
        self._ticks = 0
        self._target: list[float] = [math.nan] * ATTITUDE_TARGET_SIZE

    def wanted(self, flags: int) -> int:
        """Return the flag for the attitude reference if this tick is the last one of an outer period, or 0."""
        if flags & (LoopFlags.OUTER_DUE | LoopFlags.SET_TARGET):
            self._ticks = 0
        self._ticks += 1
        return 0 if self._ticks % self._divisor else WANT_REFERENCE

    def with_target(self, flags: int, values: FloatArray, outputs: Sequence[float]) -> Sequence[float]:
        """Return the outputs with the attitude target, which is reported only when the outer loop runs."""
        if flags & LoopFlags.RESET:
            self._target = [*map(as_float32, values[6:10].tolist()), 0.0]
        if flags & LoopFlags.SET_TARGET:
            self._target = [*map(as_float32, values[TARGET_AT:].tolist())]
        elif flags & LoopFlags.OUTER_DUE:
            self._target = list(outputs[:ATTITUDE_TARGET_SIZE])
        return (*self._target, *outputs[ATTITUDE_TARGET_SIZE:])


def sent_numbers(flags: int, values: FloatArray) -> list[float]:
    """Return state and setpoint of an input (29,) for a step; the attitude target in place of the setpoint."""
    numbers: list[float] = values.tolist()
    if not flags & LoopFlags.SET_TARGET:
        return numbers[:TARGET_AT]
    if flags & LoopFlags.OUTER_DUE:
        raise ValueError("a step has either a setpoint or an attitude target")
    return [*numbers[:SETPOINT_AT], *numbers[TARGET_AT:], *NOTHING]


def _version(identity: Mapping[str, str], note: str | None) -> str:
    """Return the description of the target's firmware for the flight log."""
    details = [identity["board"], f"sources {identity['source_hash']}", identity["compiler"]]
    return f"C, float, {', '.join(details if note is None else [*details, note])}"

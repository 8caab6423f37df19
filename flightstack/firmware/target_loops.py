"""Loops on a target behind a ``ByteLink``: identification, numbers and steps."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, FloatArray, LoopFlags
from flightstack.core.errors import TargetError, WrongFirmwareError
from flightstack.core.float32 import as_float32
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE, SETPOINT_AT, TARGET_AT
from flightstack.firmware.numbers import FIRST_NUMBERS
from flightstack.firmware.pil_client import DEFAULT_TIMING, PilClient, PilCounters, PilTiming
from flightstack.firmware.pil_operations import PilReport
from flightstack.firmware.pil_record import COST_UNITS, PilRecord
from flightstack.firmware.sources import source_hash
from flightstack.transports.byte_link import ByteLink

NOTHING = (0.0,) * (TARGET_AT - SETPOINT_AT - ATTITUDE_TARGET_SIZE)
MOST_READS = 100_000
"""Maximum reads per attempt, which bounds a step on a link with endless data."""
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
    ) -> None:
        """Check the target and set ``numbers``; raise TargetError, WrongFirmwareError.

        ``expected_hash`` is the source hash required of the target, by default that of this installation.
        """
        self._link, self._client, self._clock_s = link, PilClient(timing), clock_s
        self._waited_s = 0.0  # added to the clock: an emulated target waits without real time
        self._numbers: dict[str, float] = {}
        self._pending: list[tuple[str, float]] = []  # set one by one: integrals are scaled at each
        self._is_closed = False
        self.ending: str | None = None
        """Why the target failed, or None."""
        self.input: FloatArray = np.zeros(INPUT_SIZE)
        self.output: FloatArray = np.zeros(OUTPUT_SIZE)
        identity = self._identify()
        problem = wrong_firmware(identity, source_hash() if expected_hash is None else expected_hash)
        if problem is not None:
            raise WrongFirmwareError(f"{link.name}: {problem}")
        self.identity = described(identity)
        self.record = PilRecord(link.name, self.identity, self._counters())
        details = (
            self.identity["board"],
            f"sources {self.identity['source_hash']}",
            self.identity["compiler"],
        )
        self.version = f"C, float, {', '.join(details)}"
        for name, value in (*FIRST_NUMBERS.items(), *numbers.items()):
            self.set(name, value)
        self._send_numbers()

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
        self._send_numbers()
        numbers = self.input.tolist()
        if flags & LoopFlags.SET_TARGET:  # the attitude target is sent in place of the setpoint
            if flags & LoopFlags.OUTER_DUE:
                raise ValueError("a step has either a setpoint or an attitude target")
            numbers = [*numbers[:SETPOINT_AT], *numbers[TARGET_AT:], *NOTHING]
        else:
            numbers = numbers[:TARGET_AT]
        client = self._client
        client.start_step(flags, numbers)
        began_s = self._clock_s()
        try:
            self._finish()
        finally:  # a step that ended in the safe state has a report too
            report = client.result
            if isinstance(report, PilReport):
                self.record.add(flags, report, client.attempts, self._clock_s() - began_s)
        assert isinstance(report, PilReport)
        self.output[:-1] = report.outputs
        self.output[-1] = report.status & 0xFFFF

    def close(self) -> None:
        """Read the target's counters and close the link; a second call does nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            if self.ending is None or isinstance(self._client.result, PilReport):  # the target responds
                self.record.status = self._final_counters()
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

    @property
    def _now_s(self) -> float:
        return self._clock_s() + self._waited_s

    def _finish(self) -> Any:
        """Run the link until the operation ends; return its result or raise TargetError."""
        client, link = self._client, self._link
        try:
            while client.failure is None and client.result is None:
                data = client.poll(self._now_s)
                if data:
                    link.write(data)
                self._receive()
        except (OSError, RuntimeError) as error:  # link or emulated processor failed
            self.ending = str(error)
            raise TargetError(str(error)) from error
        if client.failure is not None:
            sentence = f"the target on {link.name} {client.failure}"
            if client.texts:
                sentence += f"; its last message: {client.texts[-1][1]}"
            self.ending = sentence
            raise TargetError(sentence)
        return client.result

    def _receive(self) -> None:
        """Read until the end or deadline of the operation."""
        client, link = self._client, self._link
        for _ in range(MOST_READS):
            deadline_s = client.next_deadline()
            if deadline_s is None:
                return
            left_s = deadline_s - self._now_s
            if left_s <= 0.0:
                return
            before_s = self._clock_s()
            data = link.read(left_s)
            if data:
                client.receive(data, self._now_s)
            else:  # time passed on an emulated target but not on the clock
                self._waited_s += max(0.0, left_s - (self._clock_s() - before_s))
        self._waited_s += max(0.0, (client.next_deadline() or 0.0) - self._now_s)

    def _identify(self) -> Any:
        self._client.start_request("FS_PIL_IDENTITY")
        return self._finish()

    def _send_numbers(self) -> None:
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
        self._client.start_request("FS_PIL_STATUS")
        status: dict[str, Any] = self._finish().to_dict()
        status.pop("mavpackettype", None)
        return status


def wrong_firmware(identity: Any, expected_hash: bytes) -> str | None:
    """Return why the firmware of an FS_PIL_IDENTITY is incompatible, or None."""
    if identity.real_octets != 4:
        return (
            f"its loops compute with {8 * identity.real_octets} bits, not with 32: flash the firmware again"
        )
    if bytes(identity.source_hash) != expected_hash:
        return (
            f"its firmware was made of other sources ({bytes(identity.source_hash).hex()}, on {_board(identity)}) "
            f"than these ({expected_hash.hex()}): flash it again"
        )
    return None


def described(identity: Any) -> dict[str, Any]:
    """Return an FS_PIL_IDENTITY as a JSON object."""
    unit = identity.cost_unit
    return {
        "board": _board(identity),
        "compiler": identity.compiler.strip() or "unknown compiler",
        "source_hash": bytes(identity.source_hash).hex(),
        "cost_unit": COST_UNITS[unit] if unit < len(COST_UNITS) else f"unit {unit}",
        "clock_hz": identity.clock_hz,
        "real_octets": identity.real_octets,
        "char_bits": identity.char_bits,
    }


def _board(identity: Any) -> str:
    return identity.board.strip() or "unknown board"

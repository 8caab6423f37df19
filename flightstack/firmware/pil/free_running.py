"""Loops that a target runs by its own timer: states out, rotor commands and timing in, in real time."""

from __future__ import annotations

import contextlib
import math
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, FloatArray, LoopFlags
from flightstack.core.errors import TargetError
from flightstack.core.float32 import as_float32
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE
from flightstack.firmware.pil.client import DEFAULT_TIMING
from flightstack.firmware.pil.steps import (
    BAD_INPUT,
    OWN_COMPONENT,
    OWN_SYSTEM,
    REFERENCE_AT,
    REFERENCE_ATTITUDE_SIZE,
    ROTORS_AT,
)
from flightstack.firmware.pil.target_loops import FINAL_ATTEMPTS, TargetLoops, sent_numbers
from flightstack.mavlink.dialect import LAYOUT_BY_NAME, mavlink
from flightstack.mavlink.frames import HEADER_V2, Frame, pack_frame
from flightstack.mavlink.link import Link

REST = 16
"""Bit of FS_PIL_STATE.flags beside ``LoopFlags``: the flight has ended."""
DRIVE_TIMEOUT_S = 0.5
"""Time without a rotor command, or without one from a recent state, after which the flight fails."""
MAX_DELAY_S = 0.1
"""Largest delay from a state to its command at which the state counts as recent."""
_BIN_US = 10
"""Width of a bin of delays."""
_STATE, _DRIVE, _TIMING = (LAYOUT_BY_NAME[f"FS_PIL_{name}"] for name in ("STATE", "DRIVE", "TIMING"))
_STATE_PAYLOAD, _DRIVE_PAYLOAD = struct.Struct(_STATE.format), struct.Struct(_DRIVE.format)
_TIME_MASK = 0xFFFF_FFFF
_TOTALS = ("ticks", "missed", "overruns", "states", "skipped", "held", "timeouts")
TICKS_PER_COMMAND = 1
STATE_TIMEOUT_MS = 250.0
"""Age of a state at which the target stops the rotors: longer than a pause of a loaded host."""
_REST_S = 0.1
"""Time on the ground between two states with REST, of which one may be lost."""
_PAUSE_S = 1.0
"""Time without a state on the ground after which free-running is commanded again: the firmware ends it after 5 s."""
_RESEND_S, _SET_ATTEMPTS = 0.03, 100
"""Timeout and attempts of a number, which is set while states are sent."""
_MOST_READS = 20


class FreeRunning:
    """States of one flight after another, and the newest commands. No I/O; times are of the host's clock."""

    def __init__(self) -> None:
        self._codec = Link(OWN_SYSTEM, OWN_COMPONENT)
        self._sequence = 0
        self._began_us = 0
        self._is_begun = False
        self._heard_s = self._recent_s = 0.0
        self._delays = Delays()
        self.is_flying = False
        """True from a state with RESET to one with REST."""
        self._windows: list[dict[str, Any]] = []
        self.commands: tuple[float, ...] = (0.0,) * 8
        """Rotor speed commands [rad/s] of the newest FS_PIL_DRIVE of this flight, zero before the first one."""
        self.attitude: tuple[float, ...] | None = None
        """Its attitude reference (4) and attitude target (5), None before the first one."""
        self.status = 0
        """Its status."""

    def state(self, flags: int, numbers: Sequence[float], now_s: float) -> bytes:
        """Return the frame of a state; a flight begins with the flag RESET, and ends with REST.

        RESET is repeated until a command shows that it arrived.
        """
        now_us = self._time_us(now_s)
        if flags & LoopFlags.RESET:
            if not self.is_flying:
                self.commands, self.attitude = (0.0,) * 8, None
                self._heard_s = self._recent_s = now_s
            self.is_flying, self._is_begun, self._began_us, self.status = True, False, now_us, 0
        elif flags & REST:
            self.is_flying = False
        elif not self._is_begun:
            flags |= LoopFlags.RESET
        try:
            payload = _STATE_PAYLOAD.pack(now_us, flags, *numbers)
        except OverflowError:  # beyond float32
            payload = _STATE_PAYLOAD.pack(now_us, flags, *map(as_float32, numbers))
        self._sequence = (self._sequence + 1) & 255
        cut = payload.rstrip(b"\0") or b"\0"
        return pack_frame(_STATE.message_id, cut, _STATE.crc_extra, self._sequence, OWN_SYSTEM, OWN_COMPONENT)

    def take_frame(self, frame: Frame, now_s: float) -> bool:
        """Process a command or figures of a second; return False for any other frame."""
        if frame.message_id == _DRIVE.message_id:
            payload = frame.data[HEADER_V2 : HEADER_V2 + frame.data[1]].ljust(_DRIVE_PAYLOAD.size, b"\0")
            self._take_drive(_DRIVE_PAYLOAD.unpack(payload[: _DRIVE_PAYLOAD.size]), now_s)
        elif frame.message_id == _TIMING.message_id:
            self._windows += [message.to_dict() for message in self._codec.decode(frame.data)]
        else:
            return False
        return True

    def _take_drive(self, values: tuple[Any, ...], now_s: float) -> None:
        state_us, status, now_us = values[0], values[1], self._time_us(now_s)
        since_us, elapsed_us = ((time - self._began_us) & _TIME_MASK for time in (state_us, now_us))
        if not self.is_flying or since_us > elapsed_us:  # of an earlier flight, or at rest
            return
        self._heard_s = now_s
        self.attitude, self.commands, self.status = values[4:13], values[13:], status
        if not status & BAD_INPUT:
            self._is_begun = True
            self._delays.add(elapsed_us - since_us)
            if elapsed_us - since_us <= MAX_DELAY_S * 1e6:
                self._recent_s = now_s

    def failure(self, now_s: float) -> str | None:
        """Return why the flight cannot go on, as a clause about the target, or None."""
        if not self.is_flying:
            return None
        if self.status & BAD_INPUT:
            return "stopped its rotors"
        if now_s - self._heard_s > DRIVE_TIMEOUT_S:
            return f"sent no rotor commands for {DRIVE_TIMEOUT_S:g} s"
        if now_s - self._recent_s > DRIVE_TIMEOUT_S:
            return (
                f"flies states older than {MAX_DELAY_S:g} s: the line is too slow or the host is overloaded"
            )
        return None

    def figures(self) -> dict[str, Any]:
        """Return counts, jitter and delays of all flights, for the record; means are over ticks."""
        windows = self._windows
        flown = [window for window in windows if window["age_max_us"] > 0]  # age is 0 at rest
        return {
            **{name: sum(window[name] for window in windows) for name in _TOTALS},
            "period_us": windows[-1]["period_us"] if windows else None,
            "late_mean_us": _mean(windows, "late_mean_us"),
            "late_max_us": max((window["late_max_us"] for window in windows), default=None),
            "state_age_mean_us": _mean(flown, "age_mean_us"),
            "state_age_max_us": max((window["age_max_us"] for window in windows), default=None),
            "cost_max": max((window["cost_max"] for window in windows), default=None),
            "commands": self._delays.count,
            **self._delays.figures(),
        }

    @staticmethod
    def _time_us(now_s: float) -> int:
        return round(now_s * 1e6) & _TIME_MASK


class Delays:
    """Statistics of delays [us] in constant memory."""

    def __init__(self) -> None:
        self.count = 0
        self._sum = self._max = 0
        self._bins = np.zeros(
            round(DRIVE_TIMEOUT_S * 1e6) // _BIN_US + 1, np.int64
        )  # the last one: all above

    def add(self, delay_us: int) -> None:
        """Count a delay."""
        self.count += 1
        self._sum += delay_us
        self._max = max(self._max, delay_us)
        self._bins[min(delay_us // _BIN_US, len(self._bins) - 1)] += 1

    def figures(self) -> dict[str, float]:
        """Return mean, 99th percentile (to the width of a bin) and maximum, 0 without any delay."""
        at = int(np.searchsorted(np.cumsum(self._bins), 0.99 * self.count))
        is_last = at == len(self._bins) - 1
        p99 = self._max if is_last else min(self._max, (at + 1) * _BIN_US)
        return {
            "end_to_end_mean_us": self._sum / max(1, self.count),
            "end_to_end_p99_us": float(p99),
            "end_to_end_max_us": float(self._max),
        }


def _mean(windows: Sequence[dict[str, Any]], name: str) -> float | None:
    """Return the mean over the ticks of ``windows``, None without any."""
    ticks = sum(window["ticks"] for window in windows)
    return sum(window[name] * window["ticks"] for window in windows) / ticks if ticks else None


class FreeLoops:
    """Sends states to a free-running target and returns its newest commands; implements ``c_loops.LoopExecutor``.

    A step does not wait. Of the stages, the output has the rotor speed commands, and the attitude reference and target,
    which commander and guidance need; the rest is NaN.
    """

    def __init__(self, loops: TargetLoops) -> None:
        """Start the free run of the target of ``loops``; raise TargetError."""
        self._loops, self._session = loops, loops.session
        self._free = FreeRunning()
        self._timing = self._session.client.timing
        self._session.client.listener = self._free.take_frame
        self._sent_s = -math.inf
        self._given = 0
        self._held: list[float] = []
        self._is_closed = False
        self.input: FloatArray = np.zeros(INPUT_SIZE)
        self.output: FloatArray = np.full(OUTPUT_SIZE, math.nan)
        self.version = f"{loops.version}, free-running"
        self._run()

    def set(self, name: str, value: float) -> None:
        """Set a number before the next step."""
        self._loops.set(name, value)

    def get(self, name: str) -> float:
        """Return a number as of the next step; raise KeyError if it was never set."""
        return self._loops.get(name)

    def step(self, flags: int) -> None:
        """Send the state of ``input`` and write the newest commands to ``output``; raise TargetError.

        Numbers are set before a flight begins, and beside the states of a flight.
        """
        if not self._free.is_flying:
            self._loops.send_numbers()
        if flags & (
            LoopFlags.OUTER_DUE | LoopFlags.SET_TARGET
        ):  # holds until the next outer tick, here and there
            self._given = flags & LoopFlags.SET_TARGET
        flags = flags & LoopFlags.RESET | self._given
        self._held = sent_numbers(flags, self.input)
        self._fly(flags)
        level = self.input[6:10].tolist()
        attitude = (*level, *level, 0.0) if self._free.attitude is None else self._free.attitude
        self.output[REFERENCE_AT : REFERENCE_AT + REFERENCE_ATTITUDE_SIZE] = attitude[
            :REFERENCE_ATTITUDE_SIZE
        ]
        self.output[:ATTITUDE_TARGET_SIZE] = attitude[REFERENCE_ATTITUDE_SIZE:]
        self.output[ROTORS_AT:-1] = self._free.commands
        self.output[-1] = self._free.status & 0xFFFF

    def run(self, flags: Sequence[int], inputs: FloatArray) -> FloatArray:
        """Raise TargetError: a replay needs a target that computes each step."""
        raise TargetError("a free-running target cannot replay a flight")

    def hold(self) -> None:
        """Repeat the last state of a flight, or the target would stop the rotors; raise TargetError."""
        if self._free.is_flying:
            self._fly(self._given)

    def rest(self) -> None:
        """Tell the target that the vehicle is on the ground: no states follow until the next flight."""
        if self._free.is_flying or self._session.now_s - self._sent_s >= _REST_S:
            self._exchange(REST, [0.0] * 24)
        else:
            self._poll()

    def _fly(self, flags: int) -> None:
        """Exchange the newest state; raise TargetError."""
        self._exchange(flags, self._held)
        if (problem := self._free.failure(self._session.now_s)) is not None:
            texts = self._session.client.texts
            self._fail(problem + (f": {texts[-1][1]}" if texts and self._free.status & BAD_INPUT else ""))

    def _exchange(self, flags: int, numbers: Sequence[float]) -> None:
        session = self._session
        if not self._free.is_flying and session.now_s - self._sent_s > _PAUSE_S:
            self._run()
        self._poll()  # first: a command that is there shows that the flight has begun on the target
        state = self._free.state(flags, numbers, session.now_s)
        with self._ending():
            session.link.write(state)
        session.client.counters.octets_sent += len(state)
        self._sent_s = session.now_s

    def _poll(self) -> None:
        """Process what has arrived and send a number that is due, without waiting; raise TargetError."""
        session = self._session
        with self._ending():
            for _ in range(_MOST_READS):
                if not (data := session.link.read(0.0)):
                    break
                session.client.receive(data, session.now_s)
            problem = self._loops.poll_numbers()
        if problem is not None:
            self._fail(problem)

    @contextlib.contextmanager
    def _ending(self) -> Iterator[None]:
        """Turn a failure of the link into the ending of the flight and a TargetError."""
        try:
            yield
        except OSError as error:
            self._loops.ending = str(error)
            raise TargetError(str(error)) from error

    def _run(self) -> None:
        """Set the numbers that were changed and resume the free run; raise TargetError."""
        client = self._session.client
        client.timing = self._timing
        self._loops.send_numbers()
        self._loops.command(
            mavlink.MAV_CMD_FS_FREE_RUN,
            "refuses to run by its own timer",
            1.0,
            TICKS_PER_COMMAND,
            STATE_TIMEOUT_MS,
        )
        line_s = self._timing.timeout_s - DEFAULT_TIMING.timeout_s
        client.timing = self._timing._replace(timeout_s=_RESEND_S + line_s, attempts=_SET_ATTEMPTS)
        self._sent_s = self._session.now_s

    def _fail(self, problem: str) -> None:
        """Raise TargetError; ``problem`` is a clause about the target."""
        self._loops.ending = f"the target on {self._session.link.name} {problem}"
        raise TargetError(self._loops.ending)

    def close(self) -> None:
        """Stop the target, also after a failure, read its counters and close the link; a second call does nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        loops, client, ending = self._loops, self._session.client, self._loops.ending
        client.timing = self._timing
        if ending is not None:
            client.timing = client.timing._replace(attempts=FINAL_ATTEMPTS)
        loops.ending = None
        try:
            with contextlib.suppress(TargetError):  # which sets loops.ending: the counters are not read
                loops.command(mavlink.MAV_CMD_FS_FREE_RUN, "does not stop", 0.0)
        finally:
            loops.close()
            loops.ending = ending or loops.ending

    def write_record(self, log: Path) -> None:
        """Write the record of the link beside the flight's log; raise OSError."""
        self._loops.record.free_running = self._free.figures()
        self._loops.write_record(log)

"""Loops that a target runs by its own timer, behind a ``ByteLink``, in real time."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, FloatArray, LoopFlags
from flightstack.core.errors import TargetError
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE
from flightstack.firmware.pil.client import DEFAULT_TIMING
from flightstack.firmware.pil.free_running import REST, FreeRunning
from flightstack.firmware.pil.steps import BAD_INPUT, REFERENCE_AT, REFERENCE_ATTITUDE_SIZE, ROTORS_AT
from flightstack.firmware.pil.target_loops import FINAL_ATTEMPTS, TargetLoops, sent_numbers
from flightstack.mavlink.dialect import mavlink

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

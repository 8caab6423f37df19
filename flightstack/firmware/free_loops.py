"""Loops that a target runs by its own timer, behind a ``ByteLink``, in real time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, FloatArray, LoopFlags
from flightstack.core.errors import TargetError
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE
from flightstack.firmware.free_running import REST, FreeRunning
from flightstack.firmware.pil_steps import REFERENCE_AT, REFERENCE_ATTITUDE_SIZE, ROTORS_AT
from flightstack.firmware.target_loops import TargetLoops, sent_numbers
from flightstack.mavlink.dialect import mavlink

TICKS_PER_COMMAND = 1
STATE_TIMEOUT_MS = 250.0
"""Age of a state at which the target stops the rotors: longer than a pause of a loaded host."""
_REST_EVERY = 100
"""Ticks on the ground between two states with REST, of which one may be lost."""
_MOST_READS = 20


class FreeLoops:
    """Sends states to a free-running target and returns its newest commands; implements ``c_loops.LoopExecutor``.

    A step does not wait. Of the stages, the output has the rotor speed commands, and the attitude reference and target,
    which commander and guidance need; the rest is NaN.
    """

    def __init__(self, loops: TargetLoops) -> None:
        """Let the target of ``loops`` run; raise TargetError."""
        self._loops, self._session = loops, loops.session
        self._free = FreeRunning()
        self._resting = 0
        self._given = 0
        self.input: FloatArray = np.zeros(INPUT_SIZE)
        self.output: FloatArray = np.full(OUTPUT_SIZE, math.nan)
        self.version = f"{loops.version}, free-running"
        loops.command(
            mavlink.MAV_CMD_FS_FREE_RUN,
            "refuses to run by its own timer",
            1.0,
            TICKS_PER_COMMAND,
            STATE_TIMEOUT_MS,
        )

    def set(self, name: str, value: float) -> None:
        """Set a number before the next step."""
        self._loops.set(name, value)

    def get(self, name: str) -> float:
        """Return a number as of the next step; raise KeyError if it was never set."""
        return self._loops.get(name)

    def step(self, flags: int) -> None:
        """Send the state of ``input`` and write the newest commands to ``output``; raise TargetError."""
        self._loops.send_numbers()
        self._resting = 0
        if flags & (
            LoopFlags.OUTER_DUE | LoopFlags.SET_TARGET
        ):  # holds until the next outer tick, here and there
            self._given = flags & LoopFlags.SET_TARGET
        flags = flags & LoopFlags.RESET | self._given
        self._exchange(flags, sent_numbers(flags, self.input))
        if (problem := self._free.failure(self._session.now_s)) is not None:
            self._fail(f"the target on {self._session.link.name} {problem}")
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

    def rest(self) -> None:
        """Tell the target that the vehicle is on the ground: no states follow until the next flight."""
        if self._resting % _REST_EVERY == 0:
            self._exchange(REST, [0.0] * 24)
        else:
            self._receive()
        self._resting += 1

    def _exchange(self, flags: int, numbers: Sequence[float]) -> None:
        session = self._session
        try:
            self._receive()  # first: a command that is there shows that the flight has begun on the target
            session.link.write(self._free.state(flags, numbers, session.now_s))
        except OSError as error:
            self._fail(str(error), error)

    def _receive(self) -> None:
        session = self._session
        for _ in range(_MOST_READS):
            if not (data := session.link.read(0.0)):
                return
            self._free.receive(data, session.now_s)

    def _fail(self, sentence: str, error: OSError | None = None) -> None:
        self._loops.ending = sentence
        raise TargetError(sentence) from error

    def close(self) -> None:
        """Stop the target, read its counters and close the link."""
        if self._loops.ending is None:
            self._loops.command(mavlink.MAV_CMD_FS_FREE_RUN, "does not stop", 0.0)
        self._loops.close()

    def write_record(self, log: Path) -> None:
        """Write the record of the link beside the flight's log; raise OSError."""
        self._loops.record.free_running = self._free.figures()
        self._loops.write_record(log)

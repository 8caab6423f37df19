"""MAV_CMD_INJECT_FAILURE: forward the failure to the simulator, and answer with the simulator's result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from flightstack.services.commands.context import (
    ACCEPTED,
    DENIED,
    FAILED,
    REJECTED,
    UNSUPPORTED,
    Answer,
    Command,
    FailureLink,
)

LONGEST_WAIT_S = 1.5
"""Timeout of the simulator's answer, which takes one step. MAVSDK waits 2 s for the acknowledgement."""
_HIGHEST = 255.0
_REASONS = {
    DENIED: "the simulator has no such motor, battery or sensor",
    UNSUPPORTED: "the simulator does not support this failure, or sends no such sensor",
}


class FailureCommands:
    """Forwards one failure at a time."""

    def __init__(self, simulator: FailureLink, are_allowed: Callable[[], bool]) -> None:
        """``are_allowed`` returns True if SYS_FAILURE_EN is set."""
        self._simulator = simulator
        self._are_allowed = are_allowed
        self._waiting: tuple[Command, float] | None = None

    def begin(self, command: Command, now_s: float) -> Answer | None:
        """Request the failure from the simulator; return the answer if it is refused at once."""
        numbers = command.params[:3]
        if not self._are_allowed():
            return Answer(DENIED, "failures are not allowed: SYS_FAILURE_EN is 0")
        if not self._simulator.has_state:
            return Answer(REJECTED, "no simulator is connected")
        if not all(0.0 <= number <= _HIGHEST and number == math.floor(number) for number in numbers):
            return Answer(DENIED, "unit, type and instance of a failure are whole numbers, 0 to 255")
        if self._waiting is not None:
            return Answer(REJECTED, "another failure waits for the simulator's answer")
        self._waiting = (command, now_s)
        self._simulator.ask_for_failure(*(int(number) for number in numbers))
        return None

    def poll(self, now_s: float) -> Iterator[tuple[Command, Answer]]:
        """Yield the command that can be answered now, with its answer."""
        if self._waiting is None:
            return
        command, asked_s = self._waiting
        result = self._simulator.take_failure_result()
        if result is not None:
            answer = Answer(
                result, "" if result == ACCEPTED else _REASONS.get(result, "the simulator refused")
            )
        elif now_s - asked_s > LONGEST_WAIT_S:
            answer = Answer(FAILED, "the simulator does not answer")
        else:
            return
        self._waiting = None
        yield command, answer

    def next_deadline(self) -> float | None:
        """Return −inf while the simulator's answer is awaited, which may come at any time, else None."""
        return None if self._waiting is None else -math.inf

"""The simulator's session in lockstep: which exchanges are run without Python."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from sim_bridge.server.connection import StoppedError
from sim_bridge.server.session import Pace, Session

FULL_SPEED = Pace(math.inf)


class Link(SimpleNamespace):
    """A link whose first state is answered."""

    def __init__(self) -> None:
        super().__init__(
            ready=True, answered=True, is_sent=True, freewheels=False, free_running=False, error=None,
            simulator=SimpleNamespace(time_us=0, interval_us=2000), steps=0,
        )  # fmt: skip

    def step(self) -> None:
        self.steps += 1
        self.simulator.time_us += self.simulator.interval_us
        self.answered = False


class Quiet(SimpleNamespace):
    """Exchanges of which as many as in ``rooms`` are quiet; ``lost`` of the last ones are not answered."""

    def __init__(self, rooms: list[int], lost: int = 0) -> None:
        super().__init__(count=0, unsent=b"", received=None, simulator=None)
        self.rooms, self.lost = rooms, lost

    def room(self) -> int:
        return self.rooms.pop(0)

    def run(self, count: int) -> None:
        count -= 0 if self.rooms else self.lost
        self.count += count
        self.simulator.time_us += count * self.simulator.interval_us


def no_answer() -> memoryview:
    raise StoppedError


def exchanged(quiet: Quiet, pace: Pace = FULL_SPEED) -> tuple[int, int]:
    """Return the exchanges of a session that ends in its second wait in Python, and those that were steps there."""
    link: Any = Link()
    quiet.simulator = link.simulator
    connection: Any = SimpleNamespace(receive=no_answer)
    stop: Any = SimpleNamespace(stopped=False, is_set=lambda: False)
    session = Session(link, connection, pace, stop, quiet)  # type: ignore[arg-type]
    if math.isinf(pace.speed):
        session._move_at = 100
    with pytest.raises(StoppedError):
        session.run()
    return session.exchanges, link.steps


def test_quiet_exchanges_follow_each_other() -> None:
    assert exchanged(Quiet([30, 20, 0])) == (51, 1)


def test_quiet_exchanges_end_before_the_process_may_move() -> None:
    """That exchange is one in Python."""
    assert exchanged(Quiet([30, 500, 7])) == (99, 1)


def test_an_answer_that_does_not_come_is_awaited_in_python() -> None:
    assert exchanged(Quiet([30, 20], lost=5)) == (46, 1)


def test_quiet_exchanges_end_before_the_speed_is_held() -> None:
    """A head start of 0.1 s has 49 steps of 2 ms before its end."""
    assert exchanged(Quiet([30, 500, 500]), Pace(1.0, 100_000)) == (49, 1)


def test_no_exchange_at_a_held_speed_is_quiet() -> None:
    assert exchanged(Quiet([30, 500]), Pace(1.0)) == (1, 1)

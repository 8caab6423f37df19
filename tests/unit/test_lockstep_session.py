"""The simulator's session in lockstep: which exchanges are run without Python."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from sim_bridge.server.connection import StoppedError
from sim_bridge.server.session import Pace, Session


class Link(SimpleNamespace):
    """A link whose first state is answered."""

    def __init__(self) -> None:
        super().__init__(
            ready=True, answered=True, is_sent=True, freewheels=False, free_running=False, error=None,
            simulator=SimpleNamespace(time_us=0), steps=0,
        )  # fmt: skip

    def step(self) -> None:
        self.steps += 1
        self.answered = False


class Quiet(SimpleNamespace):
    """Exchanges of which as many as in ``rooms`` are quiet; ``lost`` of the last ones are not answered."""

    def __init__(self, rooms: list[int], lost: int = 0) -> None:
        super().__init__(count=0, unsent=b"", received=None)
        self.rooms, self.lost = rooms, lost

    def room(self) -> int:
        return self.rooms.pop(0)

    def run(self, count: int) -> None:
        self.count += count if self.rooms else count - self.lost


def no_answer() -> memoryview:
    raise StoppedError


def exchanged(quiet: Quiet) -> tuple[int, int]:
    """Return the exchanges of a session that ends in its second wait in Python, and those that were steps there."""
    link: Any = Link()
    connection: Any = SimpleNamespace(receive=no_answer)
    stop: Any = SimpleNamespace(stopped=False, is_set=lambda: False)
    session = Session(link, connection, Pace(math.inf), stop, quiet)  # type: ignore[arg-type]
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

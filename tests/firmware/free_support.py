"""Free runs of a target in the tests: start one, advance its time, send states, read commands and figures."""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.dialect import mavlink
from tests.firmware.app_support import Target, free_run

FREE, PERIOD_US = 4, 2_000  # 500 Hz
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def started(target: Target, every: float = 1, timeout_ms: float = 0) -> None:
    target.poll(1_500)  # figures of a second count from the start of the run, not of the target
    target.run(-1)
    target.run(0)
    target.heard()
    assert free_run(target, 1, every, timeout_ms) == ACCEPTED


def drives(target: Target) -> list[Any]:
    return [message for message in target.heard() if message.get_type() == "FS_PIL_DRIVE"]


def at(target: Target, now_us: int, *states: Any) -> list[Any]:
    """Advance to a time, first the tick that is due, then states; return the commands."""
    target.run(now_us)
    for each in states:
        target.give(target.pack(each))
    return drives(target)


def timing(target: Target) -> Any:
    """Let a second pass and return the figures."""
    target.poll(1_000)
    return next(message for message in target.heard() if message.get_type() == "FS_PIL_TIMING")

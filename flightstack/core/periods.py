"""Times of what is done at intervals: multiples of the interval, so that several intervals often end in one tick."""

from __future__ import annotations

from typing import Any

from flightstack.core.compiled import compiled

NEVER_US = 1 << 62
"""A time that does not come [µs]."""


def next_due(time_us: int, interval_us: int) -> int:
    """Return the first multiple of ``interval_us`` after ``time_us``."""
    return (time_us // interval_us + 1) * interval_us


@compiled
def take_due(due_us: Any, interval_us: Any, index: int, time_us: int) -> bool:
    """Return True if ``due_us[index]`` has come, and set the time of the next one: arrays of int64."""
    if time_us < due_us[index]:
        return False
    due_us[index] = (time_us // interval_us[index] + 1) * interval_us[index]
    return True

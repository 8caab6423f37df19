"""Times of what is done at intervals: multiples of the interval, so that several intervals often end in one tick."""

from __future__ import annotations


def next_due(time_us: int, interval_us: int) -> int:
    """Return the first multiple of ``interval_us`` after ``time_us``."""
    return (time_us // interval_us + 1) * interval_us

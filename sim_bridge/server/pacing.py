"""Wall-clock deadlines for simulated time, and their lateness."""

from __future__ import annotations

import time
from collections.abc import Callable

_BINS = 100_000  # of 1 µs; the last one also counts longer delays
_SLIP_NS = 500_000_000
_LONGEST_SLEEP_S = 0.1


class Lateness:
    """Distribution of the delays after deadlines, in bins of 1 µs."""

    def __init__(self) -> None:
        self._bins = [0] * _BINS
        self._sum_ns = 0
        self.count = 0
        self.max_us = 0.0

    def add(self, late_ns: int) -> None:
        """Count one delay."""
        self._bins[min(late_ns // 1000, _BINS - 1)] += 1
        self._sum_ns += late_ns
        self.count += 1
        self.max_us = max(self.max_us, late_ns / 1000.0)

    def mean_us(self) -> float:
        """Return the mean delay."""
        return self._sum_ns / 1000.0 / max(1, self.count)

    def percentile_us(self, percent: float) -> float:
        """Return a percentile of the delays, to 1 µs."""
        wanted, seen = self.count * percent / 100.0, 0
        for us, number in enumerate(self._bins):
            seen += number
            if seen >= wanted:
                return us + 1.0
        return float(_BINS)


class Pacer:
    """Paces simulated time at ``speed`` times wall time, by absolute deadlines."""

    def __init__(self, speed: float, stopped: Callable[[], bool]) -> None:
        self._ns_per_us = 1000.0 / speed
        self._stopped = stopped
        self._base_ns: int | None = None
        self._base_us = 0
        self.lateness = Lateness()
        self.slips = 0

    def wait_until(self, time_us: int) -> None:
        """Sleep until the deadline of ``time_us``; the first call sets the origin.

        A delay of more than 0.5 s (a suspended machine, a debugger) resets the origin.
        """
        now = time.monotonic_ns()
        if self._base_ns is None:
            self._base_ns, self._base_us = now, time_us
            return
        deadline = self._base_ns + round((time_us - self._base_us) * self._ns_per_us)
        while now < deadline and not self._stopped():
            time.sleep(min(_LONGEST_SLEEP_S, (deadline - now) * 1e-9))
            now = time.monotonic_ns()
        late = max(0, now - deadline)
        self.lateness.add(late)
        if late > _SLIP_NS:
            self.slips += 1
            self._base_ns, self._base_us = now, time_us

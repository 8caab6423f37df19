"""Fixed-rate scheduling: rates of the loops, real-time deadline scheduler, and timing statistics.

Only this module reads the machine's clock for the loops. In lockstep the simulator drives the time, and only execution
times are measured.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.errors import ConfigError
from flightstack.mavlink.dialect import FsLoopTiming
from flightstack.mavlink.link import Message
from flightstack.params.config import DEFAULT_OUTER_HZ

MIN_INNER_HZ, MAX_INNER_HZ = 10.0, 20_000.0
WINDOW = 4096
WATCHED_NS, WATCHED_SHARE = 100_000, 0.05
"""Time before a deadline in which the scheduler reads the clock instead of sleeping, and its largest share of a period.

A machine wakes a sleeping process late: here 60 µs in the median and 100 to 200 µs at the 99th percentile, in C too.
"""


def minimise_timer_slack() -> None:
    """Set the timer slack of this process to its minimum on Linux, where the default is 50 µs."""
    with contextlib.suppress(OSError):
        Path("/proc/self/timerslack_ns").write_text("1", encoding="ascii")


class Rates(NamedTuple):
    """Rates of the loops; the outer loop runs in every ``divisor``-th inner tick."""

    inner_hz: float
    outer_hz: float
    divisor: int
    interval_us: int


def nearest_outer_hz(inner_hz: float) -> float:
    """Return the default outer rate: the one nearest to ``DEFAULT_OUTER_HZ`` that divides ``inner_hz``.

    Raise ConfigError.
    """
    _check_inner_hz(inner_hz)
    return inner_hz / max(1, round(inner_hz / DEFAULT_OUTER_HZ))


def rates(inner_hz: float, outer_hz: float) -> Rates:
    """Return the validated rates; raise ConfigError."""
    _check_inner_hz(inner_hz)
    interval_us = round(1e6 / inner_hz)
    if abs(interval_us * inner_hz - 1e6) > 1e-6:
        raise ConfigError(
            "--inner-hz", f"{inner_hz:g}", "does not make a whole number of microseconds per tick"
        )
    if not 0.0 < outer_hz <= inner_hz:
        raise ConfigError("--outer-hz", f"{outer_hz:g}", f"is outside 0 to the inner rate {inner_hz:g}")
    divisor = round(inner_hz / outer_hz)
    if abs(divisor * outer_hz - inner_hz) > 1e-9 * inner_hz:
        raise ConfigError("--outer-hz", f"{outer_hz:g}", f"does not divide the inner rate {inner_hz:g}")
    return Rates(inner_hz, outer_hz, divisor, interval_us)


def _check_inner_hz(inner_hz: float) -> None:
    if not MIN_INNER_HZ <= inner_hz <= MAX_INNER_HZ:
        raise ConfigError("--inner-hz", f"{inner_hz:g}", f"is outside {MIN_INNER_HZ:g} to {MAX_INNER_HZ:g}")


class Distribution(NamedTuple):
    """Statistics of a set of durations [µs]."""

    mean_us: float
    p99_us: float
    max_us: float


NO_DURATIONS = Distribution(0.0, 0.0, 0.0)


class Durations:
    """The last ``WINDOW`` durations: eight seconds of real time at 500 Hz."""

    def __init__(self) -> None:
        self._values = np.zeros(WINDOW)
        self._count = 0

    def add(self, nanoseconds: int) -> None:
        """Record one duration."""
        self._values[self._count % WINDOW] = nanoseconds
        self._count += 1

    def add_all(self, nanoseconds: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        """Record durations, the oldest first."""
        left = WINDOW - self._count % WINDOW
        for part in (nanoseconds[:left], nanoseconds[left:]):
            at = self._count % WINDOW
            self._values[at : at + len(part)] = part
            self._count += len(part)

    def figures(self) -> Distribution:
        """Return the statistics of the stored durations."""
        count = min(self._count, WINDOW)
        if count == 0:
            return NO_DURATIONS
        values = self._values[:count] * 1e-3
        return Distribution(float(values.mean()), float(np.percentile(values, 99)), float(values.max()))


class LoopTiming:
    """Statistics of ticks: execution time, lateness, overruns (longer than a period) and missed deadlines."""

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.execution = Durations()
        self.lateness = Durations()
        self.ticks = 0
        self.overruns = 0
        self.missed = 0

    def tick(self, began_ns: int, ended_ns: int) -> None:
        """Record one tick."""
        took = ended_ns - began_ns
        self.execution.add(took)
        self.ticks += 1
        if took > self.period_ns:
            self.overruns += 1

    def ticks_took(self, took_ns: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        """Record the durations of ticks, the oldest first."""
        self.execution.add_all(took_ns)
        self.ticks += len(took_ns)
        self.overruns += int(np.count_nonzero(took_ns > self.period_ns))


class DeadlineScheduler:
    """Releases ticks at fixed absolute deadlines of the monotonic clock, without drift.

    Deadlines that passed during a late tick are skipped and counted as missed.
    """

    def __init__(
        self,
        timing: LoopTiming,
        now_ns: Callable[[], int] = time.monotonic_ns,
        sleep_s: Callable[[float], None] = time.sleep,
    ) -> None:
        self._timing = timing
        self._now_ns = now_ns
        self._sleep_s = sleep_s
        self._deadline_ns = now_ns()
        self._watched_ns = min(WATCHED_NS, round(WATCHED_SHARE * timing.period_ns))

    def wait(self) -> int:
        """Wait for the next deadline; return how many periods have passed since the last one (1: on time)."""
        period = self._timing.period_ns
        self._deadline_ns += period
        periods = 1
        wake_ns = self._deadline_ns - self._watched_ns
        now = self._now_ns()
        while now < wake_ns:
            self._sleep_s((wake_ns - now) * 1e-9)
            now = self._now_ns()
        while now < self._deadline_ns:
            now = self._now_ns()
        late = now - self._deadline_ns
        self._timing.lateness.add(late)
        if late >= period:
            skipped = late // period
            self._timing.missed += skipped
            self._deadline_ns += skipped * period
            periods += skipped
        return periods


class TimingReport:
    """Timing statistics of recent ticks, for telemetry and log."""

    def __init__(self, timing: LoopTiming, rates: Rates, lockstep: bool) -> None:
        self._timing = timing
        self._rates = rates
        self._lockstep = lockstep
        self._execution = NO_DURATIONS
        self._lateness = NO_DURATIONS
        self._factor = 0.0
        self._time_us = 0
        self._last: tuple[int, float] | None = None

    def update(self, time_us: int, wall_s: float) -> None:
        """Update the statistics; the real-time factor is that since the last update."""
        self._execution = self._timing.execution.figures()
        self._lateness = self._timing.lateness.figures()
        if self._last is not None and wall_s > self._last[1]:
            self._factor = (time_us - self._last[0]) * 1e-6 / (wall_s - self._last[1])
        self._last = (time_us, wall_s)
        self._time_us = time_us

    def message(self) -> Message:
        """Return FS_LOOP_TIMING."""
        t, r, e, late = self._timing, self._rates, self._execution, self._lateness
        return FsLoopTiming(
            self._time_us, t.ticks, t.overruns, t.missed, r.inner_hz, r.outer_hz, self._factor,
            *e, *late, 0 if self._lockstep else 1,
        )  # fmt: skip

    def log_fields(self, ticks: int) -> dict[str, Any]:
        """Return the fields of the log topic ``loop_timing``: in lockstep only deterministic ones."""
        fields: dict[str, Any] = {
            "ticks": ticks,
            "inner_hz": self._rates.inner_hz,
            "outer_hz": self._rates.outer_hz,
        }
        if self._lockstep:
            return fields
        e, late = self._execution, self._lateness
        return fields | {
            "overruns": self._timing.overruns,
            "missed": self._timing.missed,
            "execution_mean_us": e.mean_us,
            "execution_p99_us": e.p99_us,
            "execution_max_us": e.max_us,
            "lateness_mean_us": late.mean_us,
            "lateness_p99_us": late.p99_us,
            "lateness_max_us": late.max_us,
            "clock": 1,
        }

"""The loops' timing as a message and as log entries."""

from __future__ import annotations

from typing import Any

from flightstack.mavlink.dialect import FsLoopTiming
from flightstack.mavlink.link import Message
from flightstack.process.clock import NO_DURATIONS, LoopTiming, Rates


class TimingReport:
    """Figures of the last few thousand ticks, refreshed by ``update``."""

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
        """Take the figures of now; the real-time factor is that since the last update."""
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
        """Return the fields of the log topic ``loop_timing``: in lockstep only what every run has in common."""
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

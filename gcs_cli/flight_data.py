"""A flight as immutable arrays: what the summary and the report are made of."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.contract import FloatArray
from flightstack.geodesy import GeoPoint, LocalFrame

FlagArray: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]

_STILL_M_S = 0.1  # slower than any descent: a vehicle that is about to be found landed stands already
_SAME_HEIGHT_M = 0.05
_REAL_TIME = 1  # clock of a loop timing


class Series(NamedTuple):
    """Samples over time: ``time_s`` of shape (n,) since the start of the log, ``values`` of shape (n, k)."""

    time_s: FloatArray
    values: FloatArray


class Status(NamedTuple):
    """What ``vehicle_status`` said from ``time_s`` on."""

    time_s: float
    nav_state: int
    armed: bool


class MissionProgress(NamedTuple):
    """What ``mission_result`` said from ``time_s`` on; ``reached`` is −1 before the first item is."""

    time_s: float
    current: int
    reached: int
    total: int
    finished: bool


class Text(NamedTuple):
    """A status text; ``level`` is its MAV_SEVERITY."""

    time_s: float
    level: int
    text: str


class LoopTiming(NamedTuple):
    """Figures of one second of wall time; ``time_s`` is the flight's, the others are in µs of wall time."""

    time_s: float
    period_us: float
    execution_mean_us: float
    execution_p99_us: float
    execution_max_us: float
    lateness_mean_us: float
    lateness_p99_us: float
    lateness_max_us: float
    real_time: bool


def loop_timing(time_s: float, inner_hz: float, figures: Sequence[float], clock: int) -> LoopTiming:
    """Return the loop timing of the figures of a message: execution, then lateness; mean, 99 %, largest."""
    period_us = 1e6 / inner_hz if inner_hz > 0.0 else math.nan
    mean, p99, largest, late_mean, late_p99, late_most = figures
    real_time = clock == _REAL_TIME
    return LoopTiming(time_s, period_us, mean, p99, largest, late_mean, late_p99, late_most, real_time)


def empty_series(columns: int) -> Series:
    """Return a series without samples, of ``columns`` values each."""
    return series(np.zeros(0), np.zeros((0, columns)))


def series(time_s: FloatArray, values: FloatArray) -> Series:
    """Return a series of two arrays that nobody can change any more."""
    time_s.flags.writeable = values.flags.writeable = False
    return Series(time_s, values)


@dataclass(frozen=True)
class Flight:
    """One flight. Positions NED [m] from the origin, velocities NED [m/s], angles roll, pitch, yaw [rad]."""

    duration_s: float = 0.0
    info: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    home: GeoPoint | None = None
    local_origin: GeoPoint | None = None
    """Origin of the local frame as the log names it; :attr:`origin` is home where it does not."""
    position: Series = field(default_factory=lambda: empty_series(3))
    velocity: Series = field(default_factory=lambda: empty_series(3))
    position_setpoint: Series = field(default_factory=lambda: empty_series(3))
    attitude: Series = field(default_factory=lambda: empty_series(3))
    attitude_target: Series = field(default_factory=lambda: empty_series(3))
    rotor_speed: Series = field(default_factory=lambda: empty_series(0))
    statuses: tuple[Status, ...] = ()
    landed: tuple[tuple[float, bool], ...] = ()
    mission: tuple[MissionProgress, ...] = ()
    texts: tuple[Text, ...] = ()
    overruns: int | None = None
    loop_timing: tuple[LoopTiming, ...] = ()
    damaged: bool = False
    """The log ends within a message, or holds what is none."""

    @property
    def origin(self) -> GeoPoint | None:
        """Where positions count from: home at the start, which may have moved since."""
        return self.local_origin or self.home

    def home_ne_m(self) -> tuple[float, float] | None:
        """Where home is, north and east of the origin [m]; None if it is not known."""
        if self.home is None or self.origin is None:
            return None
        local = LocalFrame(self.origin).to_ned(self.home)
        return local.x, local.y

    def flying(self, time_s: FloatArray) -> FlagArray:
        """Tell for each time whether the vehicle was armed and off the ground.

        A landing counts from the touchdown, not from its detection: in between the setpoint sinks into the
        ground, and that is no error of tracking.
        """
        armed = _step(((status.time_s, status.armed) for status in self.statuses), time_s)
        if not self.landed:
            return armed
        on_ground = [(self._touchdown_s(at_s) if landed else at_s, landed) for at_s, landed in self.landed]
        return armed & ~_step(on_ground, time_s)

    def standing(self, time_s: FloatArray) -> FlagArray:
        """Tell for each time whether the vehicle stood after a landing: from its touchdown until it took off again.

        Its setpoint is in the ground then, so that it stays there, and is nowhere that it shall fly to. Wind may push
        it about meanwhile: it counts from when it was as low as at the end.
        """
        again = ((self._settled_s(at_s) if landed else at_s, landed) for at_s, landed in self.landed[1:])
        return _step(again, time_s)

    def _touchdown_s(self, landed_s: float) -> float:
        """Return since when the vehicle, found to be landed at ``landed_s``, had been standing still."""
        time_s, velocity = self.velocity
        return _since(time_s, np.linalg.norm(velocity, axis=1) <= _STILL_M_S, landed_s)

    def _settled_s(self, landed_s: float) -> float:
        """Return since when the vehicle, found to be landed at ``landed_s``, had stood still or been as low as then."""
        time_s, down = self.position.time_s, self.position.values[:, 2]
        before = int(np.searchsorted(time_s, landed_s, side="right"))
        low = np.abs(down - down[before - 1]) <= _SAME_HEIGHT_M if before else np.zeros(0, dtype=bool)
        return min(self._touchdown_s(landed_s), _since(time_s, low, landed_s))

    def tracking_error(self) -> Series:
        """Distance [m] between position and setpoint while flying, shape (n, 1); a vehicle that stands does not fly."""
        time_s, position = self.position
        if not len(time_s) or not len(self.position_setpoint.time_s):
            return empty_series(1)
        setpoint = self.position_setpoint.values
        if not np.array_equal(time_s, self.position_setpoint.time_s):
            setpoint = _interpolated(self.position_setpoint, time_s)
        error = np.linalg.norm(position - setpoint, axis=1)
        flies = self.flying(time_s) & ~self.standing(time_s)
        kept = flies & np.isfinite(error)  # a setpoint may leave an axis free: NaN
        return series(time_s[kept], error[kept][:, None])


def _step(changes: Iterable[tuple[float, bool]], time_s: FloatArray) -> FlagArray:
    """Value of a flag given by its changes (time, value) at the given times; False before the first."""
    listed = list(changes)
    times = np.array([time for time, _ in listed])
    values = np.array([False, *(value for _, value in listed)])
    return values[np.searchsorted(times, time_s, side="right")]


def _since(time_s: FloatArray, flags: FlagArray, end_s: float) -> float:
    """Return since when a flag given by samples had been True without a break at ``end_s``; ``end_s`` if it was not."""
    before = int(np.searchsorted(time_s, end_s, side="right"))
    others = np.flatnonzero(~flags[:before])
    if not len(others) or others[-1] + 1 == before:
        return end_s
    return float(time_s[others[-1] + 1])


def _interpolated(series: Series, time_s: FloatArray) -> FloatArray:
    columns = [np.interp(time_s, series.time_s, column) for column in series.values.T]
    return np.column_stack(columns)

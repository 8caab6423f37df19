"""A flight as immutable arrays: what the summary and the report are made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame

FlagArray: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]

_TOUCH_M = 0.05
"""A vehicle no higher than this above where it comes to rest touches the ground: leant by 10° it stands on one leg."""
_BOUNCE_M = 0.3
"""A vehicle that rises less than this after it has touched the ground has not taken off again."""
REAL_TIME = 1  # clock of a loop timing


class Series(NamedTuple):
    """Samples over time: ``time_s`` of shape (n,) since the start of the log, ``values`` of shape (n, k)."""

    time_s: FloatArray
    values: FloatArray


class Status(NamedTuple):
    """Content of ``vehicle_status`` from ``time_s`` on."""

    time_s: float
    nav_state: int
    armed: bool
    failsafe: bool = False


class MissionProgress(NamedTuple):
    """Content of ``mission_result`` from ``time_s`` on; ``reached`` is −1 before the first item is."""

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
    """Figures of the newest 4096 ticks; ``time_s`` is the flight's, the others are in µs of wall time."""

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
    real_time = clock == REAL_TIME
    return LoopTiming(time_s, period_us, mean, p99, largest, late_mean, late_p99, late_most, real_time)


def empty_series(columns: int) -> Series:
    """Return a series without samples, of ``columns`` values each."""
    return series(np.zeros(0), np.zeros((0, columns)))


def series(time_s: FloatArray, values: FloatArray) -> Series:
    """Return a series of two read-only arrays."""
    time_s.flags.writeable = values.flags.writeable = False
    return Series(time_s, values)


class LoopSeries(NamedTuple):
    """Series at the rate of the inner loop, as in ``Flight``."""

    rotor_speed: Series
    rotor_command: Series
    torque: Series


NO_LOOPS = LoopSeries(empty_series(0), empty_series(0), empty_series(3))


@dataclass(frozen=True)
class Flight:
    """One flight. Positions NED [m] from the origin, velocities NED [m/s], angles roll, pitch, yaw [rad]."""

    start_s: float = 0.0
    """Simulated time at the start of the log, from which all other times count."""
    duration_s: float = 0.0
    info: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    home: GeoPoint | None = None
    local_origin: GeoPoint | None = None
    """Origin of the local frame as the log names it; :attr:`origin` is home where it does not."""
    position: Series = field(default_factory=lambda: empty_series(3))
    velocity: Series = field(default_factory=lambda: empty_series(3))
    position_setpoint: Series = field(default_factory=lambda: empty_series(3))
    velocity_setpoint: Series = field(default_factory=lambda: empty_series(3))
    attitude: Series = field(default_factory=lambda: empty_series(3))
    attitude_target: Series = field(default_factory=lambda: empty_series(3))
    read_loops: Callable[[], LoopSeries] = field(default=lambda: NO_LOOPS, compare=False)
    """Reads the series of the inner loop, a third of a log's numbers, when one of them is asked for."""
    battery: Series = field(default_factory=lambda: empty_series(2))
    """Remaining charge, 0 to 1, and voltage [V]; NaN where unknown."""
    true_position: Series = field(default_factory=lambda: empty_series(3))
    """True state of a vehicle that flew on its sensors, as the next two; else empty."""
    true_velocity: Series = field(default_factory=lambda: empty_series(3))
    true_attitude: Series = field(default_factory=lambda: empty_series(3))
    deviations: Series = field(default_factory=lambda: empty_series(9))
    """Standard deviations that the estimator states: attitude [rad], velocity, position, NED."""
    statuses: tuple[Status, ...] = ()
    landed: tuple[tuple[float, bool], ...] = ()
    mission: tuple[MissionProgress, ...] = ()
    texts: tuple[Text, ...] = ()
    overruns: int | None = None
    loop_timing: tuple[LoopTiming, ...] = ()
    damaged: bool = False
    """The log ends within a message, or contains invalid data."""

    @cached_property
    def _loops(self) -> LoopSeries:
        return self.read_loops()

    @property
    def rotor_speed(self) -> Series:
        """Rotor speeds [rad/s]."""
        return self._loops.rotor_speed

    @property
    def rotor_command(self) -> Series:
        """Commanded rotor speeds [rad/s]."""
        return self._loops.rotor_command

    @property
    def torque(self) -> Series:
        """Torque that the controller asks for, body FRD [N m]."""
        return self._loops.torque

    @property
    def origin(self) -> GeoPoint | None:
        """Origin of positions: home at the start, which may have moved since."""
        return self.local_origin or self.home

    def home_ne_m(self) -> tuple[float, float] | None:
        """Position of home, north and east of the origin [m]; None if unknown."""
        if self.home is None or self.origin is None:
            return None
        local = LocalFrame(self.origin).to_ned(self.home)
        return local.x, local.y

    @property
    def disarmed_in_air(self) -> bool:
        """True if the flight ended with the vehicle off the ground and disarmed."""
        return bool(self.landed and self.statuses) and not (self.landed[-1][1] or self.statuses[-1].armed)

    def flying(self, time_s: FloatArray) -> FlagArray:
        """Tell for each time whether the vehicle was armed and in flight: from the takeoff to the touchdown.

        Takeoff and landing are those of the land detector. It finds a landing some time after the touchdown, while the
        setpoint sinks into the ground, so that the flight ends when the vehicle came down.
        """
        armed = _step(((status.time_s, status.armed) for status in self.statuses), time_s)
        return armed & ~_step(self._grounded(), time_s)

    def standing(self, time_s: FloatArray) -> FlagArray:
        """Tell for each time whether the vehicle stood after a landing: its setpoint is in the ground then."""
        return _step(self._grounded()[1:], time_s)

    def _grounded(self) -> list[tuple[float, bool]]:
        """Return when the vehicle came to the ground and left it, as ``landed``."""
        left_s = (0.0, *(at_s for at_s, _ in self.landed))
        return [
            (self._touchdown_s(before_s, at_s) if landed else at_s, landed)
            for before_s, (at_s, landed) in zip(left_s, self.landed, strict=False)
        ]

    def _touchdown_s(self, left_s: float, landed_s: float) -> float:
        """Return when the vehicle, found to be landed at ``landed_s``, came down; it was in the air at ``left_s``.

        It is the first time at the height of its rest after the last that was higher than a bounce.
        """
        time_s, down = self.actual_position.time_s, self.actual_position.values[:, 2]
        first, end = np.searchsorted(time_s, (left_s, landed_s), side="right")
        if first >= end:
            return landed_s
        height = down[end - 1] - down[first:end]
        above = np.flatnonzero(height > _BOUNCE_M)
        begin = above[-1] + 1 if len(above) else 0
        touching = np.flatnonzero(height[begin:] <= _TOUCH_M)
        return float(time_s[first + begin + touching[0]]) if len(touching) else landed_s

    @cached_property
    def actual_position(self) -> Series:
        """True positions at the times of ``position`` where the log has them, else ``position``."""
        return self._actual(self.position, self.true_position)

    @cached_property
    def actual_velocity(self) -> Series:
        """True velocities at the times of ``velocity`` where the log has them, else ``velocity``."""
        return self._actual(self.velocity, self.true_velocity)

    @property
    def actual_attitude(self) -> Series:
        """True attitudes at times of their own where the log has them, else ``attitude``."""
        return self.true_attitude if len(self.true_attitude.time_s) else self.attitude

    @staticmethod
    def _actual(known: Series, true: Series) -> Series:
        if not len(true.time_s):
            return known
        return series(known.time_s, _interpolated(true, known.time_s))

    def position_error(self) -> Series:
        """Setpoint minus position NED [m] while flying, shape (n, 3); NaN on an axis that the setpoint leaves free.

        The position is the one that the vehicle knows: an estimate, if it flew on its sensors.
        """
        return self._setpoint_minus(self.position)

    def actual_error(self) -> Series:
        """Distance [m] between actual position and setpoint while flying, shape (n, 1)."""
        return _distance(self._setpoint_minus(self.actual_position))

    def _setpoint_minus(self, known: Series) -> Series:
        time_s, position = known
        if not len(time_s) or not len(self.position_setpoint.time_s):
            return empty_series(3)
        setpoint = self.position_setpoint.values
        if not np.array_equal(time_s, self.position_setpoint.time_s):
            setpoint = _interpolated(self.position_setpoint, time_s)
        flying = self.flying(time_s)
        return series(time_s[flying], (setpoint - position)[flying])

    def tracking_error(self) -> Series:
        """Distance [m] between position, as the vehicle knows it, and setpoint while flying, shape (n, 1)."""
        return _distance(self.position_error())


def _step(changes: Iterable[tuple[float, bool]], time_s: FloatArray) -> FlagArray:
    """Value of a flag given by its changes (time, value) at the given times; False before the first."""
    listed = list(changes)
    times = np.array([time for time, _ in listed])
    values = np.array([False, *(value for _, value in listed)])
    return values[np.searchsorted(times, time_s, side="right")]


def _distance(error: Series) -> Series:
    distance = np.linalg.norm(error.values, axis=1)
    kept = np.isfinite(distance)
    return series(error.time_s[kept], distance[kept][:, None])


def _interpolated(series: Series, time_s: FloatArray) -> FloatArray:
    columns = [np.interp(time_s, series.time_s, column) for column in series.values.T]
    return np.column_stack(columns)

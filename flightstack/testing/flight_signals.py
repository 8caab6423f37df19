"""The signals of a flight from its log, each made when it is first asked for: few are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.enums import NAVIGATION_STATE
from flightstack.testing.expression import SIGNALS
from flightstack.testing.log import Log
from gcs_cli.report.flight_data import Flight as FlightData

IndexArray: TypeAlias = np.ndarray[Any, np.dtype[np.intp]]
MODES = {number: mode.name for mode, number in NAVIGATION_STATE.items()}
"""Flight modes by the number in the log."""


class FlightSignals(Mapping[str, Any]):
    """Arrays by the names of ``SIGNALS``, each of shape (n,), at the times of ``vehicle_local_position``."""

    def __init__(self, data: FlightData, log: Log, start_ned_m: FloatArray) -> None:
        """``start_ned_m`` is where the vehicle started in its local frame, shape (3,)."""
        self.data, self.log, self._start_ned_m = data, log, start_ned_m
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            self._made[name] = MAKERS[name](self)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(SIGNALS)

    def __len__(self) -> int:
        return len(SIGNALS)

    def __reduce__(self) -> Any:
        return dict, (dict(self),)  # a copy, also in another process, does without the log

    @property
    def times_s(self) -> FloatArray:
        """Times since the start of the log, shape (n,)."""
        return self.data.actual_position.time_s

    @property
    def position_ned_m(self) -> FloatArray:
        """Position in the local frame, shape (n, 3)."""
        return self.data.actual_position.values

    @property
    def velocity_ned_m_s(self) -> FloatArray:
        """Velocity, shape (n, 3)."""
        return self.data.actual_velocity.values

    @cached_property
    def from_start_ned_m(self) -> FloatArray:
        """Position from the place of the start, shape (n, 3)."""
        return self.position_ned_m - self._start_ned_m

    @cached_property
    def angles_deg(self) -> FloatArray:
        """Roll, pitch and yaw, shape (n, 3)."""
        attitude = self.data.actual_attitude
        angles_deg: FloatArray = np.degrees(attitude.values[_newest(attitude.time_s, self.times_s)])
        return angles_deg

    @cached_property
    def _status(self) -> IndexArray:
        return _newest([status.time_s for status in self.data.statuses], self.times_s)

    def of_status(self, values: Sequence[Any]) -> Any:
        """Return the values of the newest status at each time, of a value for each status."""
        return np.array(values)[self._status]


def _landed(signals: FlightSignals) -> Any:
    landed = signals.data.landed
    return np.array([flag for _, flag in landed])[_newest([at_s for at_s, _ in landed], signals.times_s)]


def _item(signals: FlightSignals) -> Any:
    mission = signals.data.mission
    items = np.array([progress.current if progress.total else -1 for progress in mission])
    return items[_newest([progress.time_s for progress in mission], signals.times_s)]


def _distance_to_home_m(signals: FlightSignals) -> FloatArray:
    home = np.array(signals.data.home_ne_m() or (0.0, 0.0))
    distance_m: FloatArray = np.sqrt(np.square(signals.position_ned_m[:, :2] - home).sum(axis=1))
    return distance_m


def _error_m(signals: FlightSignals) -> FloatArray:
    times_s, setpoints = signals.times_s, signals.data.position_setpoint
    setpoint = setpoints.values[_newest(setpoints.time_s, times_s)]
    distance_m = np.linalg.norm(setpoint - signals.position_ned_m, axis=1)
    return np.where(signals.data.flying(times_s), distance_m, 0.0)


def _battery_percent(signals: FlightSignals) -> FloatArray:
    time_s = signals["time_s"]
    if "battery_status" not in signals.log:
        return np.full(len(time_s), math.nan)
    battery = signals.log["battery_status"]
    percent: FloatArray = 100.0 * battery["remaining"][_newest(battery.time_s, time_s)].astype(float)
    return percent


MAKERS: dict[str, Callable[[FlightSignals], Any]] = {
    "time_s": lambda signals: signals.times_s + signals.data.start_s,
    "mode": lambda signals: signals.of_status([MODES.get(s.nav_state, "") for s in signals.data.statuses]),
    "armed": lambda signals: signals.of_status([s.armed for s in signals.data.statuses]),
    "landed": _landed,
    "failsafe": lambda signals: signals.of_status([s.failsafe for s in signals.data.statuses]),
    "item": _item,
    "altitude_m": lambda signals: -signals.from_start_ned_m[:, 2],
    "north_m": lambda signals: signals.from_start_ned_m[:, 0],
    "east_m": lambda signals: signals.from_start_ned_m[:, 1],
    "speed_m_s": lambda signals: np.sqrt(
        signals.velocity_ned_m_s[:, 0] ** 2 + signals.velocity_ned_m_s[:, 1] ** 2
    ),
    "climb_m_s": lambda signals: -signals.velocity_ned_m_s[:, 2],
    "roll_deg": lambda signals: signals.angles_deg[:, 0],
    "pitch_deg": lambda signals: signals.angles_deg[:, 1],
    "yaw_deg": lambda signals: signals.angles_deg[:, 2],
    "distance_to_home_m": _distance_to_home_m,
    "error_m": _error_m,
    "battery_percent": _battery_percent,
}
"""How each of ``SIGNALS`` is made."""


def _newest(times_s: Sequence[float] | FloatArray, at_s: FloatArray) -> IndexArray:
    """Return for each time the index of the newest sample, the first one before it."""
    return np.maximum(np.searchsorted(np.asarray(times_s) - 1e-9, at_s, side="right") - 1, 0)

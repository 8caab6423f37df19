"""Read a flight's log (ULog) for the summary and the report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray
from flightstack.core.errors import ConfigError
from flightstack.core.geodesy import GeoPoint
from flightstack.core.geometry_bulk import euler_from_quaternions
from gcs_cli.logs.ulog_parser import DAMAGE, NO_DATA, ParsedLog, parse_ulog
from gcs_cli.report.flight_data import (
    REAL_TIME,
    Flight,
    LoopSeries,
    LoopTiming,
    MissionProgress,
    Series,
    Status,
    Text,
    empty_series,
    loop_timing,
    series,
)

_ARMED = 2  # vehicle_status.arming_state
_TIMING_FIELDS = LoopTiming._fields[2:8]  # execution and lateness
_TOPICS = [
    "vehicle_local_position",
    "trajectory_setpoint",
    "vehicle_attitude",
    "vehicle_attitude_groundtruth",
    "vehicle_local_position_groundtruth",
    "estimator_states",
    "vehicle_attitude_setpoint",
    "rotor_speeds",
    "wrench",
    "vehicle_status",
    "vehicle_land_detected",
    "mission_result",
    "home_position",
    "battery_status",
    "loop_timing",
]


def read_flight(path: Path) -> Flight:
    """Read a ULog file, complete or cut off; raise ConfigError when it is none, or has no data."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror}") from error
    parsed = parse_ulog(content, path, _TOPICS)
    if not parsed.has_data and not parse_ulog(content, path).has_data:
        raise ConfigError(path, "", NO_DATA)
    return flight_in(parsed, path)


def flight_of(content: bytes, source: object) -> Flight:
    """Read the bytes of a ULog file, complete or cut off; raise ConfigError, which names ``source``."""
    return flight_in(parse_ulog(content, source, _TOPICS), source)


def flight_in(parsed: ParsedLog, source: object) -> Flight:
    """Read the flight of a parsed log; raise ConfigError, which names ``source``."""
    try:
        flight = _Reader(parsed.log).flight()
    except DAMAGE as error:
        raise ConfigError(source, "", f"is not a readable flight log: {error}") from error
    return replace(flight, damaged=parsed.damaged)


class _Reader:
    """Takes a flight out of a parsed log; topics that are not there give empty series."""

    def __init__(self, log: Any) -> None:
        self._log = log
        self._start_us = log.start_timestamp
        instances = sorted(log.data_list, key=lambda item: item.multi_id, reverse=True)
        self._data: dict[str, Mapping[str, Any]] = {
            item.name: item.data for item in instances
        }  # the first one counts

    def flight(self) -> Flight:
        log = self._log
        return Flight(
            start_s=self._start_us * 1e-6,
            duration_s=(log.last_timestamp - self._start_us) * 1e-6,
            info=MappingProxyType(dict(log.msg_info_dict)),
            parameters=MappingProxyType(dict(log.initial_parameters)),
            home=self._home(),
            local_origin=self._origin(),
            position=self._series("vehicle_local_position", ["x", "y", "z"]),
            velocity=self._series("vehicle_local_position", ["vx", "vy", "vz"]),
            position_setpoint=self._series("trajectory_setpoint", _elements("position", 3)),
            velocity_setpoint=self._series("trajectory_setpoint", _elements("velocity", 3)),
            attitude=self._euler("vehicle_attitude", "q"),
            attitude_target=self._euler("vehicle_attitude_setpoint", "q_d"),
            read_loops=self._loops,
            battery=self._series("battery_status", ["remaining", "voltage_v"]),
            true_position=self._truth("x", "y", "z"),
            true_velocity=self._truth("vx", "vy", "vz"),
            true_attitude=self._euler("vehicle_attitude_groundtruth", "q"),
            deviations=self._deviations(),
            statuses=self._statuses(),
            landed=tuple(
                (time_s, bool(landed)) for time_s, landed in self._rows("vehicle_land_detected", "landed")
            ),
            mission=self._mission(),
            texts=tuple(
                Text((item.timestamp - self._start_us) * 1e-6, item.log_level - ord("0"), item.message)
                for item in log.logged_messages
            ),
            overruns=self._overruns(),
            loop_timing=self._loop_timing(),
        )

    def _loops(self) -> LoopSeries:
        rotors = self._rotor_count()
        return LoopSeries(
            rotor_speed=self._series("rotor_speeds", _elements("speed_rad_s", rotors)),
            rotor_command=self._series("rotor_speeds", _elements("command_rad_s", rotors)),
            torque=self._series("wrench", _elements("torque_n_m", 3)),
        )

    def _statuses(self) -> tuple[Status, ...]:
        return tuple(
            Status(time_s, int(state), arming == _ARMED, bool(failsafe))
            for time_s, state, arming, failsafe in self._rows(
                "vehicle_status", "nav_state", "arming_state", "failsafe"
            )
        )

    def _mission(self) -> tuple[MissionProgress, ...]:
        return tuple(
            MissionProgress(time_s, int(current), int(reached), int(total), bool(finished))
            for time_s, current, reached, total, finished in self._rows(
                "mission_result", "seq_current", "seq_reached", "seq_total", "finished"
            )
        )

    def _loop_timing(self) -> tuple[LoopTiming, ...]:
        return tuple(
            loop_timing(time_s, inner_hz, figures, int(clock))
            for time_s, inner_hz, clock, *figures in self._rows(
                "loop_timing", "inner_hz", "clock", *_TIMING_FIELDS
            )
            if math.isfinite(figures[0])  # in lockstep the log has only counts
        )

    def _time_s(self, data: Mapping[str, Any]) -> FloatArray:
        return (data["timestamp"].astype(np.int64) - self._start_us) * 1e-6  # type: ignore[no-any-return]

    def _rotor_count(self) -> int:
        data = self._data.get("rotor_speeds", {})
        return sum(name in data for name in _elements("speed_rad_s", MAX_ROTORS))

    def _series(self, topic: str, fields: list[str]) -> Series:
        data = self._data.get(topic)
        if data is None or any(name not in data for name in fields):
            return empty_series(len(fields))
        values = np.empty((len(data["timestamp"]), len(fields)))
        for index, name in enumerate(fields):
            values[:, index] = data[name]
        return series(self._time_s(data), values)

    def _euler(self, topic: str, quaternion: str) -> Series:
        time_s, q = self._series(topic, _elements(quaternion, 4))
        return series(time_s.copy(), euler_from_quaternions(q))

    def _truth(self, *fields: str) -> Series:
        """Return true values if the log has true attitudes at the same times."""
        times_s = self._series("vehicle_attitude_groundtruth", _elements("q", 4)).time_s
        found = self._series("vehicle_local_position_groundtruth", list(fields))
        return found if np.array_equal(found.time_s, times_s) else empty_series(len(fields))

    def _deviations(self) -> Series:
        """Return the deviations of a log of this flight stack: PX4 has four variances of the attitude up to 1.14."""
        is_own = self._log.msg_info_dict.get("sys_name") == "flightstack"
        time_s, variances = self._series("estimator_states", _elements("covariances", 9))
        return series(time_s.copy(), np.sqrt(np.maximum(variances, 0.0))) if is_own else empty_series(9)

    def _rows(self, topic: str, *fields: str) -> list[tuple[float, ...]]:
        data = self._data.get(topic)
        if data is None or any(name not in data for name in fields):
            return []
        return list(zip(self._time_s(data).tolist(), *(data[name].tolist() for name in fields), strict=True))

    def _home(self) -> GeoPoint | None:
        rows = self._rows("home_position", "lat", "lon", "alt")
        return GeoPoint(*rows[-1][1:]) if rows else None

    def _origin(self) -> GeoPoint | None:
        places = self._series("vehicle_local_position", ["ref_lat", "ref_lon", "ref_alt"]).values
        known = np.isfinite(places).all(axis=1)
        return GeoPoint(*places[known.argmax()].tolist()) if known.any() else None

    def _overruns(self) -> int | None:
        rows = self._rows("loop_timing", "overruns", "clock")
        is_real_time = bool(rows) and rows[-1][2] == REAL_TIME
        return int(rows[-1][1]) if is_real_time else None


def _elements(name: str, count: int) -> list[str]:
    return [f"{name}[{index}]" for index in range(count)]

"""Values of the messages of motion, read from the vehicle by one compiled call a poll."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, Protocol

import numpy as np

from flightstack.core.array_items import as_tuple, store
from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import (
    MAX_ROTORS,
    SETPOINT_SIZE,
    FloatArray,
    LoopRow,
    Record,
    RecordArray,
    Vector3,
)
from flightstack.core.geodesy import GeoPoint, LocalFrame, geographic
from flightstack.core.portable_math import distance, euler_angles
from flightstack.core.record_types import dtype_of
from flightstack.mavlink.dialect import mavlink
from flightstack.services.telemetry.fields import DEGREES, wrapped
from flightstack.vehicle.flight_state import FlightState
from flightstack.vehicle.status import SINGLE_LIMIT, VehicleInfo

_REFERENCE_RATES, _THRUST = LoopRow.REFERENCE_RATES.start, LoopRow.WRENCH_ACHIEVED.start
_ROTOR_COMMAND = LoopRow.ROTOR_COMMAND.start


class MotionValues(NamedTuple):
    """Values in the units of messages. Whole ones are rounded when they are packed."""

    time_us: float
    time_32_us: float
    """Wrapped to 32 bits, and so ``boot_ms``."""
    boot_ms: float
    position: Annotated[FloatArray, 3]
    velocity: Annotated[FloatArray, 3]
    attitude: Annotated[FloatArray, 4]
    rates: Annotated[FloatArray, 3]
    euler: Annotated[FloatArray, 3]
    target_attitude: Annotated[FloatArray, 4]
    target_rates: Annotated[FloatArray, 3]
    target_thrust: float
    setpoint: Annotated[FloatArray, SETPOINT_SIZE]
    latitude_1e7: float
    longitude_1e7: float
    altitude_m: float
    """Above the sea, and so ``altitude_mm``."""
    altitude_mm: float
    above_home_m: float
    above_home_mm: float
    above_origin_m: float
    velocity_cm_s: Annotated[FloatArray, 3]
    heading_deg: float
    heading_cdeg: float
    ground_speed: float
    climb: float
    throttle: float
    pulses: Annotated[FloatArray, MAX_ROTORS]
    zero: float
    unknown: float
    local_ned: float


class _Place(NamedTuple):
    """What changes rarely."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    north_m_per_deg: float
    east_m_per_deg: float
    home_altitude_m: float
    max_thrust_n: float


VALUES = dtype_of(MotionValues)
_PLACE_SIZE = len(_Place._fields)


@compiled
def _single(value: float) -> float:
    """Return infinity for a value beyond ``SINGLE_LIMIT``, as ``in_single_precision``."""
    return math.copysign(math.inf, value) if abs(value) > SINGLE_LIMIT else value


@compiled
def _limited(value: float, low: float, high: float) -> float:
    """Return ``value`` saturated, and 0 if it is not finite."""
    if not math.isfinite(value):
        return 0.0
    return low if value <= low else min(value, high)  # 0 for −0, which has other bytes


@compiled
def _copy(out: FloatArray, source: FloatArray, first: int) -> None:
    for index in range(len(out)):
        out[index] = _single(float(source[first + index]))


@compiled
def read_motion(
    row: FloatArray,
    state: FloatArray,
    target: FloatArray,
    setpoint: FloatArray,
    top_speeds: FloatArray,
    place: FloatArray,
    values: RecordArray,
    time_us: float,
    time_32_us: float,
    boot_ms: float,
) -> None:
    """Write all values that may change."""
    v, p = values[0], _Place(*as_tuple(place, _PLACE_SIZE))
    v["time_us"], v["time_32_us"], v["boot_ms"] = time_us, time_32_us, boot_ms
    _copy(v["position"], state, 0)
    _copy(v["velocity"], state, 3)
    _copy(v["attitude"], state, 6)
    _copy(v["rates"], state, 10)
    _copy(v["target_attitude"], target, 0)
    _copy(v["target_rates"], row, _REFERENCE_RATES)
    _copy(v["setpoint"], setpoint, 0)
    v["target_thrust"] = _limited(_single(float(target[4])) / p.max_thrust_n, 0.0, 1.0)
    v["throttle"] = _limited(100.0 * float(row[_THRUST]) / p.max_thrust_n, 0.0, 100.0)
    for rotor in range(len(top_speeds)):
        share = float(row[_ROTOR_COMMAND + rotor]) / top_speeds[rotor]
        v["pulses"][rotor] = 1000.0 + np.rint(1000.0 * _limited(share, 0.0, 1.0))
    _read_attitude(v)
    _read_velocity(v)
    _read_place(v, p)


@compiled
def _read_attitude(v: Record) -> None:
    q = as_tuple(v["attitude"], 4)
    roll, pitch, yaw = euler_angles(*q)
    store(v["euler"], (roll, pitch, yaw))
    heading_deg = yaw * DEGREES % 360.0 if math.isfinite(q[0]) else 0.0
    v["heading_deg"] = heading_deg
    v["heading_cdeg"] = _limited(100.0 * heading_deg, 0.0, 35999.0)


@compiled
def _read_place(v: Record, place: _Place) -> None:
    north, east, down = as_tuple(v["position"], 3)
    origin = GeoPoint(place.latitude_deg, place.longitude_deg, place.altitude_m)
    scales = place.north_m_per_deg, place.east_m_per_deg
    point = geographic(origin, scales, Vector3(north, east, down))
    above_home_m = point.altitude_m - place.home_altitude_m
    v["latitude_1e7"], v["longitude_1e7"] = point.latitude_deg * 1e7, point.longitude_deg * 1e7
    v["altitude_m"], v["altitude_mm"] = point.altitude_m, point.altitude_m * 1e3
    v["above_home_m"], v["above_home_mm"] = above_home_m, above_home_m * 1e3
    v["above_origin_m"] = -down


@compiled
def _read_velocity(v: Record) -> None:
    north, east, down = as_tuple(v["velocity"], 3)
    store(v["velocity_cm_s"], (north * 100.0, east * 100.0, down * 100.0))
    v["ground_speed"], v["climb"] = distance(north, east), -down


class Places(Protocol):
    """Origin of the local frame, and home."""

    frame: LocalFrame
    home_point: GeoPoint


class Motion:
    """Reads the values of the newest tick."""

    def __init__(self, now: FlightState, places: Places, info: VehicleInfo) -> None:
        self._now, self._places, self._max_thrust_n = now, places, info.max_thrust_n
        self._seen: tuple[GeoPoint, GeoPoint] | None = None
        self._place, self.values = np.zeros(_PLACE_SIZE), np.zeros(1, VALUES)
        self._top_speeds = np.array(info.top_speed_rad_s)
        self.values["unknown"], self.values["local_ned"] = math.nan, mavlink.MAV_FRAME_LOCAL_NED
        self._constant = (
            now.state,
            now.attitude_target,
            now.setpoint,
            self._top_speeds,
            self._place,
            self.values,
        )
        self._read = direct(read_motion, now.row, *self._constant, 0.0, 0.0, 0.0)

    def read(self) -> None:
        """Read the values of now."""
        frame, home = self._places.frame, self._places.home_point
        if self._seen != (frame.origin, home):
            self._seen = frame.origin, home
            self._place[:] = *frame.origin, *frame.scales, home.altitude_m, self._max_thrust_n
        row, time_us = self._now.row, self._now.time_us
        self._read(row, *self._constant, time_us, wrapped(time_us), wrapped(time_us // 1000))

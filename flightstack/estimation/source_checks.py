"""Checks of the sensors against each other: accelerometer, gyro, barometer, GNSS velocity and GNSS position.

The mean of the normalised innovations of a sensor is near zero if filter and sensor agree, whatever the noise. A fault
shows in the signs of several means, as in PX4's check of the vertical acceleration
(``Ekf::estimateInertialNavFallingLikelihood``): if GNSS and barometer contradict the prediction alike, the
accelerometer is wrong; if velocity and position of GNSS do, or the yaw of the magnetometer leaves the estimate on a
constant heading, the gyro is. Position and velocity of GNSS are compared with each other, over 20 s, and so is the
pressure altitude with the vertical velocity: where they drift apart, the height of GNSS tells which one is wrong.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, Vector3
from flightstack.core.geometry import rotate
from flightstack.estimation.error_state import (
    ACCEL_BIAS,
    ATTITUDE,
    BARO_BIAS,
    ERROR_STATES,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
)
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    MAG,
    REST_RATE,
    Filter,
    clear,
    correlation_factor,
)

CONSISTENT, POSITION_DRIFTS, VELOCITY_IS_WRONG = 0.0, 1.0, 2.0
"""Faults of GNSS along an axis."""

_LEAST_VARIANCE = 1e-12
_MEAN_S, _LARGEST = 1.0, 3.0
"""Time constant of a mean, and the largest normalised innovation that counts."""
_LIMIT = 1.0
"""Mean of white innovations: 0.22 (GNSS, 10 Hz) or 0.17 (means of the barometer, 17 Hz)."""
_ACCEL_HOLD_S, _BARO_HOLD_S = 1.0, 10.0
_APART_M, _SURELY_APART_M, _LARGEST_CHANGE_M, _SIDES, _NOISE_SHARE, _MISSING_S = 1.5, 2.0, 0.5, 0.7, 3.0, 0.5
"""Drift between barometer and GNSS velocity from which the barometer, and from which the velocity counts as wrong;
change of the altitude between two measurements that counts at most; share of the drift from which the height of GNSS
sides with the barometer; deviations of the drift by the noise of the velocity; age of an altitude that is missing.
A barometer that is blamed wrongly costs little: GNSS holds the height meanwhile."""
_ACCEL_DENSITY, _ACCEL_BIAS_DENSITY, _BARO_DENSITY, _HEIGHT_DENSITY = 1.0, 0.25, 0.25, 0.1
"""Variance per second that a wrong sensor adds to vertical velocity, accelerometer bias, barometer bias and height."""
WRONG_VELOCITY_M_S = 2.0
"""Least noise of a GNSS velocity that contradicts other sensors; after the fault the filter learns a smaller one."""
_SPEED_LIMIT, _PLACE_LIMIT = 0.8, 0.3
"""Means of velocity and position of GNSS, alike, from which the gyro counts as wrong about a horizontal axis."""
_STEP_RAD_S, _STEP_S, _STEPS_S = 0.025, 2.0, 1.0
"""Step of a gyro's bias [1σ], its age when it is found, and the least time between two."""
_YAW_MEAN_S, _YAW_LIMIT_RAD, _STRAIGHT_RAD_S, _TURN_SHARE = 10.0, 0.0175, 0.05, 0.8
"""Time in which the yaw of the magnetometer leaves the estimate if the gyro is wrong about the vertical, and the limit;
rate of a turn, in which soft iron does the same; least share of a turn in the square of the innovations."""
_REST_SHARE, _MOVED_RAD_S = 0.02, 0.01
"""Share of a rate at rest in their mean, over 5 s: a vehicle sways faster; the rate from which it is moved."""
_STUCK_S, _EQUAL_M = 1.0, 1e-9
_DRIFT_S, _LONGEST_GAP_S, _DRIFT_ACCURACIES, _LEAST_ACCURACY_M = 20.0, 2.0, 4.0, 0.5
"""The least accuracy keeps the errors of the velocity of a receiver with centimetres from counting as a drift."""
_HEIGHT_MEAN_S = 2.0
_ONSET_LASTS_S = 40.0
"""Time for which a contradiction of GNSS velocity counts as the start of a drift: that of the slowest one, which
takes so long to exceed the limit."""


class Checks(NamedTuple):
    """What the checks remember of the sensors."""

    speed: float
    """Mean of the innovations of the vertical velocity of GNSS, upwards; the next two are of heights."""
    height: float
    pressure: float
    accel_until_s: float
    """Time until which the accelerometer counts as wrong."""
    baro_until_s: float
    altitude_m: float
    """Of the barometer, equal since the next one."""
    equal_since_s: float
    gnss_s: float
    """Time, position and velocity of the last measurement of GNSS."""
    place_m: Annotated[FloatArray, 3]
    velocity_m_s: Annotated[FloatArray, 3]
    drift_m: Annotated[FloatArray, 3]
    """Of the position of GNSS from its velocity."""
    fault: Annotated[FloatArray, 3]
    """Fault of each axis of GNSS."""
    baro_drift_m: float
    """Of the barometer, downwards, from the velocity of GNSS."""
    sideways: Annotated[FloatArray, 2]
    """Means of the innovations of GNSS velocity along north and east."""
    places: Annotated[FloatArray, 2]
    """The same of GNSS position."""
    gyro_s: float
    """Time at which the gyro was found wrong last."""
    rates: Annotated[FloatArray, 3]
    """Means of the innovations of the rate at rest."""
    yaw_now_rad: float
    """Yaw of the magnetometer beyond the estimate."""
    yaw_rad: float
    """Its mean over 1 s."""
    yaw_then_rad: float
    """The same over 10 s."""
    field_s: float
    """Time of the last one."""
    onset_s: Annotated[FloatArray, 2]
    """Time at which GNSS velocity contradicted the prediction last, with the sign of its error."""
    altitude_s: float
    """Time of the last altitude."""
    altitude_then_m: float
    """At the last measurement of GNSS."""
    altitude_now_m: float
    had_altitude: float
    """1 if there was an altitude at the last measurement of GNSS."""
    height_drift_m: float
    """Mean of the drift of GNSS height over 2 s."""


ChecksRecord: TypeAlias = Annotated[Record, Checks]


@compiled
def _mean(mean: float, f: Filter, row: int, sign: float, dt_s: float) -> float:
    """Return a mean of innovations upwards with the newest one of a row."""
    o = f.observations[row]
    variance = max(o["variance"], _LEAST_VARIANCE)  # 0 before the first fusion
    value = sign * o["innovation"] / math.sqrt(variance)
    value = min(max(value, -_LARGEST), _LARGEST)
    made: float = mean + min(dt_s / _MEAN_S, 1.0) * (value - mean)
    return made


@compiled
def take_pressure_innovation(c: ChecksRecord, f: Filter, measured_s: float, altitude_m: float) -> None:
    """Take the barometer's newest innovation, of an altitude measured at ``measured_s``."""
    c["pressure"] = _mean(c["pressure"], f, BARO, 1.0, max(0.0, measured_s - c["altitude_s"]))
    c["altitude_s"], c["altitude_now_m"] = measured_s, altitude_m


@compiled
def take_horizontal_innovations(c: ChecksRecord, f: Filter, dt_s: float, gravity: float) -> None:
    """Take the horizontal innovations of GNSS, and note when those of the velocity contradict the prediction.

    If those of the position do so alike, the gyro is wrong.
    """
    is_wrong = False
    for axis in range(2):
        mean = _mean(c["sideways"][axis], f, GNSS_VELOCITY + axis, 1.0, dt_s)
        place = _mean(c["places"][axis], f, GNSS_POSITION + axis, 1.0, dt_s)
        c["sideways"][axis], c["places"][axis] = mean, place
        if abs(mean) > _LIMIT:
            c["onset_s"][axis] = f.clock[0] if mean > 0.0 else -f.clock[0]
        if abs(mean) > _SPEED_LIMIT and abs(place) > _PLACE_LIMIT and mean * place > 0.0:
            is_wrong = True
    if is_wrong and f.clock[0] - c["gyro_s"] > _STEPS_S:
        c["gyro_s"] = f.clock[0]
        for axis in range(2):
            _doubt_gyro(f, axis, gravity)


@compiled
def take_rest_innovation(c: ChecksRecord, f: Filter, axis: int) -> None:
    """Take the innovation of the rate at rest: if its mean is beyond the noise, the bias is learnt anew.

    The bias is known no better than the mean of all rates with their present noise: a vehicle that sways looks like one
    that stands, at first.
    """
    o, at, p = f.observations[REST_RATE + axis], GYRO_BIAS + axis, f.covariance
    p[at, at] = max(p[at, at], o["noise"] * correlation_factor(o) / max(o["fused"], 1.0))
    c["rates"][axis] = _mean(c["rates"][axis], f, REST_RATE + axis, 1.0, _REST_SHARE * _MEAN_S)
    if abs(c["rates"][axis]) > _LIMIT and abs(o["innovation"]) < _MOVED_RAD_S:
        c["rates"][axis] = 0.0
        p[at, at] += _MOVED_RAD_S * _MOVED_RAD_S


@compiled
def _attitude(f: Filter) -> Quaternion:
    return Quaternion(f.nominal[0], f.nominal[1], f.nominal[2], f.nominal[3])


@compiled
def _doubt_gyro(f: Filter, axis: int, gravity: float) -> None:
    """Add the uncertainty of a gyro whose bias about an axis of the body has stepped some time ago.

    Since then it has turned the attitude, and so the specific force of a vehicle that hardly accelerates: errors of
    attitude, velocity and position are added as one with that of the bias. The filter learns it from each of them, and
    stays as certain of the rest.
    """
    unit = Vector3(1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
    about, step = rotate(_attitude(f), unit), f.h
    turn, speed = -_STEP_S, 0.5 * gravity * _STEP_S * _STEP_S
    place = speed * _STEP_S / 3.0
    clear(step)
    step[ATTITUDE], step[ATTITUDE + 1], step[ATTITUDE + 2] = turn * about.x, turn * about.y, turn * about.z
    step[VELOCITY], step[VELOCITY + 1] = speed * about.y, -speed * about.x
    step[POSITION], step[POSITION + 1] = place * about.y, -place * about.x
    step[GYRO_BIAS + axis] = 1.0
    for i in range(ERROR_STATES):
        share = _STEP_RAD_S * _STEP_RAD_S * step[i]
        if share != 0.0:
            for j in range(i, ERROR_STATES):
                f.covariance[i, j] += share * step[j]


@compiled
def take_field_innovations(c: ChecksRecord, f: Filter, rate_rad_s: float, gravity: float) -> None:
    """Take the innovations of the magnetometer: if its yaw leaves the estimate without a turn, the gyro is wrong.

    A disturbed field jumps, or changes along other axes too.
    """
    o, x = f.observations, f.nominal
    innovation = Vector3(o[MAG]["innovation"], o[MAG + 1]["innovation"], o[MAG + 2]["innovation"])
    off = rotate(_attitude(f), innovation)
    level = math.sqrt(x[16] * x[16] + x[17] * x[17]) + _LEAST_VARIANCE
    across = (x[17] * off.x - x[16] * off.y) / level
    yaw_rad, change_s = across / level, min(max(f.clock[0] - c["field_s"], 0.0), _MEAN_S)
    jumps = abs(yaw_rad - c["yaw_now_rad"]) > _YAW_LIMIT_RAD or change_s >= _MEAN_S
    c["field_s"], c["yaw_now_rad"] = f.clock[0], yaw_rad
    c["yaw_rad"] = yaw_rad if jumps else c["yaw_rad"] + change_s / _MEAN_S * (yaw_rad - c["yaw_rad"])
    c["yaw_then_rad"] += change_s / _YAW_MEAN_S * (c["yaw_rad"] - c["yaw_then_rad"])
    if jumps or abs(rate_rad_s) > _STRAIGHT_RAD_S:
        c["yaw_then_rad"] = c["yaw_rad"]
    grown, square = c["yaw_rad"] - c["yaw_then_rad"], off.x * off.x + off.y * off.y + off.z * off.z
    is_turn = across * across > _TURN_SHARE * square and grown * c["yaw_rad"] > 0.0
    if abs(grown) > _YAW_LIMIT_RAD and is_turn:
        c["yaw_then_rad"] = c["yaw_rad"]
        _doubt_gyro(f, 2, gravity)


@compiled
def take_gnss_innovations(c: ChecksRecord, f: Filter, dt_s: float, has_baro: bool) -> None:
    """Take the vertical innovations of GNSS, and decide whether the accelerometer is wrong."""
    c["speed"] = _mean(c["speed"], f, GNSS_VELOCITY + 2, -1.0, dt_s)
    c["height"] = _mean(c["height"], f, GNSS_POSITION + 2, -1.0, dt_s)
    up = 1.0 if c["speed"] >= 0.0 else -1.0
    second = c["pressure"] if has_baro else c["height"]
    if min(up * c["speed"], up * second) > _LIMIT:
        c["accel_until_s"] = f.clock[0] + _ACCEL_HOLD_S


@compiled
def add_fault_noise(c: ChecksRecord, f: Filter, dt_s: float) -> None:
    """Add the uncertainty of the sensors that count as wrong, so that the filter learns their error anew."""
    p = f.covariance
    if f.clock[0] < c["accel_until_s"]:
        p[VELOCITY + 2, VELOCITY + 2] += _ACCEL_DENSITY * dt_s
        p[ACCEL_BIAS + 2, ACCEL_BIAS + 2] += _ACCEL_BIAS_DENSITY * dt_s
    if f.clock[0] < c["baro_until_s"]:
        p[BARO_BIAS, BARO_BIAS] += _BARO_DENSITY * dt_s
        p[POSITION + 2, POSITION + 2] += _HEIGHT_DENSITY * dt_s  # it has moved with the barometer


@compiled
def is_stuck(c: ChecksRecord, altitude_m: float, now_s: float) -> bool:
    """Return True if the barometer has repeated its altitude for 1 s; its noise changes each measurement."""
    if abs(altitude_m - c["altitude_m"]) > _EQUAL_M:
        c["altitude_m"], c["equal_since_s"] = altitude_m, now_s
    equal_s: float = now_s - c["equal_since_s"]
    return equal_s > _STUCK_S


@compiled
def follow_drift(c: ChecksRecord, f: Filter, row: FloatArray, eph_m: float) -> None:
    """Compare the changes of the position of a GNSS measurement with its velocity, over 20 s.

    A horizontal axis has a fault above four times the accuracy that the receiver states, and until it is below half of
    that. A jump counts as a change of one accuracy: the gate of the innovation refuses it. The barometer watches the
    height.
    """
    dt_s = row[0] - c["gnss_s"]
    accuracy_m = max(eph_m, _LEAST_ACCURACY_M)
    for axis in range(2):
        place, speed, fault = row[1 + axis], row[4 + axis], c["fault"][axis]
        if c["gnss_s"] == 0.0 or dt_s > _LONGEST_GAP_S:
            c["drift_m"][axis] = 0.0
        else:
            change = place - c["place_m"][axis] - 0.5 * dt_s * (speed + c["velocity_m_s"][axis])
            change = min(max(change, -accuracy_m), accuracy_m)
            c["drift_m"][axis] += change - min(dt_s / _DRIFT_S, 1.0) * c["drift_m"][axis]
        c["place_m"][axis], c["velocity_m_s"][axis] = place, speed
        limit_m = _DRIFT_ACCURACIES * accuracy_m * (1.0 if fault == CONSISTENT else 0.5)
        if abs(c["drift_m"][axis]) <= limit_m:
            c["fault"][axis] = CONSISTENT
        elif fault == CONSISTENT:
            _start_fault(c, f, axis)
        elif fault == POSITION_DRIFTS:
            _doubt_position(c, f, axis, dt_s)
    c["gnss_s"] = row[0]


@compiled
def follow_height_drift(c: ChecksRecord, row: FloatArray, flies: bool, accuracy_m_s: float) -> None:
    """Compare the changes of height of GNSS and barometer with the vertical velocity of GNSS, over 20 s of flight.

    ``accuracy_m_s`` is that of the velocity, whose noise adds up.
    """
    dt_s, altitude_m = row[0] - c["gnss_s"], c["altitude_now_m"]
    has_altitude = abs(row[0] - c["altitude_s"]) < _MISSING_S
    if not flies or c["gnss_s"] == 0.0 or dt_s > _LONGEST_GAP_S:
        c["drift_m"][2], c["height_drift_m"], c["baro_drift_m"] = 0.0, 0.0, 0.0
    else:
        kept, moved_m = 1.0 - min(dt_s / _DRIFT_S, 1.0), 0.5 * dt_s * (row[6] + c["velocity_m_s"][2])
        c["drift_m"][2] = kept * c["drift_m"][2] + row[3] - c["place_m"][2] - moved_m
        c["height_drift_m"] += min(dt_s / _HEIGHT_MEAN_S, 1.0) * (c["drift_m"][2] - c["height_drift_m"])
        change_m = 0.0 if c["had_altitude"] == 0.0 else c["altitude_then_m"] - altitude_m - moved_m
        change_m = min(max(change_m, -_LARGEST_CHANGE_M), _LARGEST_CHANGE_M)
        c["baro_drift_m"] = kept * c["baro_drift_m"] + change_m if has_altitude else 0.0
        _check_height(c, row[0], _NOISE_SHARE * accuracy_m_s * math.sqrt(0.5 * _DRIFT_S * dt_s))
    c["place_m"][2], c["velocity_m_s"][2], c["altitude_then_m"] = row[3], row[6], altitude_m
    c["had_altitude"] = 1.0 if has_altitude else 0.0


@compiled
def _check_height(c: ChecksRecord, now_s: float, noise_m: float) -> None:
    """Decide whether barometer or vertical GNSS velocity is wrong, beyond the noise of their drift."""
    apart_m, side = (
        abs(c["baro_drift_m"]),
        c["height_drift_m"] if c["baro_drift_m"] > 0.0 else -c["height_drift_m"],
    )
    if apart_m < 0.5 * max(_APART_M, noise_m):
        c["fault"][2] = CONSISTENT
    elif apart_m > max(_APART_M, noise_m) and side < _SIDES * apart_m:
        c["baro_until_s"], c["fault"][2] = now_s + _BARO_HOLD_S, CONSISTENT
    elif apart_m > max(_SURELY_APART_M, noise_m):
        c["fault"][2] = VELOCITY_IS_WRONG


@compiled
def _start_fault(c: ChecksRecord, f: Filter, axis: int) -> None:
    """Decide which of GNSS position and velocity is wrong along an axis.

    A velocity that becomes wrong contradicts the inertial sensor at that time, a position that begins to drift does
    not. A wrong velocity has moved position and velocity of the filter by as much as the drift, and has noise from now
    on.
    """
    drift_m, onset_s, p = c["drift_m"][axis], c["onset_s"][axis], f.covariance
    left_s = _ONSET_LASTS_S - (f.clock[0] - abs(onset_s))
    if min(left_s, -onset_s * drift_m) > 0.0:
        c["fault"][axis] = VELOCITY_IS_WRONG
        p[VELOCITY + axis, VELOCITY + axis] += drift_m * drift_m / (_DRIFT_S * _DRIFT_S)
        p[POSITION + axis, POSITION + axis] += drift_m * drift_m
    else:
        c["fault"][axis] = POSITION_DRIFTS


@compiled
def _doubt_position(c: ChecksRecord, f: Filter, axis: int, dt_s: float) -> None:
    """Let the position become uncertain at the rate of the drift, for the velocity may be wrong instead."""
    at = POSITION + axis
    grown_m = math.sqrt(f.covariance[at, at]) + abs(c["drift_m"][axis]) / _DRIFT_S * dt_s
    f.covariance[at, at] = grown_m * grown_m


@compiled
def position_drifts(c: ChecksRecord) -> bool:
    """Return True if the GNSS position drifts from its velocity along an axis."""
    north, east = c["fault"][0], c["fault"][1]
    return bool(min(abs(north - POSITION_DRIFTS), abs(east - POSITION_DRIFTS)) == 0.0)

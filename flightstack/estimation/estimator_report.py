"""Report of the estimator: flags, accuracies and ratios of innovations to their gates, read from its memory on demand.

Flags have the bits of PX4: ``SolutionFlags`` are ESTIMATOR_STATUS_FLAGS, ``ControlFlags`` and ``RejectionFlags`` those
of the topic ``estimator_status_flags``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import RecordArray
from flightstack.estimation.error_state import ATTITUDE, POSITION, WIND, Covariance
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.health import STUCK_SAMPLES
from flightstack.estimation.imu_track import IMU_MISSING_S, WINDOW, TrackArray, TrackRecord
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    HOLD_POSITION,
    MAG,
    RANGE,
    REST_VELOCITY,
)
from flightstack.estimation.memory import MemoryArray, MemoryRecord
from flightstack.mavlink.dialect import mavlink

AIDED_S = 1.0
"""Time after its last accepted measurement during which a sensor counts as fused."""
DEAD_RECKONING_S = 5.0
"""Time without an accepted measurement until a position or velocity is invalid, PX4's EKF2_NOAID_TOUT."""
_TILT_RAD, _YAW_RAD = math.radians(10.0), math.radians(15.0)
"""Deviations above which tilt and yaw are not aligned."""
_WIND_VARIANCE = 0.5
"""Variance of the wind [m²/s²] below which it is observed; without fusion of drag it stays above that at the start."""
_DELAY = EstimatorParams._fields.index("delay_s")


class SolutionFlags(NamedTuple):
    """States that are good for flight, ESTIMATOR_STATUS_FLAGS."""

    ATTITUDE: int = mavlink.ESTIMATOR_ATTITUDE
    VELOCITY_HORIZONTAL: int = mavlink.ESTIMATOR_VELOCITY_HORIZ
    VELOCITY_VERTICAL: int = mavlink.ESTIMATOR_VELOCITY_VERT
    POSITION_RELATIVE: int = mavlink.ESTIMATOR_POS_HORIZ_REL
    POSITION_ABSOLUTE: int = mavlink.ESTIMATOR_POS_HORIZ_ABS
    HEIGHT_ABSOLUTE: int = mavlink.ESTIMATOR_POS_VERT_ABS
    HEIGHT_ABOVE_GROUND: int = mavlink.ESTIMATOR_POS_VERT_AGL
    CONSTANT_POSITION: int = mavlink.ESTIMATOR_CONST_POS_MODE
    PREDICTED_RELATIVE: int = mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    PREDICTED_ABSOLUTE: int = mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
    GNSS_GLITCH: int = mavlink.ESTIMATOR_GPS_GLITCH
    ACCEL_ERROR: int = mavlink.ESTIMATOR_ACCEL_ERROR


class ControlFlags(NamedTuple):
    """Alignment and sensors in use, by the bits of ``control_mode_flags``."""

    TILT_ALIGN: int = 1 << 0
    YAW_ALIGN: int = 1 << 1
    GNSS_POSITION: int = 1 << 2
    MAG_3D: int = 1 << 5
    IN_AIR: int = 1 << 7
    WIND: int = 1 << 8
    BARO_HEIGHT: int = 1 << 9
    RANGE_HEIGHT: int = 1 << 10
    GNSS_HEIGHT: int = 1 << 11
    MAG_FAULT: int = 1 << 18
    VEHICLE_AT_REST: int = 1 << 26
    INERTIAL_DEAD_RECKONING: int = 1 << 29
    FAKE_POSITION: int = 1 << 32
    GNSS_VELOCITY: int = 1 << 44


class RejectionFlags(NamedTuple):
    """Newest measurements beyond their gates, by the bits of PX4's innovation faults."""

    VELOCITY_HORIZONTAL: int = 1 << 0
    VELOCITY_VERTICAL: int = 1 << 1
    POSITION_HORIZONTAL: int = 1 << 2
    POSITION_VERTICAL: int = 1 << 3
    MAG_X: int = 1 << 4
    MAG_Y: int = 1 << 5
    MAG_Z: int = 1 << 6
    HEIGHT_ABOVE_GROUND: int = 1 << 10


SOLUTION, CONTROL, REJECTION = SolutionFlags(), ControlFlags(), RejectionFlags()


class EstimatorReport(NamedTuple):
    """Quality of the estimate at one time.

    Deviations are 1σ. Ratios are those of the newest measurement to its gate, 1 at the limit: the largest one of a
    sensor's axes.
    """

    solution: int
    """``SolutionFlags``."""
    control: int
    """``ControlFlags``."""
    rejected: int
    """``RejectionFlags``."""
    horizontal_accuracy_m: float
    vertical_accuracy_m: float
    velocity_ratio: float
    """Of GNSS."""
    position_ratio: float
    """Of GNSS, horizontal."""
    height_ratio: float
    """Of the barometer, or of GNSS without one."""
    field_ratio: float
    """Of the magnetometer."""
    range_ratio: float
    """NaN without a rangefinder."""

    @property
    def wind_is_observed(self) -> bool:
        """True if measurements limit the uncertainty of the wind."""
        return bool(self.control & CONTROL.WIND)


@compiled
def imu_has_failed(track: TrackRecord, time_s: float) -> bool:
    """Return True if the inertial sensor is missing at ``time_s``, or repeats its measurement."""
    taken = track["taken"]
    if taken == 0:
        return True
    age_s = time_s - track["rows"][(taken - 1) % WINDOW]["time_s"]
    return bool(age_s > IMU_MISSING_S or track["repeats"] >= STUCK_SAMPLES)


@compiled
def report_kernel(memory: MemoryArray, track: TrackArray, time_s: float) -> EstimatorReport:
    """Return the report of an estimator's memory at ``time_s`` of the sensors; ``track`` has the inertial samples.

    The flags compare with the time at which the horizon is if no sample is late: without samples the horizon stays.
    """
    m = memory[0]
    o, p, has_range = m["observations"], m["covariance"], m["flags"]["has_range"] != 0
    now_s = time_s - m["params"][_DELAY]
    control, rejected = _control(m, now_s), _rejected(o, has_range)
    solution = _solution(m, now_s, control, rejected)
    if imu_has_failed(track[0], time_s):
        solution &= ~SOLUTION.ATTITUDE
    has_baro = control & CONTROL.BARO_HEIGHT != 0
    return EstimatorReport(
        solution,
        control,
        rejected,
        _root(p[POSITION, POSITION] + p[POSITION + 1, POSITION + 1]),
        _root(p[POSITION + 2, POSITION + 2]),
        _ratio(o, GNSS_VELOCITY, 3),
        _ratio(o, GNSS_POSITION, 2),
        _ratio(o, BARO, 1) if has_baro else _ratio(o, GNSS_POSITION + 2, 1),
        _ratio(o, MAG, 3),
        _ratio(o, RANGE, 1) if has_range else math.nan,
    )


@compiled
def _root(square: float) -> float:
    return math.nan if square < 0.0 else math.sqrt(square)


@compiled
def _ratio(o: RecordArray, first: int, count: int) -> float:
    """Return the largest ratio of ``count`` quantities."""
    largest = _root(o[first]["test_ratio"])
    for i in range(first + 1, first + count):
        largest = max(largest, _root(o[i]["test_ratio"]))
    return largest


@compiled
def _exceeds(o: RecordArray, first: int, count: int) -> bool:
    """Return True if a measurement of ``count`` quantities is beyond its gate."""
    for i in range(first, first + count):  # noqa: SIM110  # compiled code has no ``any``
        if _root(o[i]["test_ratio"]) > 1.0:
            return True
    return False


@compiled
def _fused_s(o: RecordArray, first: int, count: int) -> float:
    """Return the time of the last accepted measurement of ``count`` quantities; 0 before it."""
    latest_s = 0.0
    for i in range(first, first + count):
        latest_s = max(latest_s, o[i]["fused_s"])
    return latest_s


@compiled
def _is_recent(fused_s: float, now_s: float, limit_s: float) -> bool:
    return fused_s > 0.0 and now_s - fused_s < limit_s


@compiled
def _is_aided(o: RecordArray, first: int, count: int, now_s: float) -> bool:
    return _is_recent(_fused_s(o, first, count), now_s, AIDED_S)


@compiled
def _has_tilt(p: Covariance) -> bool:
    return bool(max(p[ATTITUDE, ATTITUDE], p[ATTITUDE + 1, ATTITUDE + 1]) < _TILT_RAD * _TILT_RAD)


@compiled
def _flag(flag: int, is_set: bool) -> int:
    return flag if is_set else 0


@compiled
def _control(m: MemoryRecord, now_s: float) -> int:
    o, p, flags = m["observations"], m["covariance"], m["flags"]
    if flags["aligned"] == 0:
        return 0
    has_gnss, landed = flags["has_gnss"] != 0, flags["landed"] != 0
    at_rest = landed and _is_aided(o, REST_VELOCITY, 3, now_s)
    has_position = has_gnss and _is_aided(o, GNSS_POSITION, 2, now_s)
    has_velocity = has_gnss and _is_aided(o, GNSS_VELOCITY, 2, now_s)
    has_baro = flags["has_baro"] != 0 and _is_aided(o, BARO, 1, now_s)
    has_range = flags["has_range"] != 0 and _is_aided(o, RANGE, 1, now_s)
    knows_wind = max(p[WIND, WIND], p[WIND + 1, WIND + 1]) < _WIND_VARIANCE
    return (
        _flag(CONTROL.TILT_ALIGN, _has_tilt(p))
        | _flag(CONTROL.YAW_ALIGN, p[ATTITUDE + 2, ATTITUDE + 2] < _YAW_RAD * _YAW_RAD)
        | _flag(CONTROL.GNSS_POSITION, has_position)
        | _flag(CONTROL.MAG_3D, _is_aided(o, MAG, 3, now_s))
        | _flag(CONTROL.IN_AIR, not landed)
        | _flag(CONTROL.WIND, knows_wind)
        | _flag(CONTROL.BARO_HEIGHT, has_baro)
        | _flag(CONTROL.RANGE_HEIGHT, has_range)
        | _flag(CONTROL.GNSS_HEIGHT, has_gnss and _is_aided(o, GNSS_POSITION + 2, 1, now_s))
        | _flag(CONTROL.MAG_FAULT, flags["mag_fault"] != 0)
        | _flag(CONTROL.VEHICLE_AT_REST, at_rest)
        | _flag(CONTROL.INERTIAL_DEAD_RECKONING, not (has_position or has_velocity or at_rest))
        | _flag(CONTROL.FAKE_POSITION, _is_aided(o, HOLD_POSITION, 2, now_s))
        | _flag(CONTROL.GNSS_VELOCITY, has_velocity)
    )


@compiled
def _rejected(o: RecordArray, has_range: bool) -> int:
    height = _exceeds(o, BARO, 1) or _exceeds(o, GNSS_POSITION + 2, 1)
    return (
        _flag(REJECTION.VELOCITY_HORIZONTAL, _exceeds(o, GNSS_VELOCITY, 2))
        | _flag(REJECTION.VELOCITY_VERTICAL, _exceeds(o, GNSS_VELOCITY + 2, 1))
        | _flag(REJECTION.POSITION_HORIZONTAL, _exceeds(o, GNSS_POSITION, 2))
        | _flag(REJECTION.POSITION_VERTICAL, height)
        | _flag(REJECTION.MAG_X, _exceeds(o, MAG, 1))
        | _flag(REJECTION.MAG_Y, _exceeds(o, MAG + 1, 1))
        | _flag(REJECTION.MAG_Z, _exceeds(o, MAG + 2, 1))
        | _flag(REJECTION.HEIGHT_ABOVE_GROUND, has_range and _exceeds(o, RANGE, 1))
    )


_GNSS_REJECTIONS = REJECTION.VELOCITY_HORIZONTAL | REJECTION.VELOCITY_VERTICAL | REJECTION.POSITION_HORIZONTAL
_FIELD_REJECTIONS = REJECTION.MAG_X | REJECTION.MAG_Y | REJECTION.MAG_Z


@compiled
def _solution(m: MemoryRecord, now_s: float, control: int, rejected: int) -> int:
    o = m["observations"]
    if m["flags"]["aligned"] == 0:
        return 0
    at_rest = control & CONTROL.VEHICLE_AT_REST != 0
    horizontal_s = max(_fused_s(o, GNSS_VELOCITY, 2), _fused_s(o, GNSS_POSITION, 2))
    vertical_s = max(o[BARO]["fused_s"], o[GNSS_POSITION + 2]["fused_s"], o[GNSS_VELOCITY + 2]["fused_s"])
    has_gnss = m["flags"]["has_gnss"] != 0
    horizontal = has_gnss and (at_rest or _is_recent(horizontal_s, now_s, DEAD_RECKONING_S))
    vertical = _is_recent(vertical_s, now_s, DEAD_RECKONING_S)
    fall = o[GNSS_VELOCITY + 2]["innovation"] * -o[BARO]["innovation"]  # of one sign if the IMU is wrong
    is_wrong = fall > 0.0 and _exceeds(o, GNSS_VELOCITY + 2, 1) and _exceeds(o, BARO, 1)
    is_glitch = rejected & _GNSS_REJECTIONS != 0 and rejected & _FIELD_REJECTIONS == 0
    return (
        _flag(SOLUTION.ATTITUDE, control & CONTROL.TILT_ALIGN != 0)
        | _flag(SOLUTION.VELOCITY_HORIZONTAL, horizontal)
        | _flag(SOLUTION.VELOCITY_VERTICAL, vertical)
        | _flag(SOLUTION.POSITION_RELATIVE, horizontal)
        | _flag(SOLUTION.POSITION_ABSOLUTE, horizontal)
        | _flag(SOLUTION.HEIGHT_ABSOLUTE, vertical)
        | _flag(SOLUTION.HEIGHT_ABOVE_GROUND, control & CONTROL.RANGE_HEIGHT != 0)
        | _flag(SOLUTION.CONSTANT_POSITION, not horizontal)
        | _flag(SOLUTION.PREDICTED_RELATIVE, horizontal)
        | _flag(SOLUTION.PREDICTED_ABSOLUTE, horizontal)
        | _flag(SOLUTION.GNSS_GLITCH, is_glitch)
        | _flag(SOLUTION.ACCEL_ERROR, is_wrong)
    )

"""Report of the estimator: flags, accuracies, innovations and resets, read from its memory on demand.

Flags have the bits of PX4: ``SolutionFlags`` are ESTIMATOR_STATUS_FLAGS, ``ControlFlags`` and ``RejectionFlags`` those
of the topic ``estimator_status_flags``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import Quaternion, Record, Vector3
from flightstack.estimation.error_state import ATTITUDE, POSITION, WIND, Nominal
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    HOLD_POSITION,
    MAG,
    RANGE,
    REST_VELOCITY,
)
from flightstack.estimation.memory import Flags
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


class SolutionFlags:
    """States that are good for flight, ESTIMATOR_STATUS_FLAGS."""

    ATTITUDE = mavlink.ESTIMATOR_ATTITUDE
    VELOCITY_HORIZONTAL = mavlink.ESTIMATOR_VELOCITY_HORIZ
    VELOCITY_VERTICAL = mavlink.ESTIMATOR_VELOCITY_VERT
    POSITION_RELATIVE = mavlink.ESTIMATOR_POS_HORIZ_REL
    POSITION_ABSOLUTE = mavlink.ESTIMATOR_POS_HORIZ_ABS
    HEIGHT_ABSOLUTE = mavlink.ESTIMATOR_POS_VERT_ABS
    HEIGHT_ABOVE_GROUND = mavlink.ESTIMATOR_POS_VERT_AGL
    CONSTANT_POSITION = mavlink.ESTIMATOR_CONST_POS_MODE
    PREDICTED_RELATIVE = mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    PREDICTED_ABSOLUTE = mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
    GNSS_GLITCH = mavlink.ESTIMATOR_GPS_GLITCH
    ACCEL_ERROR = mavlink.ESTIMATOR_ACCEL_ERROR


class ControlFlags:
    """Alignment and sensors in use, by the bits of ``control_mode_flags``."""

    TILT_ALIGN = 1 << 0
    YAW_ALIGN = 1 << 1
    GNSS_POSITION = 1 << 2
    MAG_3D = 1 << 5
    IN_AIR = 1 << 7
    WIND = 1 << 8
    BARO_HEIGHT = 1 << 9
    RANGE_HEIGHT = 1 << 10
    GNSS_HEIGHT = 1 << 11
    MAG_FAULT = 1 << 18
    VEHICLE_AT_REST = 1 << 26
    INERTIAL_DEAD_RECKONING = 1 << 29
    FAKE_POSITION = 1 << 32
    GNSS_VELOCITY = 1 << 44


class RejectionFlags:
    """Newest measurements beyond their gates, by the bits of PX4's innovation faults."""

    VELOCITY_HORIZONTAL = 1 << 0
    VELOCITY_VERTICAL = 1 << 1
    POSITION_HORIZONTAL = 1 << 2
    POSITION_VERTICAL = 1 << 3
    MAG_X = 1 << 4
    MAG_Y = 1 << 5
    MAG_Z = 1 << 6
    HEIGHT_ABOVE_GROUND = 1 << 10


class Observation(NamedTuple):
    """Newest measurement of one quantity: innovation, its variance, and its ratio to the gate, 1 at the limit."""

    innovation: float
    variance: float
    ratio: float
    fused_s: float
    """Time of the last accepted one; 0 before it."""


class Resets(NamedTuple):
    """Numbers of resets, and the change of each in the last step of the filter with one."""

    position: int
    position_change_m: Vector3
    velocity: int
    velocity_change_m_s: Vector3
    yaw: int
    yaw_change_rad: float


class EstimatorReport(NamedTuple):
    """State and quality of the estimate at one time. Deviations are 1σ."""

    time_s: float
    """Time of the output, that of the newest IMU sample."""
    horizon_s: float
    """Time of the filter's state, which is late by the longest delay of a sensor."""
    solution: int
    control: int
    rejected: int
    state: tuple[float, ...]
    """State at the horizon, 28 numbers in the order of ``Nominal``."""
    variances: tuple[float, ...]
    """Variance of each error state, 27."""
    velocity: tuple[Observation, ...]
    """Of GNSS, as the next one: north, east, down."""
    position: tuple[Observation, ...]
    height: Observation
    """Of the barometer."""
    field: tuple[Observation, ...]
    """Of the magnetometer: forward, right, down."""
    range: Observation | None
    """None without a rangefinder."""
    horizontal_accuracy_m: float
    vertical_accuracy_m: float
    resets: Resets

    @property
    def velocity_ratio(self) -> float:
        """Largest ratio of a GNSS velocity to its gate."""
        return max(o.ratio for o in self.velocity)

    @property
    def position_ratio(self) -> float:
        """Largest ratio of a horizontal GNSS position to its gate."""
        return max(o.ratio for o in self.position[:2])

    @property
    def height_ratio(self) -> float:
        """Ratio of the height to its gate: of the barometer, or of GNSS without one."""
        return self.height.ratio if self.control & ControlFlags.BARO_HEIGHT else self.position[2].ratio

    @property
    def nominal(self) -> Nominal:
        """The state at the horizon."""
        return _nominal(self.state)

    @property
    def field_ratio(self) -> float:
        """Largest ratio of the magnetic field to its gate."""
        return max(o.ratio for o in self.field)

    @property
    def wind_variances(self) -> tuple[float, float]:
        """Variances of the wind to north and east [m²/s²]."""
        return self.variances[WIND], self.variances[WIND + 1]

    @property
    def wind_is_observed(self) -> bool:
        """True if measurements limit the uncertainty of the wind."""
        return bool(self.control & ControlFlags.WIND)


def estimator_report(memory: Record, time_s: float, imu_has_failed: bool) -> EstimatorReport:
    """Return the report of a record of the estimator's ``MEMORY`` at ``time_s`` of the sensors.

    The flags compare with the time at which the horizon is if no sample is late: without samples the horizon stays.
    """
    observed = memory["observations"].tolist()
    rows, fused_s = [_observation(*row[:4]) for row in observed[: RANGE + 1]], [row[3] for row in observed]
    variances = tuple(np.diagonal(memory["covariance"]).tolist())
    flags = Flags(*memory["flags"].tolist())
    now_s = time_s - float(memory["params"][_DELAY])
    velocity, position = rows[GNSS_VELOCITY : GNSS_VELOCITY + 3], rows[GNSS_POSITION : GNSS_POSITION + 3]
    field, height = rows[MAG : MAG + 3], rows[BARO]
    range_finder = rows[RANGE] if flags.has_range else None
    control = _control(now_s, flags, fused_s, variances)
    rejected = _rejected(velocity, position, height, field, range_finder)
    solution = _solution(now_s, flags, rows, control, rejected)
    return EstimatorReport(
        time_s=float(memory["output"][0]),
        horizon_s=float(memory["clock"][0]),
        solution=solution & ~SolutionFlags.ATTITUDE if imu_has_failed else solution,
        control=control,
        rejected=rejected,
        state=tuple(memory["nominal"].tolist()),
        variances=variances,
        velocity=tuple(velocity),
        position=tuple(position),
        height=height,
        field=tuple(field),
        range=range_finder,
        horizontal_accuracy_m=_root(variances[POSITION] + variances[POSITION + 1]),
        vertical_accuracy_m=_root(variances[POSITION + 2]),
        resets=_resets(memory["resets"]),
    )


def _observation(innovation: float, variance: float, test_ratio: float, fused_s: float) -> Observation:
    """Return an observation of the first four numbers of ``Observed``."""
    return Observation(innovation, variance, _root(test_ratio), fused_s)


def _root(square: float) -> float:
    return math.nan if square < 0.0 else math.sqrt(square)


def nominal_of(memory: Record) -> Nominal:
    """Return the state at the horizon of a record of the estimator's ``MEMORY``."""
    return _nominal(memory["nominal"].tolist())


def _nominal(x: Sequence[float]) -> Nominal:
    return Nominal(
        Quaternion(*x[0:4]), Vector3(*x[4:7]), Vector3(*x[7:10]), Vector3(*x[10:13]), Vector3(*x[13:16]),
        Vector3(*x[16:19]), Vector3(*x[19:22]), x[22], x[23], x[24], Vector3(*x[25:28]),
    )  # fmt: skip


def _resets(found: Record) -> Resets:
    position, velocity, yaw = found["position"], found["velocity"], found["yaw"]
    return Resets(
        int(position["number"]), Vector3(*position["change"].tolist()),
        int(velocity["number"]), Vector3(*velocity["change"].tolist()),
        int(yaw["number"]), float(yaw["change_rad"]),
    )  # fmt: skip


def _is_recent(fused_s: Sequence[float], now_s: float, limit_s: float) -> bool:
    latest_s = max(fused_s)
    return latest_s > 0.0 and now_s - latest_s < limit_s


def _control(now_s: float, flags: Flags, fused_s: Sequence[float], variances: Sequence[float]) -> int:
    if not flags.aligned:
        return 0

    def fused(at: int, count: int = 1) -> bool:
        return _is_recent(fused_s[at : at + count], now_s, AIDED_S)

    has_gnss = bool(flags.has_gnss)
    at_rest = bool(flags.landed) and fused(REST_VELOCITY, 3)
    has_position, has_velocity = has_gnss and fused(GNSS_POSITION, 2), has_gnss and fused(GNSS_VELOCITY, 2)
    is_true = (
        (ControlFlags.TILT_ALIGN, max(variances[ATTITUDE : ATTITUDE + 2]) < _TILT_RAD * _TILT_RAD),
        (ControlFlags.YAW_ALIGN, variances[ATTITUDE + 2] < _YAW_RAD * _YAW_RAD),
        (ControlFlags.GNSS_POSITION, has_position),
        (ControlFlags.MAG_3D, fused(MAG, 3)),
        (ControlFlags.IN_AIR, not flags.landed),
        (ControlFlags.WIND, max(variances[WIND : WIND + 2]) < _WIND_VARIANCE),
        (ControlFlags.BARO_HEIGHT, bool(flags.has_baro) and fused(BARO)),
        (ControlFlags.RANGE_HEIGHT, bool(flags.has_range) and fused(RANGE)),
        (ControlFlags.GNSS_HEIGHT, has_gnss and fused(GNSS_POSITION + 2)),
        (ControlFlags.MAG_FAULT, bool(flags.mag_fault)),
        (ControlFlags.VEHICLE_AT_REST, at_rest),
        (ControlFlags.INERTIAL_DEAD_RECKONING, not (has_position or has_velocity or at_rest)),
        (ControlFlags.FAKE_POSITION, fused(HOLD_POSITION, 2)),
        (ControlFlags.GNSS_VELOCITY, has_velocity),
    )
    return sum(flag for flag, value in is_true if value)


def _rejected(
    velocity: Sequence[Observation],
    position: Sequence[Observation],
    height: Observation,
    field: Sequence[Observation],
    range_finder: Observation | None,
) -> int:
    def beyond(rows: Sequence[Observation]) -> bool:
        return any(row.ratio > 1.0 for row in rows)

    is_true = (
        (RejectionFlags.VELOCITY_HORIZONTAL, beyond(velocity[:2])),
        (RejectionFlags.VELOCITY_VERTICAL, beyond(velocity[2:])),
        (RejectionFlags.POSITION_HORIZONTAL, beyond(position[:2])),
        (RejectionFlags.POSITION_VERTICAL, beyond([height, *position[2:]])),
        (RejectionFlags.MAG_X, beyond(field[:1])),
        (RejectionFlags.MAG_Y, beyond(field[1:2])),
        (RejectionFlags.MAG_Z, beyond(field[2:])),
        (RejectionFlags.HEIGHT_ABOVE_GROUND, range_finder is not None and beyond([range_finder])),
    )
    return sum(flag for flag, value in is_true if value)


_GNSS_REJECTIONS = (
    RejectionFlags.VELOCITY_HORIZONTAL | RejectionFlags.VELOCITY_VERTICAL | RejectionFlags.POSITION_HORIZONTAL
)
_FIELD_REJECTIONS = RejectionFlags.MAG_X | RejectionFlags.MAG_Y | RejectionFlags.MAG_Z


def _solution(
    now_s: float,
    flags: Flags,
    rows: Sequence[Observation],
    control: int,
    rejected: int,
) -> int:
    if not flags.aligned:
        return 0
    has_gnss = bool(flags.has_gnss)
    gnss = (GNSS_VELOCITY, GNSS_VELOCITY + 1, GNSS_POSITION, GNSS_POSITION + 1)
    at_rest = bool(control & ControlFlags.VEHICLE_AT_REST)
    horizontal = has_gnss and (
        at_rest or _is_recent([rows[at].fused_s for at in gnss], now_s, DEAD_RECKONING_S)
    )
    heights = (BARO, GNSS_POSITION + 2, GNSS_VELOCITY + 2)
    vertical = _is_recent([rows[at].fused_s for at in heights], now_s, DEAD_RECKONING_S)
    fall = rows[GNSS_VELOCITY + 2].innovation * -rows[BARO].innovation  # of one sign if the IMU is wrong
    is_true = (
        (SolutionFlags.ATTITUDE, bool(control & ControlFlags.TILT_ALIGN)),
        (SolutionFlags.VELOCITY_HORIZONTAL, horizontal),
        (SolutionFlags.VELOCITY_VERTICAL, vertical),
        (SolutionFlags.POSITION_RELATIVE, horizontal),
        (SolutionFlags.POSITION_ABSOLUTE, horizontal),
        (SolutionFlags.HEIGHT_ABSOLUTE, vertical),
        (SolutionFlags.HEIGHT_ABOVE_GROUND, bool(control & ControlFlags.RANGE_HEIGHT)),
        (SolutionFlags.CONSTANT_POSITION, not horizontal),
        (SolutionFlags.PREDICTED_RELATIVE, horizontal),
        (SolutionFlags.PREDICTED_ABSOLUTE, horizontal),
        (SolutionFlags.GNSS_GLITCH, bool(rejected & _GNSS_REJECTIONS) and not rejected & _FIELD_REJECTIONS),
        (
            SolutionFlags.ACCEL_ERROR,
            fall > 0.0 and rows[GNSS_VELOCITY + 2].ratio > 1.0 and rows[BARO].ratio > 1.0,
        ),
    )
    return sum(flag for flag, value in is_true if value)

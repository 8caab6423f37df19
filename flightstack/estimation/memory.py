"""The memory of one estimator: a record of arrays, the meaning of its flags and of its counters of resets."""

from __future__ import annotations

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import Record
from flightstack.estimation.alignment import ALIGNMENT_SIZE
from flightstack.estimation.error_state import ERROR_STATES, NOMINAL_SIZE
from flightstack.estimation.estimator_params import PARAMS_SIZE
from flightstack.estimation.fusion import GNSS_SIZE
from flightstack.estimation.imu_input import SUMS_SIZE
from flightstack.estimation.kalman import OBSERVATION_COLUMNS, OBSERVATIONS, Filter
from flightstack.estimation.rings import (
    BARO_ROWS,
    GNSS_ROWS,
    IMU_COLUMNS,
    IMU_ROWS,
    MAG_ROWS,
    MEAN_SIZE,
    RANGE_ROWS,
    RINGS,
    TRACK_COLUMNS,
    Rings,
)
from flightstack.estimation.yaw_estimator import MODEL_SIZE, MODELS

ALIGNED, LANDED, HAS_BARO, HAS_GNSS, HAS_RANGE, HAS_MAG, HAS_YAW, MAG_FAULT, FLAGS = 0, 1, 2, 3, 4, 5, 6, 7, 8
"""``HAS_YAW``: the yaw is known, from the magnetometer or from GNSS velocity. ``MAG_FAULT``: GNSS velocity has
disproved the yaw of the magnetometer, which is not used any more."""
POSITION_RESET, VELOCITY_RESET, YAW_RESET, RESETS = 0, 8, 16, 19
RESET_CHANGE, RESET_SUM, RESET_S, YAW_RESET_SUM = 1, 4, 7, 18
"""Of each kind: the number of its resets, their change in the last step with one, the sum of all changes, and the time
of that step; yaw has no time."""
GAP_PENDING_S, GAP_S, GAPS = 0, 1, 2
"""Columns of ``imu_gap``: time without samples in the step at hand, in all, and the number of such gaps."""
YAW_TURN, YAW_VARIANCE, YAW_UPDATES, YAW_WRONG_S = 0, 1, 2, 3
"""Columns of ``yaw_fix``: turn from the filter's yaw to that of GNSS velocity [rad], its variance, updates, and the
time since which they contradict each other, 0 if they do not."""

MEMORY = np.dtype(
    [
        ("params", "f8", (PARAMS_SIZE,)),
        ("nominal", "f8", (NOMINAL_SIZE,)),
        ("covariance", "f8", (ERROR_STATES, ERROR_STATES)),
        ("observations", "f8", (OBSERVATIONS, OBSERVATION_COLUMNS)),
        ("h", "f8", (ERROR_STATES,)),
        ("ph", "f8", (ERROR_STATES,)),
        ("gain", "f8", (ERROR_STATES,)),
        ("clock", "f8", (2,)),
        ("gnss", "f8", (GNSS_ROWS, GNSS_SIZE)),
        ("mag", "f8", (MAG_ROWS, 4)),
        ("baro", "f8", (BARO_ROWS, 2)),
        ("range", "f8", (RANGE_ROWS, 2)),
        ("imu", "f8", (IMU_ROWS, IMU_COLUMNS)),
        ("track", "f8", (IMU_ROWS, TRACK_COLUMNS)),
        ("cursors", "i8", (RINGS, 2)),
        ("means", "f8", (RINGS, MEAN_SIZE)),
        ("sums", "f8", (SUMS_SIZE,)),
        ("alignment", "f8", (ALIGNMENT_SIZE,)),
        ("output", "f8", (TRACK_COLUMNS,)),
        ("state", "f8", (13,)),  # the output as VehicleState
        ("earth", "f8", (4,)),  # field NED [gauss], declination [rad], NaN if unknown
        ("field", "f8", (3,)),  # of the body [gauss], the last one at the horizon
        ("last_imu_s", "f8", (1,)),
        ("imu_gap", "f8", (3,)),
        ("last_gnss_s", "f8", (1,)),
        ("gnss_speed_m_s", "f8", (2,)),  # north, east, smoothed
        ("refused_s", "f8", (6,)),  # time of refused GNSS velocities and positions, without an accepted one
        ("ground_m", "f8", (1,)),
        ("hold", "f8", (3,)),  # north, east [m], time of the last fusion
        ("rest_s", "f8", (1,)),  # time of the last fusion at rest
        ("drag_s", "f8", (1,)),  # and of drag
        ("flags", "i8", (FLAGS,)),
        ("resets", "f8", (RESETS,)),
        ("yaw_models", "f8", (MODELS, MODEL_SIZE)),
        ("yaw_fix", "f8", (4,)),
    ]
)


@compiled
def filter_of(m: Record) -> Filter:
    """Return the filter's arrays of a record of ``MEMORY``."""
    return Filter(m["nominal"], m["covariance"], m["observations"], m["h"], m["ph"], m["gain"], m["clock"])


@compiled
def rings_of(m: Record) -> Rings:
    """Return the ring buffers of a record of ``MEMORY``."""
    return Rings(m["gnss"], m["mag"], m["baro"], m["range"], m["imu"], m["track"], m["cursors"])

"""The estimator and its sensors as seen from outside: report, covariances and vibration.

Each record is made when it is first asked for.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, Vector3
from flightstack.estimation.error_state import Nominal
from flightstack.estimation.estimator_report import EstimatorReport, estimator_report, nominal_of
from flightstack.estimation.health import STUCK_SAMPLES
from flightstack.estimation.imu_track import IMU_MISSING_S
from flightstack.estimation.motion_covariance import motion_covariance, pose_covariance, twist_covariance
from flightstack.estimation.selector import LaneReport
from flightstack.estimation.sensor_feed import NewestSamples


class Vibration(NamedTuple):
    """Vibration of an inertial sensor, by the measures of PX4's topic ``vehicle_imu_status``.

    Means over the window; zero before two samples.
    """

    coning_rad2: float = 0.0
    """Size of the cross product of successive delta angles."""
    gyro_rad_s: float = 0.0
    """Size of the change of the rates from one sample to the next."""
    accel_m_s2: float = 0.0
    """The same of the specific force."""


STILL = Vibration()


class Sensed:
    """Estimate and measurements of a vehicle that flies on its sensors, at one time."""

    def __init__(
        self,
        memory: Record,
        samples: NewestSamples,
        has_origin: bool = True,
        time_s: float | None = None,
        lanes: LaneReport | None = None,
    ) -> None:
        """``memory`` is the estimator's record; both change with time, so read this before the next sample.

        ``has_origin`` is True after the first fix. ``time_s`` is the time of the newest message of sensors, which
        advances without samples; None means the time of the newest sample of the inertial sensor. ``lanes`` is None for
        a single inertial sensor.
        """
        self.lanes = lanes
        self.memory = memory
        self.samples = samples
        self.has_origin = has_origin
        self.time_s = float(memory["output"][0]) if time_s is None else time_s
        """Time of the sensors."""

    @cached_property
    def report(self) -> EstimatorReport:
        """Flags, accuracies, innovations and resets of the estimator."""
        return estimator_report(self.memory, self.time_s, self.imu_has_failed)

    @cached_property
    def imu_has_failed(self) -> bool:
        """True if the inertial sensor is missing, or repeats its measurement."""
        imu, track = self.samples.imu, self.samples.imu_track
        return imu is None or self.time_s - imu.time_s > IMU_MISSING_S or track.repeats >= STUCK_SAMPLES

    @cached_property
    def nominal(self) -> Nominal:
        """State at the delayed horizon."""
        return nominal_of(self.memory)

    @cached_property
    def vibration(self) -> Vibration:
        """Vibration of the inertial sensor."""
        return vibration_of(*self.samples.imu_track.window)

    def pose_covariance(self, attitude: Quaternion) -> FloatArray:
        """Return the covariance of position and attitude, shape (6, 6)."""
        return pose_covariance(self.memory, attitude)

    def twist_covariance(self, attitude: Quaternion, velocity_ned_m_s: Vector3) -> FloatArray:
        """Return the covariance of velocity in body axes and rates, shape (6, 6)."""
        return twist_covariance(self.memory, attitude, velocity_ned_m_s)

    def motion_covariance(self, attitude: Quaternion, force_frd_m_s2: Vector3) -> FloatArray:
        """Return the covariance of position, velocity and acceleration in NED, shape (9, 9)."""
        return motion_covariance(self.memory, attitude, force_frd_m_s2)


@compiled
def _size(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


@compiled
def _vibration(rows: FloatArray, first: int, sizes: FloatArray) -> None:
    """Write the sums of the sizes of ``Vibration`` in the samples of a ring whose oldest row is ``first``."""
    count = len(rows)
    sizes[:] = 0.0
    for k in range(1, count):
        a, b = rows[(first + k - 1) % count], rows[(first + k) % count]
        ax, ay, az = a[2] * a[1], a[3] * a[1], a[4] * a[1]
        bx, by, bz = b[2] * b[1], b[3] * b[1], b[4] * b[1]
        sizes[0] += _size(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        sizes[1] += _size(b[2] - a[2], b[3] - a[3], b[4] - a[4])
        sizes[2] += _size(b[5] - a[5], b[6] - a[6], b[7] - a[7])


def vibration_of(rows: FloatArray, first: int = 0) -> Vibration:
    """Return the vibration in successive samples, shape (n, 8): time, duration, rates, specific force.

    They begin with the row ``first``, and go on at the first row after the last one.
    """
    if len(rows) < 2:
        return STILL
    sizes = np.empty(3)
    with np.errstate(all="ignore"):  # absurd measurements
        _vibration(rows, first, sizes)
        return Vibration(*(sizes / (len(rows) - 1)).tolist())

"""The estimator and its sensors as seen from outside: report, covariances and vibration.

Each record is made when it is first asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from flightstack.core.compiled import plain
from flightstack.core.contract import FloatArray, Quaternion, Record, RecordArray, Vector3
from flightstack.estimation.error_state import WIND, Nominal
from flightstack.estimation.estimator_report import EstimatorReport, imu_has_failed, report_kernel
from flightstack.estimation.motion_covariance import motion_covariance, pose_covariance, twist_covariance
from flightstack.estimation.resets import count_of_resets
from flightstack.estimation.selector import LaneReport
from flightstack.estimation.sensor_feed import NewestSamples
from flightstack.estimation.vibration import Vibration, vibration_kernel


class Sensed:
    """Estimate and measurements of a vehicle that flies on its sensors, at one time."""

    def __init__(
        self,
        memory: RecordArray,
        samples: NewestSamples,
        has_origin: bool = True,
        time_s: float | None = None,
        lanes: LaneReport | None = None,
    ) -> None:
        """``memory`` is the estimator's; both change with time, so read this before the next sample.

        ``has_origin`` is True after the first fix. ``time_s`` is the time of the newest message of sensors, which
        advances without samples; None means the time of the newest sample of the inertial sensor. ``lanes`` is None for
        a single inertial sensor.
        """
        self.lanes = lanes
        self.memory = memory
        self._record: Record = memory[0]
        self.track = samples.imu_track.memory
        self.samples = samples
        self.has_origin = has_origin
        self.time_s = float(memory["output"][0, 0]) if time_s is None else time_s
        """Time of the sensors."""

    @cached_property
    def report(self) -> EstimatorReport:
        """Flags, accuracies and ratios of the estimator."""
        return report_kernel(self.memory, self.track, self.time_s)

    @cached_property
    def imu_has_failed(self) -> bool:
        """True if the inertial sensor is missing, or repeats its measurement."""
        return plain(imu_has_failed)(self.track[0], self.time_s)

    @cached_property
    def nominal(self) -> Nominal:
        """State at the delayed horizon."""
        return _nominal(self._record["nominal"].tolist())

    @property
    def wind_variances(self) -> tuple[float, float]:
        """Variances of the wind to north and east [m²/s²]."""
        covariance = self._record["covariance"]
        return float(covariance[WIND, WIND]), float(covariance[WIND + 1, WIND + 1])

    @property
    def resets(self) -> int:
        """Number of resets of the estimate, of any kind."""
        return int(plain(count_of_resets)(self._record))

    @cached_property
    def vibration(self) -> Vibration:
        """Vibration of the inertial sensor."""
        with np.errstate(all="ignore"):  # absurd measurements, uncompiled
            return vibration_kernel(self.track)

    def pose_covariance(self, attitude: Quaternion) -> FloatArray:
        """Return the covariance of position and attitude, shape (6, 6)."""
        return pose_covariance(self._record, attitude)

    def twist_covariance(self, attitude: Quaternion, velocity_ned_m_s: Vector3) -> FloatArray:
        """Return the covariance of velocity in body axes and rates, shape (6, 6)."""
        return twist_covariance(self._record, attitude, velocity_ned_m_s)

    def motion_covariance(self, attitude: Quaternion, force_frd_m_s2: Vector3) -> FloatArray:
        """Return the covariance of position, velocity and acceleration in NED, shape (9, 9)."""
        return motion_covariance(self._record, attitude, force_frd_m_s2)


def _nominal(x: Sequence[float]) -> Nominal:
    return Nominal(
        Quaternion(*x[0:4]), Vector3(*x[4:7]), Vector3(*x[7:10]), Vector3(*x[10:13]), Vector3(*x[13:16]),
        Vector3(*x[16:19]), Vector3(*x[19:22]), x[22], x[23], x[24], Vector3(*x[25:28]),
    )  # fmt: skip

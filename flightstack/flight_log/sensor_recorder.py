"""Record measurements, estimate and truth in the flight log of a vehicle on its sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import Sample
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, MagSample, RangeSample
from flightstack.estimation.snapshot import ESTIMATOR_START
from flightstack.flight_log.estimator_topics import ESTIMATOR, WIND_GROUP, fill_estimator, fill_wind
from flightstack.flight_log.flight_log import FlightLog
from flightstack.flight_log.local_position import fill_local_position
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.flight_log.sensor_topics import (
    BARO_GROUP,
    GNSS_GROUP,
    IMU_GROUP,
    MAG_GROUP,
    RANGE_GROUP,
    TRUTH_GLOBAL_GROUP,
    TRUTH_GROUP,
    fill_baro,
    fill_gnss,
    fill_imu,
    fill_mag,
    fill_range,
)
from flightstack.flight_log.topics import Group

SENSOR_GROUPS = (
    IMU_GROUP, MAG_GROUP, BARO_GROUP, GNSS_GROUP, RANGE_GROUP, ESTIMATOR, WIND_GROUP, TRUTH_GROUP,
    TRUTH_GLOBAL_GROUP,
)  # fmt: skip
TRUTH_INTERVAL_US, GLOBAL_INTERVAL_US, ESTIMATOR_INTERVAL_US = 10_000, 100_000, 500_000
"""Intervals of PX4's logger."""
LOCAL_INTERVAL_US = 200_000
"""Interval of the validity and accuracy of the local position: a report of the estimator takes 0.1 ms."""
_FILLS: dict[type, tuple[Group, Callable[[FloatArray, Any], None]]] = {
    MagSample: (MAG_GROUP, fill_mag),
    BaroSample: (BARO_GROUP, fill_baro),
    GnssSample: (GNSS_GROUP, fill_gnss),
    RangeSample: (RANGE_GROUP, fill_range),
}


class SensorRecorder:
    """Records every sample, and at intervals the estimator and the truth, while a log is open."""

    def __init__(self, recorder: FlightRecorder, frame: LocalFrame, home: GeoPoint) -> None:
        """``frame`` is the vehicle's local frame; ``home`` is the origin of the true position."""
        self._recorder = recorder
        self._frame, self._true_frame = frame, LocalFrame(home)
        self._offset_m = Vector3(0.0, 0.0, 0.0)  # of the true frame's origin in the vehicle's
        self._log: FlightLog | None = None
        self._truth_us = self._global_us = self._estimator_us = self._local_us = 0

    def begin(self, estimator: Callable[[], bytes]) -> None:
        """Record the estimator's snapshot in a new log; call before the estimator takes the next sample."""
        log = self._recorder.log
        if log is not self._log:
            self._log = log
            if log is not None:
                self._offset_m = self._frame.to_ned(self._true_frame.origin)
                self._truth_us = self._global_us = self._estimator_us = 0
                log.binary_information(ESTIMATOR_START, estimator())

    def imu(self, time_us: int, dt_us: int, row: FloatArray) -> None:
        """Record a sample of the inertial sensor that the estimator takes, in its array form."""
        log = self._log
        if log is not None:
            fill_imu(log.sampled[IMU_GROUP.name].append(time_us), dt_us, row)

    def sample(self, sample: Sample) -> None:
        """Record a sample of another sensor that the estimator takes."""
        log = self._log
        if log is not None and (known := _FILLS.get(type(sample))) is not None:
            group, fill = known
            fill(log.sampled[group.name].append(round(sample.time_s * 1e6)), sample)

    def state(
        self, time_us: int, truth: Callable[[], FloatArray | None], sense: Callable[[], Sensed]
    ) -> None:
        """Record the true state, shape (13,), and the estimator from ``sense``, if they are due.

        ``truth`` returns None before the first true state.
        """
        if time_us >= self._local_us:
            self.local_position(time_us, sense())
        log = self._log
        if log is None or time_us < self._truth_us:
            return
        self._truth_us = time_us + TRUTH_INTERVAL_US
        state = truth()
        if state is not None:
            self._record_truth(log, time_us, state)
        if time_us >= self._estimator_us:
            self._estimator_us = time_us + ESTIMATOR_INTERVAL_US
            sensed = sense()
            fill_estimator(log.sampled[ESTIMATOR.name].append(time_us), sensed)
            if sensed.report.wind_is_observed:
                fill_wind(log.sampled[WIND_GROUP.name].append(time_us), sensed)

    def local_position(self, time_us: int, sensed: Sensed) -> None:
        """Update what the next rows of the outer loop record of the estimate; also call after a reset."""
        self._local_us = time_us + LOCAL_INTERVAL_US
        fill_local_position(self._recorder.estimate, sensed)

    def _record_truth(self, log: FlightLog, time_us: int, truth: FloatArray) -> None:
        row = log.sampled[TRUTH_GROUP.name].append(time_us)
        row[:] = truth
        row[:3] += self._offset_m
        if time_us >= self._global_us:
            self._global_us = time_us + GLOBAL_INTERVAL_US
            place = self._true_frame.to_geo(Vector3(*truth[:3].tolist()))
            log.sampled[TRUTH_GLOBAL_GROUP.name].append(time_us)[:] = place

"""Record measurements, estimate and truth in the flight log of a vehicle on its sensors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flightstack.core.compiled import plain
from flightstack.core.contract import FloatArray, RecordArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.periods import NEVER_US, next_due
from flightstack.estimation.sensed import Sensed
from flightstack.estimation.sensor_feed import Sample
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, MagSample, RangeSample
from flightstack.estimation.snapshot import ESTIMATOR_START
from flightstack.flight_log.estimator_topics import (
    ESTIMATOR,
    SELECTOR_GROUP,
    WIND_GROUP,
    fill_selector,
    store_estimator,
)
from flightstack.flight_log.flight_log import FlightLog, Trace
from flightstack.flight_log.local_position import store_local_position
from flightstack.flight_log.recorder import FlightRecorder
from flightstack.flight_log.sensor_rows import (
    DUE_TIMES,
    ESTIMATOR_INTERVAL_US,
    GLOBAL_INTERVAL_US,
    INVALID_INTERVAL_US,
    TRUTH_INTERVAL_US,
    DueTimes,
    store_global,
    store_truth,
)
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
    fill_mag,
    fill_range,
)
from flightstack.flight_log.topics import Group

SENSOR_GROUPS = (
    IMU_GROUP, MAG_GROUP, BARO_GROUP, GNSS_GROUP, RANGE_GROUP, ESTIMATOR, SELECTOR_GROUP, WIND_GROUP,
    TRUTH_GROUP, TRUTH_GLOBAL_GROUP,
)  # fmt: skip
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
        self.place: FloatArray = np.array((*home, *self._true_frame.scales))
        """Origin of the true position, as ``store_global`` takes it."""
        self.offset_m: FloatArray = np.zeros(3)
        """Of the true frame's origin in the vehicle's [m NED].

        Heights of both count from the ground at the start: the altitude of GNSS at the first fix is no error of the
        height.
        """
        self._log: FlightLog | None = None
        scratch: FloatArray = np.zeros(IMU_GROUP.columns)
        self._no_row: Callable[[int], FloatArray] = lambda _: scratch
        self._imu_row: Callable[[int], FloatArray] = self._no_row
        self.due: RecordArray = np.array([DueTimes(0, NEVER_US, NEVER_US, NEVER_US)], DUE_TIMES)
        """Times of the next rows, written in place, also by a kernel that records them; shape (1,)."""
        # as memory: a number of an array takes four times as long to read
        self._local_us, self._truth_us, self._global_us, self._estimator_us = (
            self.due[name].data for name in DueTimes._fields
        )
        self._wind: FloatArray = np.zeros(WIND_GROUP.columns)

    def warm_up(self, memory: RecordArray, track: RecordArray) -> None:
        """Compile the kernels of the estimate's rows, or load them from the cache; the arrays are an estimator's."""
        store_local_position(memory, track, False, 0.0, np.zeros_like(self._recorder.estimate))
        store_estimator(memory, track, 0.0, np.zeros(ESTIMATOR.columns), self._wind)

    def begin(self, estimator: Callable[[], bytes]) -> None:
        """Record the estimator's snapshot in a new log; call before the estimator takes the next sample."""
        log = self._recorder.log
        if log is not self._log:
            self._log = log
            self._imu_row = self._no_row if log is None else log.sampled[IMU_GROUP.name].append
            if log is None:
                self.due[0] = DueTimes(self._local_us[0], NEVER_US, NEVER_US, NEVER_US)
            else:
                self.offset_m[:2] = self._frame.to_ned(self._true_frame.origin)[:2]
                self.due[0] = DueTimes(0, 0, 0, 0)
                log.binary_information(ESTIMATOR_START, estimator())

    def imu_row(self, time_us: int) -> FloatArray:
        """Return the row of ``IMU_GROUP`` for a sample that the estimator takes; without a log a scratch row."""
        return self._imu_row(time_us)

    @property
    def log(self) -> FlightLog | None:
        """The log that is recorded; None without one."""
        return self._log

    def trace(self, group: Group) -> Trace | None:
        """Return the rows of a group in the open log; None without one."""
        return None if self._log is None else self._log.sampled[group.name]

    @property
    def is_new(self) -> bool:
        """True if the log was opened or closed since ``begin``."""
        return self._recorder.log is not self._log

    def due_us(self, with_truth: bool) -> int:
        """Return the time from which ``state`` records something; without ``with_truth``, besides the true state."""
        return min(self._local_us[0], self._truth_us[0] if with_truth else self._estimator_us[0])

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
        sensed: Sensed | None = None
        if time_us >= self._local_us[0]:
            sensed = sense()
            self.local_position(time_us, sensed)
        log = self._log
        if log is None:
            return
        if time_us >= self._truth_us[0]:
            self._truth_us[0] = next_due(time_us, TRUTH_INTERVAL_US)
            state = truth()
            if state is not None:
                self._record_truth(log, time_us, state)
        if time_us >= self._estimator_us[0]:
            self._estimator_us[0] = next_due(time_us, ESTIMATOR_INTERVAL_US)
            self._record_estimator(log, time_us, sensed or sense())

    def selection(self, time_us: int, sensed: Sensed) -> None:
        """Record the selection of several estimators; also call after a change."""
        if self._log is not None and sensed.lanes is not None:
            fill_selector(self._log.sampled[SELECTOR_GROUP.name].append(time_us), sensed.lanes)

    def local_position(self, time_us: int, sensed: Sensed) -> None:
        """Update what the next rows of the outer loop record of the estimate; also call after a reset or a fault."""
        is_valid = store_local_position(
            sensed.memory, sensed.track, sensed.has_origin, sensed.time_s, self._recorder.estimate
        )
        self._local_us[0] = next_due(time_us, ESTIMATOR_INTERVAL_US if is_valid else INVALID_INTERVAL_US)

    def _record_estimator(self, log: FlightLog, time_us: int, sensed: Sensed) -> None:
        row = log.sampled[ESTIMATOR.name].append(time_us)
        if store_estimator(sensed.memory, sensed.track, sensed.time_s, row, self._wind):
            log.sampled[WIND_GROUP.name].append(time_us)[:] = self._wind
        self.selection(time_us, sensed)

    def _record_truth(self, log: FlightLog, time_us: int, truth: FloatArray) -> None:
        plain(store_truth)(log.sampled[TRUTH_GROUP.name].append(time_us), truth, self.offset_m)
        if time_us >= self._global_us[0]:
            self._global_us[0] = next_due(time_us, GLOBAL_INTERVAL_US)
            plain(store_global)(log.sampled[TRUTH_GLOBAL_GROUP.name].append(time_us), truth, self.place)

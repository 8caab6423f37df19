"""What sensors, estimators and their logs hand to the kernel of quiet ticks, and take back from it."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np

from flightstack.commander.estimate_checks import LIMITS, watch_estimate
from flightstack.core.contract import STATE_SIZE, ByteArray, FloatArray, RecordArray, SingleArray, Vector3
from flightstack.core.kernels.calls import address_of, as_bytes
from flightstack.core.periods import NEVER_US
from flightstack.estimation.delayed_filter import push_kernel
from flightstack.estimation.estimator import Estimator
from flightstack.estimation.fusion import GNSS_SIZE
from flightstack.estimation.health import WATCH
from flightstack.estimation.imu_track import RECORD_SIZE
from flightstack.estimation.rings import MAG_RING
from flightstack.estimation.sensor_feed import SlowSamples, fix_row, fix_sample
from flightstack.estimation.sensor_samples import BaroSample, GnssSample, MagSample
from flightstack.flight_log.estimator_topics import ESTIMATOR, WIND_GROUP, store_estimator
from flightstack.flight_log.flight_log import DEFAULT_CAPACITY, FlightLog, Trace
from flightstack.flight_log.local_position import store_local_position
from flightstack.flight_log.sensor_rows import DUE_TIMES, DueTimes
from flightstack.flight_log.sensor_topics import (
    BARO_GROUP,
    GNSS_GROUP,
    MAG_GROUP,
    TRUTH_GLOBAL_GROUP,
    TRUTH_GROUP,
)
from flightstack.process.assembly import Stack
from flightstack.simulator_link.gps_kernels import FIX_SIZE, FixRow
from flightstack.simulator_link.sensor_frames import HIL_VALUES
from flightstack.vehicle.estimation import HEALTH_US, Estimation, Watched
from flightstack.vehicle.slow_kernel import SLOW_MARKS, SlowMarks

_Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of the kernel for one part."""
_GROUPS = (MAG_GROUP, BARO_GROUP, GNSS_GROUP, TRUTH_GROUP, TRUTH_GLOBAL_GROUP, ESTIMATOR, WIND_GROUP)
"""In the order of the kernel's counters of new rows."""
_ROWS = tuple(name for name in SlowMarks._fields if name.endswith("_rows"))


def estimators_of(stack: Stack) -> tuple[Estimator, ...]:
    """Return the estimators of a vehicle that flies on its sensors."""
    return () if stack.estimation is None else stack.estimation.estimators


def sensing_of(stack: Stack, wires: SingleArray) -> _Arguments:
    """Return what the filters read and write; ``wires`` are those of ``QuietSimulator``."""
    spare = np.zeros(RECORD_SIZE)
    if stack.estimation is None:  # nothing happens on the true state
        no_bytes = np.zeros(0, np.uint8)
        rings = ((np.zeros((0, 0)), np.zeros(0, np.int64)),)
        return np.zeros((0, 0), np.float32), (no_bytes,), rings, (no_bytes,), spare
    tracks = [lane.newest.imu_track for lane in stack.estimation.feed.lanes]
    return (
        wires,
        tuple(as_bytes(track.memory) for track in tracks),
        tuple((track.ring, track.taken) for track in tracks),
        tuple(as_bytes(estimator.memory) for estimator in stack.estimation.estimators),
        spare,
    )


def estimates_of(stack: Stack) -> list[_Arguments]:
    """Return what the filter of each inertial sensor writes."""
    found: list[_Arguments] = []
    for number, estimator in enumerate(estimators_of(stack)):
        memory = estimator.memory
        resets = tuple(memory["resets"][kind]["number"] for kind in ("position", "velocity", "yaw"))
        found.append((number, memory["state"][0], memory["flags"]["aligned"], resets))
    no_resets = np.zeros(1), np.zeros(1), np.zeros(1)
    return found or [(0, np.zeros(STATE_SIZE), np.zeros(1, np.int64), no_resets)]


def _calls(estimation: Estimation, columns: FloatArray) -> dict[str, int]:
    """Return the addresses of the kernels; ``columns`` are those of the estimate in the rows of the outer loop."""
    memory, track = estimation.estimators[0].memory, estimation.feed.lanes[0].newest.imu_track.memory
    watch, limits = estimation.watch, estimation.limits
    row, wind = np.zeros(ESTIMATOR.columns), np.zeros(WIND_GROUP.columns)
    return {
        "push": address_of(push_kernel, memory, MAG_RING, np.zeros(4)),
        "watch": address_of(watch_estimate, memory, watch, track, limits, False, False, 0.0),
        "local_position": address_of(store_local_position, memory, track, False, 0.0, columns),
        "estimator": address_of(store_estimator, memory, track, 0.0, row, wind),
    }


class QuietSensors:
    """The sensors that are not inertial, health, and the logs of estimate and truth, of a vehicle on its sensors.

    Of one that flies on the true state: nothing is due.
    """

    def __init__(self, stack: Stack, values: SingleArray, news: RecordArray, gps: ByteArray) -> None:
        """``values``, ``news`` and ``gps`` are those of ``QuietSimulator``."""
        estimation = self._estimation = stack.estimation
        self._no_traces = [Trace(DEFAULT_CAPACITY, group.columns, lambda: None) for group in _GROUPS]
        self._log: FlightLog | None = None
        self._traces = self._no_traces
        """Those of the log."""
        self._marks = np.zeros(1, SLOW_MARKS)
        self._marks["fix"] = math.nan
        self._fix: GnssSample | None = None
        """The sample that is noted in the marks."""
        self._place = np.zeros(5)
        """Origin of the estimate, as ``GnssReceiver`` has that of the simulator."""
        self._marks["health_us"] = NEVER_US
        due = np.array([DueTimes(NEVER_US, NEVER_US, NEVER_US, NEVER_US)], DUE_TIMES)
        columns = stack.recorder.estimate
        self.calls = {} if estimation is None else _calls(estimation, columns)
        """Addresses of the kernels, by their names in ``QuietCalls``."""
        offset_m, place, watch, limits = np.zeros(3), np.zeros(5), np.zeros(1, WATCH), np.zeros(1, LIMITS)
        if estimation is not None:
            recorder, watch, limits = estimation.recorder, estimation.watch, estimation.limits
            offset_m, place, due = recorder.offset_m, recorder.place, recorder.due
        scratch = np.zeros(4), np.zeros(4), np.zeros(2), np.zeros(2)
        gnss = gps, self._place, np.zeros(FIX_SIZE), np.zeros(GNSS_SIZE), np.zeros(GNSS_SIZE)
        truth = stack.simulator.truth, offset_m, place
        health = watch, limits, HEALTH_US
        self.constant: tuple[Any, ...] = (
            self._marks, news, values.view(HIL_VALUES), scratch, truth, health, gnss, due, columns,
        )  # fmt: skip
        """Argument ``slow`` of the kernel."""

    def room(self) -> int:
        """Return for how many ticks the logs suffice."""
        return min(trace.capacity - trace.n for trace in self._open_traces())

    def following(self) -> tuple[Any, ...]:
        """Return the argument ``following`` of the kernel; call once before each of its calls."""
        marks, estimation, delays_s = self._marks, self._estimation, (0.0, 0.0, 0.0)
        conditions = 0, False, False
        if estimation is not None:
            params = estimation.estimators[0].params
            delays_s = float(params.mag_delay_s), float(params.baro_delay_s), float(params.gnss_delay_s)
            self._begin(estimation)
            marks["health_us"], conditions = estimation.begin_watch()
        logs = tuple((trace.rows, trace.times_us, trace.n) for trace in self._open_traces())
        return delays_s, logs, conditions

    def _begin(self, estimation: Estimation) -> None:
        """Note the newest fix and the origin of the estimate; nothing is new."""
        marks, frame, newest = self._marks, estimation.estimators[0].frame, estimation.samples.gnss
        marks["mag_us"] = marks["baro_us"] = marks["gnss_us"] = 0
        for name in _ROWS:
            marks[name] = 0
        if newest is not self._fix and newest is not None:
            self._fix, marks["fix"][0] = newest, fix_row(newest)
        if frame is not None:
            self._place[:] = (*frame.origin, *frame.scales)

    def _open_traces(self) -> list[Trace]:
        """Return the traces of the open log; without one, traces that are not recorded."""
        log = None if self._estimation is None else self._estimation.recorder.log
        if log is not self._log:
            self._log = log
            self._traces = self._no_traces if log is None else [log.sampled[group.name] for group in _GROUPS]
        return self._traces

    def count_rows(self) -> None:
        """Count the new rows of the log."""
        if self._estimation is None or self._log is None:
            return
        m = SlowMarks(*self._marks[0].item())
        rows = (
            m.mag_rows,
            m.baro_rows,
            m.gnss_rows,
            m.truth_rows,
            m.global_rows,
            m.estimator_rows,
            m.wind_rows,
        )
        for trace, new in zip(self._open_traces(), rows, strict=True):
            trace.n += new

    def pass_by(self, time_us: int, interval_us: int) -> None:
        """Bring the estimation to ``time_us``."""
        assert self._estimation is not None
        marks = SlowMarks(*self._marks[0].item())
        mag = MagSample(marks.mag_us * 1e-6, Vector3(*marks.field_gauss.tolist())) if marks.mag_us else None
        baro = (
            BaroSample(marks.baro_us * 1e-6, marks.pressure_hpa, marks.altitude_m, marks.temperature_c)
            if marks.baro_us
            else None
        )
        gnss = fix_sample(marks.gnss_us * 1e-6, FixRow(*marks.fix.tolist())) if marks.gnss_us else None
        self._fix = gnss or self._fix
        self._estimation.pass_by(
            time_us, interval_us, SlowSamples(mag, baro, gnss), Watched(marks.health_us, marks.conditions)
        )

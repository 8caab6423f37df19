"""Samples for an estimator from the messages of the simulator."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from flightstack.core.contract import FloatArray, SingleArray, Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.estimation.estimator import StateEstimator
from flightstack.estimation.imu_track import RECORD_SIZE, ImuTrack
from flightstack.estimation.sensor_samples import (
    BaroSample,
    FlowSample,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from flightstack.simulator_link.gps_kernels import FixRow
from flightstack.simulator_link.sensor_frames import ACCEL, BARO, GYRO, MAG, HilGps
from flightstack.simulator_link.sensor_inbox import FlowReport, HilReport, RangeReport, Report

Sample = MagSample | BaroSample | GnssSample | RangeSample | FlowSample
_IMU = ACCEL | GYRO


class SampleRecorder(Protocol):
    """Records the samples that an estimator takes."""

    def imu_row(self, time_us: int) -> FloatArray:
        """Return the row for a sample of the inertial sensor, shape (7,), as ``imu_track`` describes it."""
        ...

    def sample(self, sample: Sample) -> None:
        """Record a sample of another sensor."""
        ...


class NoRecorder:
    """Records nothing."""

    def __init__(self) -> None:
        self._scratch = np.zeros(RECORD_SIZE)

    def imu_row(self, _time_us: int) -> FloatArray:
        """Return a row that is not recorded."""
        return self._scratch

    def sample(self, sample: Sample) -> None:
        """Leave out a sample of another sensor."""


NO_RECORDER = NoRecorder()


@dataclass(slots=True)
class NewestSamples:
    """Newest sample of each sensor; None before the first one."""

    imu_track: ImuTrack = field(default_factory=ImuTrack)
    """The last samples of the inertial sensor."""
    mag: MagSample | None = None
    baro: BaroSample | None = None
    gnss: GnssSample | None = None
    range: RangeSample | None = None
    flow: FlowSample | None = None

    @property
    def imu(self) -> ImuSample | None:
        """Newest sample of the inertial sensor."""
        return self.imu_track.newest


def slow_samples(time_s: float, report: HilReport) -> Iterator[MagSample | BaroSample]:
    """Yield the samples in a HIL_SENSOR but the inertial one: those of which all bits are set, as PX4 takes them.

    One with values that are not finite is none, so that its sensor counts as missing.
    """
    fields, values = report.fields, report.values
    if fields & MAG == MAG and _is_finite(values.mag_gauss):
        yield MagSample(time_s, Vector3(*values.mag_gauss))
    if fields & BARO == BARO and math.isfinite(values.altitude_m):
        yield BaroSample(time_s, values.pressure_hpa, values.altitude_m, values.temperature_c)


def _is_finite(values: Sequence[float]) -> bool:
    return math.isfinite(sum(values))


def fix_row(sample: GnssSample) -> FixRow:
    """Return a sample as a row of numbers, without its accuracy of the speed."""
    place = sample.latitude_deg, sample.longitude_deg, sample.altitude_msl_m
    accuracy = sample.eph_m, sample.epv_m
    return FixRow(*place, *accuracy, *sample.velocity_ned_m_s, sample.fix_type, sample.satellites)


def fix_sample(time_s: float, fix: FixRow) -> GnssSample:
    """Return the sample of a row of numbers; the accuracy of the speed is not known."""
    velocity = Vector3(fix.north_m_s, fix.east_m_s, fix.down_m_s)
    kind, satellites = int(fix.fix_type), int(fix.satellites)
    return GnssSample(time_s, *fix[:3], velocity, fix.eph_m, fix.epv_m, math.nan, kind, satellites)


def gnss_sample(time_s: float, gps: HilGps) -> GnssSample:
    """Return the sample of a HIL_GPS, which has no accuracy of the speed."""
    return GnssSample(
        time_s,
        gps.latitude_deg,
        gps.longitude_deg,
        gps.altitude_m,
        Vector3(*gps.velocity_ned_m_s),
        gps.eph_m,
        gps.epv_m,
        math.nan,
        gps.fix_type,
        gps.satellites,
    )


def sample_of(time_s: float, content: HilGps | RangeReport | FlowReport) -> Sample:
    """Return the sample in a message of another sensor."""
    if isinstance(content, HilGps):
        return gnss_sample(time_s, content)
    if isinstance(content, RangeReport):
        return RangeSample(time_s, content.distance_m, content.quality)
    return FlowSample(time_s, content.dt_s, *content.flow_rad, Vector3(*content.gyro_rad), content.quality)


class SlowSamples(NamedTuple):
    """Newest samples that kernels gave the estimators; None without one."""

    mag: MagSample | None = None
    baro: BaroSample | None = None
    gnss: GnssSample | None = None


class Lane:
    """An estimator and the inertial sensor that it follows."""

    def __init__(self, estimator: StateEstimator) -> None:
        self.estimator = estimator
        self.newest = NewestSamples()
        """Newest samples that the estimator took."""
        self.measured_us = 0
        """Time of the newest sample of the inertial sensor."""
        self.step_us = 0
        """Duration of that sample."""


class SensorFeed:
    """Feeds an estimator for each inertial sensor, and writes the state of the selected one.

    Of other kinds, the first sensor feeds all estimators.
    """

    def __init__(
        self,
        estimator: StateEstimator,
        state: FloatArray,
        recorder: SampleRecorder = NO_RECORDER,
        spares: Sequence[StateEstimator] = (),
    ) -> None:
        """``state`` is the array form of ``VehicleState`` to write, in the local frame of the estimators.

        ``spares`` follow the second and further inertial sensors. ``recorder`` records the selected one.
        """
        self.lanes = tuple(Lane(each) for each in (estimator, *spares))
        """Estimators by the number of their inertial sensor."""
        self._selected = self.lanes[0]
        self._state, self._recorder = state, recorder
        self._has_frame = False

    @property
    def newest(self) -> NewestSamples:
        """Newest samples of the selected lane."""
        return self._selected.newest

    def select(self, number: int) -> None:
        """Select the lane that writes the state, and write it."""
        self._selected = self.lanes[number]
        self._write_state()

    def update(self, reports: list[Report]) -> bool:
        """Take the reports; return True if the state is known and was written."""
        for time_us, content in reports:
            if isinstance(content, HilReport):
                if content.number < len(self.lanes):
                    self._take_hil(time_us, content)
            elif not isinstance(content, HilGps) or content.number == 0:
                self._take(sample_of(time_us * 1e-6, content))
        return self._write_state()

    def update_imus(self, time_us: int, step_us: int, wires: Sequence[SingleArray]) -> None:
        """Take a measurement of each inertial sensor alone, as ``update`` does, from the values of their HIL_SENSOR.

        ``step_us`` is the time since the last one.
        """
        for lane, wire in zip(self.lanes, wires, strict=False):
            self._take_imu(lane, time_us, step_us, wire)
        self._write_state()

    def _take_imu(self, lane: Lane, time_us: int, step_us: int, wire: SingleArray) -> None:
        recorder = self._recorder if lane is self._selected else NO_RECORDER
        row = lane.newest.imu_track.take_wire(time_us * 1e-6, step_us, wire, recorder.imu_row(time_us))
        lane.measured_us, lane.step_us = time_us, step_us
        lane.estimator.imu_row(row)

    def pass_by(self, time_us: int, step_us: int, samples: SlowSamples) -> None:
        """Count a measurement of each inertial sensor at ``time_us`` as taken, and those of other sensors."""
        mag, baro, gnss = samples
        for lane in self.lanes:
            newest = lane.newest
            lane.measured_us, lane.step_us = time_us, step_us
            newest.mag, newest.baro = mag or newest.mag, baro or newest.baro
            if gnss is not None:
                newest.gnss = gnss
                lane.estimator.pass_fix(gnss)

    @property
    def selected(self) -> int:
        """Number of the lane that writes the state."""
        return self.lanes.index(self._selected)

    def _write_state(self) -> bool:
        estimator = self._selected.estimator
        if not estimator.aligned:
            return False
        estimator.write_state(self._state)
        return estimator.frame is not None

    def _take_hil(self, time_us: int, report: HilReport) -> None:
        """Take a HIL_SENSOR. The first one has no step, and its inertial measurement no duration: it is left out.

        So is one that is not finite: the sensor counts as missing.
        """
        number, fields, wire, step_us = report
        imu = wire[:6]
        if fields & _IMU == _IMU and step_us > 0 and _is_finite(imu.tolist()):
            self._take_imu(self.lanes[number], time_us, step_us, imu)
        if fields & ~_IMU and number == 0:
            for sample in slow_samples(time_us * 1e-6, report):
                self._take(sample)

    def _take(self, sample: Sample) -> None:
        for lane in self.lanes:
            estimator, newest = lane.estimator, lane.newest
            if isinstance(sample, MagSample):
                newest.mag = sample
                estimator.mag(sample)
            elif isinstance(sample, BaroSample):
                newest.baro = sample
                estimator.baro(sample)
            elif isinstance(sample, GnssSample):
                newest.gnss = sample
                estimator.gnss(sample)
                if not self._has_frame and estimator.frame is not None:
                    self._share_frame(estimator.frame)
            elif isinstance(sample, RangeSample):
                newest.range = sample
                estimator.range(sample)
            else:
                newest.flow = sample
        self._recorder.sample(sample)

    def _share_frame(self, frame: LocalFrame) -> None:
        """Give all estimators the local frame of the first one that has one."""
        self._has_frame = True
        for lane in self.lanes:
            lane.estimator.frame = frame

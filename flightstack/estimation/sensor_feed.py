"""Samples for an estimator from the messages of the simulator."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.estimation.imu_track import ImuTrack
from flightstack.estimation.sensor_samples import (
    BaroSample,
    FlowSample,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from flightstack.simulator_link.sensor_frames import (
    ACCEL,
    ACCEL_AT,
    ALTITUDE_AT,
    BARO,
    GYRO,
    GYRO_AT,
    MAG,
    MAG_AT,
    PRESSURE_AT,
    TEMPERATURE_AT,
    HilGps,
)
from flightstack.simulator_link.sensor_inbox import FlowReport, HilReport, RangeReport, Report

Sample = MagSample | BaroSample | GnssSample | RangeSample | FlowSample
_IMU = ACCEL | GYRO


class StateEstimator(Protocol):
    """An estimator: samples in, the state of the vehicle out."""

    frame: LocalFrame | None
    """The local frame of its position; None before the first fix."""

    @property
    def aligned(self) -> bool:
        """True if the attitude is known."""
        ...

    def imu_row(self, row: FloatArray) -> None:
        """Take a sample of an inertial sensor in its array form, shape (8,)."""
        ...

    def mag(self, sample: MagSample) -> None:
        """Take a sample of the magnetometer."""
        ...

    def baro(self, sample: BaroSample) -> None:
        """Take a sample of the barometer."""
        ...

    def gnss(self, sample: GnssSample) -> None:
        """Take a sample of the GNSS receiver."""
        ...

    def range(self, sample: RangeSample) -> None:
        """Take a sample of the rangefinder."""
        ...

    def write_state(self, out: FloatArray) -> None:
        """Write the state at the time of the newest sample of the inertial sensor, as ``VehicleState``, shape (13,)."""
        ...


class SampleRecorder(Protocol):
    """Records the samples that an estimator takes."""

    def imu(self, time_us: int, dt_us: int, row: FloatArray) -> None:
        """Record a sample of the inertial sensor in its array form, shape (8,)."""
        ...

    def sample(self, sample: Sample) -> None:
        """Record a sample of another sensor."""
        ...


class NoRecorder:
    """Records nothing."""

    def imu(self, time_us: int, dt_us: int, row: FloatArray) -> None:
        """Leave out a sample of the inertial sensor."""

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
    """Yield the samples in a HIL_SENSOR but the inertial one: those of which all bits are set, as PX4 takes them."""
    fields, values = report.fields, report.values
    if fields & MAG == MAG:
        yield MagSample(time_s, Vector3(*values[MAG_AT]))
    if fields & BARO == BARO:
        yield BaroSample(time_s, values[PRESSURE_AT], values[ALTITUDE_AT], values[TEMPERATURE_AT])


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


class SensorFeed:
    """Feeds an estimator with the first sensor of each kind, and writes its state."""

    def __init__(
        self, estimator: StateEstimator, state: FloatArray, recorder: SampleRecorder = NO_RECORDER
    ) -> None:
        """``state`` is the array form of ``VehicleState`` to write, in the estimator's local frame."""
        self._estimator, self._state, self._recorder = estimator, state, recorder
        self.newest = NewestSamples()

    def update(self, reports: list[Report]) -> bool:
        """Take the reports; return True if the state is known and was written."""
        for time_us, content in reports:
            if isinstance(content, HilReport):
                if content.number == 0:
                    self._take_hil(time_us, content)
            elif not isinstance(content, HilGps) or content.number == 0:
                self._take(sample_of(time_us * 1e-6, content))
        estimator = self._estimator
        if not estimator.aligned:
            return False
        estimator.write_state(self._state)
        return estimator.frame is not None

    def _take_hil(self, time_us: int, report: HilReport) -> None:
        """Take a HIL_SENSOR. The first one has no step, and its inertial measurement no duration: it is left out."""
        _, fields, values, step_us = report
        time_s = time_us * 1e-6
        if fields & _IMU == _IMU and step_us > 0:
            row = self.newest.imu_track.take(time_s, step_us * 1e-6, values[GYRO_AT], values[ACCEL_AT])
            self._estimator.imu_row(row)
            self._recorder.imu(time_us, step_us, row)
        if fields & ~_IMU:
            for sample in slow_samples(time_s, report):
                self._take(sample)

    def _take(self, sample: Sample) -> None:
        estimator, newest = self._estimator, self.newest
        if isinstance(sample, MagSample):
            newest.mag = sample
            estimator.mag(sample)
        elif isinstance(sample, BaroSample):
            newest.baro = sample
            estimator.baro(sample)
        elif isinstance(sample, GnssSample):
            newest.gnss = sample
            estimator.gnss(sample)
        elif isinstance(sample, RangeSample):
            newest.range = sample
            estimator.range(sample)
        else:
            newest.flow = sample
        self._recorder.sample(sample)

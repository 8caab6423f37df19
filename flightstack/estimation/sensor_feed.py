"""Samples for an estimator from the messages of the simulator."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Protocol

from flightstack.core.contract import FloatArray, Vector3, VehicleState
from flightstack.core.geodesy import LocalFrame
from flightstack.estimation.sensor_samples import (
    BaroSample,
    FlowSample,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)
from flightstack.estimation.vibration import WINDOW
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

Sample = ImuSample | MagSample | BaroSample | GnssSample | RangeSample | FlowSample
_IMU = ACCEL | GYRO


class StateEstimator(Protocol):
    """An estimator: samples in, the state of the vehicle out."""

    frame: LocalFrame | None
    """The local frame of its position; None before the first fix."""

    @property
    def aligned(self) -> bool:
        """True if the attitude is known."""
        ...

    def imu(self, sample: ImuSample) -> None:
        """Take a sample of an inertial sensor."""
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

    def state(self) -> VehicleState:
        """Return the state at the time of the newest sample of the inertial sensor."""
        ...


@dataclass(slots=True)
class NewestSamples:
    """Newest sample of each sensor; None before the first one."""

    imu: ImuSample | None = None
    mag: MagSample | None = None
    baro: BaroSample | None = None
    gnss: GnssSample | None = None
    range: RangeSample | None = None
    flow: FlowSample | None = None
    past_imu: deque[ImuSample] = field(default_factory=lambda: deque(maxlen=WINDOW))
    """The last samples of the inertial sensor, of which the vibration is computed."""
    imu_repeats: int = 0
    """Number of samples of the inertial sensor whose rates or forces equal those before."""


def hil_samples(time_s: float, report: HilReport) -> Iterator[ImuSample | MagSample | BaroSample]:
    """Yield the samples in a HIL_SENSOR: those of which all bits are set, as PX4 takes them.

    The first message has no step, and its inertial measurement no duration: it is left out.
    """
    fields, values = report.fields, report.values
    if fields & _IMU == _IMU and report.step_us > 0:
        yield ImuSample(time_s, report.step_us * 1e-6, Vector3(*values[GYRO_AT]), Vector3(*values[ACCEL_AT]))
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


def samples_of(report: Report) -> Iterator[tuple[int, Sample]]:
    """Yield the samples in a message, each with the number of the sensor."""
    time_s, content = report.time_us * 1e-6, report.content
    if isinstance(content, HilReport):
        for sample in hil_samples(time_s, content):
            yield content.number, sample
    elif isinstance(content, HilGps):
        yield content.number, gnss_sample(time_s, content)
    elif isinstance(content, RangeReport):
        yield 0, RangeSample(time_s, content.distance_m, content.quality)
    elif isinstance(content, FlowReport):
        yield (
            0,
            FlowSample(time_s, content.dt_s, *content.flow_rad, Vector3(*content.gyro_rad), content.quality),
        )


class SensorFeed:
    """Feeds an estimator with the first sensor of each kind, and writes its state."""

    def __init__(
        self,
        estimator: StateEstimator,
        state: FloatArray,
        record: Callable[[Sample], object] = lambda _: None,
    ) -> None:
        """``state`` is the array form of ``VehicleState`` to write, in the estimator's local frame.

        ``record`` is called with each sample that the estimator takes.
        """
        self._estimator, self._state, self._record = estimator, state, record
        self.newest = NewestSamples()

    def update(self, reports: list[Report]) -> bool:
        """Take the reports; return True if the state is known and was written."""
        for report in reports:
            for number, sample in samples_of(report):
                if number == 0:
                    self._take(sample)
                    self._record(sample)
        estimator, state = self._estimator, self._state
        if not estimator.aligned:
            return False
        found = estimator.state()
        state[0:3], state[3:6] = found.position_ned_m, found.velocity_ned_m_s
        state[6:10], state[10:13] = found.attitude, found.rates_frd_rad_s
        return estimator.frame is not None

    def _take(self, sample: Sample) -> None:
        estimator, newest = self._estimator, self.newest
        if isinstance(sample, ImuSample):
            before, newest.imu = newest.imu, sample
            repeats = before is not None and (before[2] == sample[2] or before[3] == sample[3])
            newest.imu_repeats = newest.imu_repeats + 1 if repeats else 0
            newest.past_imu.append(sample)
            estimator.imu(sample)
        elif isinstance(sample, MagSample):
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

"""The estimator: samples of sensors in, attitude, velocity, position and their uncertainty out."""

from __future__ import annotations

import math
import struct
from typing import Any, Protocol

import numpy as np

from flightstack.core.contract import FloatArray, Quaternion, RecordArray, Vector3, VehicleState
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import atan2
from flightstack.estimation.estimator_params import EstimatorParams, GnssLimits
from flightstack.estimation.filter_core import FilterCore, PythonCore
from flightstack.estimation.fusion import GNSS_SIZE, UNKNOWN_M, UNKNOWN_M_S, UNKNOWN_VERTICAL_M
from flightstack.estimation.imu_track import IMU_SIZE
from flightstack.estimation.rings import BARO_RING, GNSS_RING, MAG_RING, RANGE_RING
from flightstack.estimation.sensor_samples import (
    BaroSample,
    GnssFix,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)

_pack_imu = struct.Struct(f"={IMU_SIZE}d").pack_into
_pack_mag, _pack_pair = struct.Struct("=4d").pack_into, struct.Struct("=2d").pack_into
"""A third of the time of an assignment to an array."""


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

    def pass_fix(self, sample: GnssSample) -> None:
        """Count a sample of the GNSS receiver as taken: a kernel gave it to the filter."""
        ...

    def range(self, sample: RangeSample) -> None:
        """Take a sample of the rangefinder."""
        ...

    def write_state(self, out: FloatArray) -> None:
        """Write the state at the time of the newest sample of the inertial sensor, as ``VehicleState``, shape (13,)."""
        ...


class Estimator:
    """Estimates the state of one vehicle. Samples of each sensor must arrive in the order of their time."""

    def __init__(
        self,
        params: EstimatorParams | None = None,
        limits: GnssLimits | None = None,
        core: FilterCore | None = None,
    ) -> None:
        """``core`` runs the filter, by default in this process, compiled from Python."""
        self.core: FilterCore = core or PythonCore()
        """Runs the filter."""
        self.memory: RecordArray = self.core.memory
        self.params = params or EstimatorParams()
        self.limits = limits or GnssLimits()
        self.core.start(self.params)
        self.frame: LocalFrame | None = None
        self._state: FloatArray = self.memory["state"][0]
        self._aligned = self.memory["flags"][
            "aligned"
        ].data  # a number of an array takes four times as long to read
        self._imu = np.zeros(IMU_SIZE)
        self._gnss = np.zeros(GNSS_SIZE)
        self._mag = np.zeros(4)
        self._pair = np.zeros(2)
        self._fix: tuple[Any, ...] = ()  # place and velocity of the last sample of GNSS
        self.imu_row = self.core.imu
        """Take a sample of the IMU in its array form, shape (8,)."""
        self._push = self.core.push

    def set_params(self, params: EstimatorParams, limits: GnssLimits) -> None:
        """Set the parameters; those of the initial uncertainty have no effect after the alignment."""
        self.params, self.limits = params, limits
        self.core.set_params(params)

    def refresh(self) -> None:
        """Bring the whole ``memory`` up to date: a filter elsewhere keeps only state, flags and resets so."""
        self.core.refresh()

    @property
    def aligned(self) -> bool:
        """True if the filter has an attitude."""
        return bool(self._aligned[0])

    def set_landed(self, landed: bool) -> None:
        """Tell the filter whether the vehicle stands on the ground."""
        self.core.set_landed(landed)

    def set_declination(self, declination_rad: float) -> None:
        """Set the magnetic declination, which holds until the Earth's field is known."""
        self.refresh()
        self.core.set_earth(np.array([*self.memory["earth"][0, :3], declination_rad]), False)

    def set_earth_field(self, field_ned_gauss: Vector3) -> None:
        """Set the Earth's magnetic field at the place of the vehicle, from the World Magnetic Model; also in flight."""
        declination_rad = atan2(field_ned_gauss.y, field_ned_gauss.x)
        self.core.set_earth(np.array([*field_ned_gauss, declination_rad]), True)

    def imu(self, sample: ImuSample) -> None:
        """Take a sample of the IMU."""
        time_s, dt_s, gyro, accel = sample
        _pack_imu(self._imu.data, 0, time_s, dt_s, *gyro, *accel)
        self.imu_row(self._imu)

    def mag(self, sample: MagSample) -> None:
        """Take a sample of the magnetometer."""
        time_s, field = sample
        _pack_mag(self._mag.data, 0, time_s - self.params.mag_delay_s, *field)
        self._push(MAG_RING, self._mag)

    def baro(self, sample: BaroSample) -> None:
        """Take a sample of the barometer."""
        _pack_pair(self._pair.data, 0, sample.time_s - self.params.baro_delay_s, sample.pressure_altitude_m)
        self._push(BARO_RING, self._pair)

    def range(self, sample: RangeSample) -> None:
        """Take a sample of the range finder."""
        if sample.quality > 0.0:
            self._pair[:] = sample.time_s - self.params.range_delay_s, sample.distance_m
            self._push(RANGE_RING, self._pair)

    def gnss(self, sample: GnssSample) -> None:
        """Take a sample of the GNSS receiver. The first three-dimensional fix becomes the origin.

        A fix of a moving vehicle that equals the last one is an old measurement, and is dropped: the receiver is stuck,
        or sends more often than it measures. At rest the fixes of an ideal receiver are equal.
        """
        before, self._fix = self._fix, sample[1:5]  # place and velocity
        repeats = self._fix == before and any(sample.velocity_ned_m_s)
        if repeats or sample.fix_type < GnssFix.FIX_3D or (self.frame is None and not self._is_good(sample)):
            return
        point = GeoPoint(sample.latitude_deg, sample.longitude_deg, sample.altitude_msl_m)
        if self.frame is None:
            if not self.aligned:
                return
            self.refresh()
            n, e, d = self.memory["nominal"][0, 7:10]
            origin = LocalFrame(point).to_geo(Vector3(-float(n), -float(e), -float(d)))
            self.frame = LocalFrame(origin)
        x = self._gnss
        x[0], x[1:4], x[4:7] = (
            sample.time_s - self.params.gnss_delay_s,
            self.frame.to_ned(point),
            sample.velocity_ned_m_s,
        )
        x[7:10] = sample.eph_m, sample.epv_m, sample.speed_accuracy_m_s
        self._push(GNSS_RING, x)

    def pass_fix(self, sample: GnssSample) -> None:
        """Count a sample of the GNSS receiver as taken: a kernel gave it to the filter."""
        self._fix = sample[1:5]

    def _is_good(self, sample: GnssSample) -> bool:
        """Return True if a fix is accurate enough to start from."""
        limits = self.limits
        return (
            sample.satellites >= limits.satellites
            and _is_within(sample.eph_m, UNKNOWN_M, limits.eph_m)
            and _is_within(sample.epv_m, UNKNOWN_VERTICAL_M, limits.epv_m)
            and _is_within(sample.speed_accuracy_m_s, UNKNOWN_M_S, limits.speed_accuracy_m_s)
        )

    def state(self) -> VehicleState:
        """Return the output at the time of the latest IMU sample."""
        x = self._state.tolist()
        return VehicleState(Vector3(*x[0:3]), Vector3(*x[3:6]), Quaternion(*x[6:10]), Vector3(*x[10:13]))

    def write_state(self, out: FloatArray) -> None:
        """Write the output to ``out``, shape (13,), in the order of ``VehicleState``."""
        out[:] = self._state

    def deviations(self) -> FloatArray:
        """Return the standard deviation of each error state, shape (27,)."""
        return np.sqrt(np.diag(self.memory["covariance"][0]))


def _is_within(accuracy: float, unknown: float, limit: float) -> bool:
    """Return True if an accuracy is within its limit; one that is not stated counts as ``unknown``."""
    return (accuracy if 0.0 <= accuracy < math.inf else unknown) <= limit

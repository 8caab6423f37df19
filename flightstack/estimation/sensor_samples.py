"""Measurements of the sensors as an estimator receives them.

Body frame FRD, world frame NED, SI units unless the name states another. ``time_s`` is the time to which the
measurement applies, on the vehicle's clock, or that of its reception, from which an estimator subtracts the delay of
the sensor, a parameter. NaN in a measured value means that the sensor does not provide it.
"""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.contract import Vector3


class GnssFix:
    """Kinds of a GNSS fix, the values of GPS_FIX_TYPE."""

    NO_GNSS = 0
    NO_FIX = 1
    FIX_2D = 2
    FIX_3D = 3
    DGNSS = 4
    RTK_FLOAT = 5
    RTK_FIXED = 6


class ImuSample(NamedTuple):
    """Means of the rates and of the specific force over the ``dt_s`` that end at ``time_s``.

    At rest and level the specific force is (0, 0, −g). The product with ``dt_s`` is the delta angle or delta velocity.
    """

    time_s: float
    dt_s: float
    gyro_frd_rad_s: Vector3
    accel_frd_m_s2: Vector3


class MagSample(NamedTuple):
    """Magnetic field in the body frame [gauss]."""

    time_s: float
    field_frd_gauss: Vector3


class BaroSample(NamedTuple):
    """Static pressure and its altitude in the standard atmosphere, above 1013.25 hPa."""

    time_s: float
    pressure_hpa: float
    pressure_altitude_m: float
    temperature_c: float


class GnssSample(NamedTuple):
    """Position and velocity of the antenna, with the standard deviations that the receiver states.

    ``time_s`` is the time of reception: the latency of the receiver is a parameter of the estimator.
    """

    time_s: float
    latitude_deg: float
    longitude_deg: float
    altitude_msl_m: float
    velocity_ned_m_s: Vector3
    eph_m: float
    epv_m: float
    speed_accuracy_m_s: float
    fix_type: int
    satellites: int


class RangeSample(NamedTuple):
    """Distance along the sensor's axis, which points down (+z of FRD) unless the vehicle's file states another."""

    time_s: float
    distance_m: float
    quality: float
    """0 (invalid) to 1."""


class FlowSample(NamedTuple):
    """Optical flow over ``dt_s``: angles about the body's x and y axes, with the rotation of the gyro included.

    The signs are MAVLink's: over level ground at height h, ``flow_x`` − ``gyro_x`` is −v_y · dt / h, and ``flow_y`` −
    ``gyro_y`` is v_x · dt / h.
    """

    time_s: float
    dt_s: float
    flow_x_rad: float
    flow_y_rad: float
    gyro_frd_rad: Vector3
    quality: float
    """0 (invalid) to 1."""

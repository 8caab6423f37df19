"""Fusion of each sensor's measurements at the delayed horizon."""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geometry import heading, rotate, wrap_pi
from flightstack.core.portable_math import atan2
from flightstack.estimation.derived_generated import (
    field_x_jacobian,
    field_y_jacobian,
    field_z_jacobian,
    yaw_jacobian,
)
from flightstack.estimation.error_state import (
    BARO_BIAS,
    GNSS_BIAS,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    read_nominal,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    HOLD_POSITION,
    INNOVATION,
    INNOVATION_VARIANCE,
    MAG,
    RANGE,
    REST_RATE,
    REST_VELOCITY,
    YAW,
    Filter,
    Noise,
    clear,
    fuse,
)
from flightstack.estimation.prediction import DeltaSample

GNSS_SIZE = 10
"""Array form of a GNSS measurement: time, position NED, velocity NED, eph, epv, speed accuracy."""
_CONFIRMATION, _LEAST_SHARE = 0.02, 0.01

GnssRow: TypeAlias = Annotated[FloatArray, GNSS_SIZE]


@compiled
def _accuracy(stated: float, otherwise: float) -> float:
    return stated if math.isfinite(stated) and stated > 0.0 else otherwise


@compiled
def _drift_gnss_bias(
    f: Filter, elapsed_s: float, eph_m: float, epv_m: float, params: EstimatorParams
) -> None:
    """Propagate the Gauss-Markov process of the GNSS position bias."""
    kept = max(0.0, 1.0 - elapsed_s / params.gnss_bias_s)
    for axis in range(3):
        at = GNSS_BIAS + axis
        spread = params.gnss_bias_share * (epv_m if axis == 2 else eph_m)
        f.nominal[25 + axis] *= kept
        for j in range(f.ph.size):
            f.covariance[at, j] *= kept
            f.covariance[j, at] *= kept
        f.covariance[at, at] += (1.0 - kept * kept) * spread * spread


@compiled
def _confirm_imu_noise(f: Filter, row: int) -> None:
    """Adapt the share of the measured IMU noise that counts, so that innovations have their predicted variance.

    Fast motion and vibration look like noise of the IMU, but do not add up to an error of the velocity.
    """
    o = f.observations
    ratio = min(o[row, INNOVATION] * o[row, INNOVATION] / o[row, INNOVATION_VARIANCE], 6.0)
    f.clock[1] = min(max(f.clock[1] * (1.0 + _CONFIRMATION * (ratio - 1.0)), _LEAST_SHARE), 1.0)


@compiled
def fuse_gnss(f: Filter, row: GnssRow, age_s: float, elapsed_s: float, params: EstimatorParams) -> None:
    """Fuse position and velocity, measured ``age_s`` before the time of the state."""
    eph_m, epv_m = _accuracy(row[7], 5.0), _accuracy(row[8], 8.0)
    speed_m_s = _accuracy(row[9], 0.5)
    _drift_gnss_bias(f, elapsed_s, eph_m, epv_m, params)
    for axis in range(3):
        least = params.gnss_velocity_noise_m_s
        noise = Noise(least, speed_m_s, max(2.0 * speed_m_s, least), params.gnss_velocity_gate, 0.0)
        clear(f.h)
        f.h[VELOCITY + axis] = 1.0
        if fuse(f, GNSS_VELOCITY + axis, row[4 + axis] - f.nominal[4 + axis], noise, 0.0):
            _confirm_imu_noise(f, GNSS_VELOCITY + axis)
    for axis in range(3):
        accuracy_m = epv_m if axis == 2 else eph_m
        noise = Noise(
            params.gnss_position_noise_m, accuracy_m, 2.0 * accuracy_m, params.gnss_position_gate, 0.0
        )
        clear(f.h)
        f.h[POSITION + axis] = 1.0
        f.h[GNSS_BIAS + axis] = 1.0
        then_m = f.nominal[7 + axis] - age_s * f.nominal[4 + axis]
        fuse(f, GNSS_POSITION + axis, row[1 + axis] - then_m - f.nominal[25 + axis], noise, 0.0)


@compiled
def fuse_baro(f: Filter, altitude_m: float, age_s: float, params: EstimatorParams) -> None:
    """Fuse a pressure altitude: minus the position down, plus the barometer's bias."""
    clear(f.h)
    f.h[POSITION + 2] = -1.0
    f.h[BARO_BIAS] = 1.0
    predicted_m = -(f.nominal[9] - age_s * f.nominal[6]) + f.nominal[24]
    noise = Noise(params.baro_noise_m, 1.0, params.baro_largest_noise_m, params.baro_gate, 0.0)
    fuse(f, BARO, altitude_m - predicted_m, noise, 0.0)


@compiled
def fuse_range(f: Filter, distance_m: float, ground_m: float, age_s: float, params: EstimatorParams) -> None:
    """Fuse a distance along the body's down axis to level ground at ``ground_m`` below the origin."""
    n = read_nominal(f.nominal)
    cos_tilt = 1.0 - 2.0 * (n.attitude.x * n.attitude.x + n.attitude.y * n.attitude.y)
    if cos_tilt < 0.7:
        return
    clear(f.h)
    f.h[POSITION + 2] = -1.0
    height_m = ground_m - (n.position_ned_m.z - age_s * n.velocity_ned_m_s.z)
    noise = Noise(params.range_noise_m, params.range_noise_m, 1.0, params.range_gate, 0.0)
    fuse(f, RANGE, distance_m * cos_tilt - height_m, noise, 0.0)


@compiled
def fuse_field(f: Filter, measured: Vector3, params: EstimatorParams) -> None:
    """Fuse the magnetic field in the body frame, axis by axis."""
    largest = params.mag_largest_noise_gauss
    noise = Noise(params.mag_noise_gauss, largest, largest, params.mag_gate, 1.0)
    holds = 1.0 - params.mag_corrects_tilt
    for axis in range(3):
        n = read_nominal(f.nominal)
        earth, body = n.earth_field_ned_gauss, n.body_field_frd_gauss
        clear(f.h)
        if axis == 0:
            innovation = measured.x - field_x_jacobian(n.attitude, earth, body, f.h)
        elif axis == 1:
            innovation = measured.y - field_y_jacobian(n.attitude, earth, body, f.h)
        else:
            innovation = measured.z - field_z_jacobian(n.attitude, earth, body, f.h)
        fuse(f, MAG + axis, innovation, noise, holds)


@compiled
def fuse_yaw(f: Filter, yaw_rad: float, noise_rad: float, gate: float) -> None:
    """Fuse a measured yaw (3-2-1)."""
    n = read_nominal(f.nominal)
    clear(f.h)
    yaw_jacobian(n.attitude, f.h)
    fuse(
        f, YAW, wrap_pi(yaw_rad - heading(n.attitude)), Noise(noise_rad, noise_rad, noise_rad, gate, 0.0), 1.0
    )


@compiled
def fuse_rest(f: Filter, sample: DeltaSample, params: EstimatorParams) -> None:
    """Fuse zero velocity and zero rate of a vehicle that stands."""
    measured = Vector3(
        sample.angle_rad.x / sample.dt_s, sample.angle_rad.y / sample.dt_s, sample.angle_rad.z / sample.dt_s
    )
    n = read_nominal(f.nominal)
    innovation = Vector3(
        measured.x - n.gyro_bias_rad_s.x, measured.y - n.gyro_bias_rad_s.y, measured.z - n.gyro_bias_rad_s.z
    )
    velocity = params.rest_velocity_noise_m_s
    still = Noise(velocity, velocity, velocity, 5.0, 0.0)
    density = max(sample.gyro_density.x, sample.gyro_density.y, sample.gyro_density.z)
    deviation = params.rest_rate_noise_rad_s + math.sqrt(density / sample.dt_s)
    rate = Noise(deviation, deviation, deviation, 3.0, 0.0)
    for axis in range(3):
        clear(f.h)
        f.h[VELOCITY + axis] = 1.0
        fuse(f, REST_VELOCITY + axis, -f.nominal[4 + axis], still, 0.0)
        clear(f.h)
        f.h[GYRO_BIAS + axis] = 1.0
        value = innovation.x if axis == 0 else innovation.y if axis == 1 else innovation.z
        fuse(f, REST_RATE + axis, value, rate, 0.0)


@compiled
def yaw_of_field(f: Filter, measured: Vector3, declination_rad: float) -> float:
    """Return the yaw [rad] at which the horizontal field points to magnetic north."""
    n = read_nominal(f.nominal)
    level = rotate(n.attitude, measured)
    return wrap_pi(heading(n.attitude) - atan2(level.y, level.x) + declination_rad)


@compiled
def fuse_hold(f: Filter, north_m: float, east_m: float, params: EstimatorParams) -> None:
    """Fuse a horizontal position that is held without a measurement of it, which bounds velocity and tilt."""
    noise = Noise(params.hold_noise_m, params.hold_noise_m, params.hold_noise_m, 100.0, 0.0)
    for axis in range(2):
        clear(f.h)
        f.h[POSITION + axis] = 1.0
        held_m = north_m if axis == 0 else east_m
        fuse(f, HOLD_POSITION + axis, held_m - f.nominal[7 + axis], noise, 0.0)

"""Fusion of each sensor's measurements at the delayed horizon."""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3
from flightstack.estimation.derived_generated import (
    drag_x_jacobian,
    drag_y_jacobian,
    field_x_jacobian,
    field_y_jacobian,
    field_z_jacobian,
)
from flightstack.estimation.error_state import (
    BARO_BIAS,
    ERROR_STATES,
    GNSS_BIAS,
    GYRO_BIAS,
    POSITION,
    VELOCITY,
    read_nominal,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.kalman import (
    BARO,
    CORRELATED,
    DRAG,
    GNSS_POSITION,
    GNSS_VELOCITY,
    HOLD_POSITION,
    HOLDS_HORIZONTAL,
    HOLDS_TILT,
    HOLDS_TILT_AND_GYRO,
    MAG,
    RANGE,
    REST_RATE,
    REST_VELOCITY,
    SLOW,
    WHITE,
    Filter,
    Noise,
    clear,
    fuse,
)
from flightstack.estimation.source_checks import POSITION_DRIFTS, VELOCITY_IS_WRONG, WRONG_VELOCITY_M_S

GNSS_SIZE = 10
"""Array form of a GNSS measurement: time, position NED, velocity NED, eph, epv, speed accuracy."""
_CONFIRMATION, _LEAST_SHARE = 0.02, 0.01
UNKNOWN_M, UNKNOWN_VERTICAL_M, UNKNOWN_M_S = 5.0, 8.0, 0.5
"""Accuracies of a GNSS receiver that states none."""
_AIR_KG_M3, _DRAG_GATE = 1.225, 5.0
_HEIGHT_RETURN_S, _BARO_LOST_S = 1800.0, 5.0
"""Time constant with which the change of the vertical error of GNSS since the first fix returns to zero, and age of the
last pressure altitude above which it does so faster."""
_MAG_START = 25.0
"""Noise of the magnetometer that is assumed at the start, by its least."""
_AIDED_S = 1.0
"""Time after an accepted GNSS velocity in which the horizontal motion counts as measured."""
LEAST_COS_TILT = 0.7
"""Cosine of the tilt below which the range finder is not used: 45 degrees."""

GnssRow: TypeAlias = Annotated[FloatArray, GNSS_SIZE]


@compiled
def _stated(accuracy: float, unknown: float) -> float:
    """Return an accuracy that a receiver states; ``unknown`` if it states none. Zero is an ideal receiver's."""
    return accuracy if math.isfinite(accuracy) and accuracy >= 0.0 else unknown


@compiled
def horizontal_accuracy(row: GnssRow) -> float:
    """Return the accuracy [m] of the horizontal position of a GNSS measurement."""
    return _stated(row[7], UNKNOWN_M)


@compiled
def vertical_accuracy(row: GnssRow) -> float:
    """Return the accuracy [m] of the altitude of a GNSS measurement."""
    return _stated(row[8], UNKNOWN_VERTICAL_M)


@compiled
def speed_accuracy(row: GnssRow) -> float:
    """Return the accuracy [m/s] of the velocity of a GNSS measurement."""
    return _stated(row[9], UNKNOWN_M_S)


@compiled
def gnss_bias_share(params: EstimatorParams, axis: int) -> float:
    """Return the share of the stated accuracy that is a slow error of one axis: eph covers two axes, epv one."""
    return params.gnss_bias_share * (math.sqrt(2.0) if axis == 2 else 1.0)


@compiled
def drift_gnss_bias(f: Filter, row: GnssRow, elapsed_s: float, params: EstimatorParams) -> None:
    """Propagate the Gauss-Markov process of the GNSS position bias.

    The height begins at the ground, so its bias is the error since the first fix. Its mean is not zero but minus the
    error of that fix, which is not a state: it returns to zero so slowly that the barometer decides for half an hour.
    Without a barometer it returns as fast as the others, for GNSS velocity alone drifts more.
    """
    eph_m, epv_m = horizontal_accuracy(row), vertical_accuracy(row)
    kept = max(0.0, 1.0 - elapsed_s / params.gnss_bias_s)
    has_baro = f.clock[0] - f.observations[BARO]["fused_s"] < _BARO_LOST_S
    for at in range(GNSS_BIAS, ERROR_STATES):
        spread = gnss_bias_share(params, at - GNSS_BIAS) * (epv_m if at == GNSS_BIAS + 2 else eph_m)
        return_s = _HEIGHT_RETURN_S if has_baro and at == GNSS_BIAS + 2 else params.gnss_bias_s
        left = max(0.0, 1.0 - elapsed_s / return_s)
        f.nominal[at + 1] *= left
        for j in range(at + 1):
            f.covariance[j, at] *= left
        for j in range(at, ERROR_STATES):
            f.covariance[at, j] *= left
        f.covariance[at, at] += (1.0 - kept * kept) * spread * spread


@compiled
def _confirm_imu_noise(f: Filter, row: int) -> None:
    """Adapt the share of the measured IMU noise that counts, so that innovations have their predicted variance.

    Fast motion and vibration look like noise of the IMU, but do not add up to an error of the velocity.
    """
    o = f.observations[row]
    ratio = min(o["innovation"] * o["innovation"] / o["variance"], 6.0)
    f.clock[1] = min(max(f.clock[1] * (1.0 + _CONFIRMATION * (ratio - 1.0)), _LEAST_SHARE), 1.0)


@compiled
def fuse_gnss_velocity(f: Filter, row: GnssRow, axis: int, fault: float, params: EstimatorParams) -> None:
    """Fuse the velocity along an axis; with the fault ``VELOCITY_IS_WRONG`` it has more noise."""
    speed_m_s = speed_accuracy(row)
    least = WRONG_VELOCITY_M_S if fault == VELOCITY_IS_WRONG else params.gnss_velocity_noise_m_s
    noise = Noise(least, speed_m_s, max(2.0 * speed_m_s, least), params.gnss_velocity_gate, WHITE)
    clear(f.h)
    f.h[VELOCITY + axis] = 1.0
    accepted = fuse(f, GNSS_VELOCITY + axis, row[4 + axis] - f.nominal[4 + axis], noise, 0.0)
    if accepted and fault != VELOCITY_IS_WRONG:
        _confirm_imu_noise(f, GNSS_VELOCITY + axis)


@compiled
def fuse_gnss_position(
    f: Filter, row: GnssRow, age_s: float, axis: int, fault: float, params: EstimatorParams
) -> None:
    """Fuse the position along an axis, measured ``age_s`` before the time of the state; refuse one that drifts."""
    if fault == POSITION_DRIFTS:
        f.observations[GNSS_POSITION + axis]["refused"] += 1.0
        return
    accuracy_m = vertical_accuracy(row) if axis == 2 else horizontal_accuracy(row)
    least = params.gnss_position_noise_m
    noise = Noise(least, accuracy_m, max(2.0 * accuracy_m, least), params.gnss_position_gate, WHITE)
    clear(f.h)
    f.h[POSITION + axis] = 1.0
    f.h[GNSS_BIAS + axis] = 1.0
    then_m = f.nominal[7 + axis] - age_s * f.nominal[4 + axis]
    fuse(f, GNSS_POSITION + axis, row[1 + axis] - then_m - f.nominal[25 + axis], noise, 0.0)


@compiled
def _is_aided(f: Filter) -> bool:
    """Return True if GNSS measures the horizontal motion."""
    age_s: float = f.clock[0] - f.observations[GNSS_VELOCITY]["fused_s"]
    return age_s < _AIDED_S


@compiled
def fuse_baro(f: Filter, altitude_m: float, age_s: float, params: EstimatorParams) -> None:
    """Fuse a pressure altitude: minus the position down, plus the barometer's bias.

    It leaves horizontal position and velocity alone in dead reckoning: their errors are then so much larger than that
    of the height that pressure in turns and gusts, which is not white noise, moves them by metres.
    """
    clear(f.h)
    f.h[POSITION + 2] = -1.0
    f.h[BARO_BIAS] = 1.0
    predicted_m = -(f.nominal[9] - age_s * f.nominal[6]) + f.nominal[24]
    noise = Noise(params.baro_noise_m, 1.0, params.baro_largest_noise_m, params.baro_gate, CORRELATED)
    fuse(f, BARO, altitude_m - predicted_m, noise, 0.0 if _is_aided(f) else HOLDS_HORIZONTAL)


@compiled
def cos_tilt_of(f: Filter) -> float:
    """Return the cosine of the angle between the body's down axis and the vertical."""
    x, y = f.nominal[1], f.nominal[2]
    cosine: float = 1.0 - 2.0 * (x * x + y * y)
    return cosine


@compiled
def fuse_range(f: Filter, vertical_m: float, ground_m: float, age_s: float, params: EstimatorParams) -> None:
    """Fuse the vertical part of a distance to level ground at ``ground_m`` below the origin."""
    clear(f.h)
    f.h[POSITION + 2] = -1.0
    height_m = ground_m - (f.nominal[9] - age_s * f.nominal[6])
    noise = Noise(params.range_noise_m, params.range_noise_m, 1.0, params.range_gate, WHITE)
    fuse(f, RANGE, vertical_m - height_m, noise, 0.0)


@compiled
def fuse_field_axis(f: Filter, axis: int, measured: Vector3, params: EstimatorParams) -> None:
    """Fuse the magnetic field along an axis of the body.

    Its errors, of which soft iron makes most, change with the heading: it corrects the yaw, not the tilt. Nor does it
    correct the gyro's biases about x and y, by which the tilt moves, while the velocity tells more of them.
    """
    least, largest = params.mag_noise_gauss, params.mag_largest_noise_gauss
    noise = Noise(least, min(_MAG_START * least, largest), largest, params.mag_gate, SLOW)
    n = read_nominal(f.nominal)
    earth, body = n.earth_field_ned_gauss, n.body_field_frd_gauss
    clear(f.h)
    if axis == 0:
        expected = field_x_jacobian(n.attitude, earth, body, f.h)
        innovation = measured.x - expected
    elif axis == 1:
        expected = field_y_jacobian(n.attitude, earth, body, f.h)
        innovation = measured.y - expected
    else:
        expected = field_z_jacobian(n.attitude, earth, body, f.h)
        innovation = measured.z - expected
    held = HOLDS_TILT_AND_GYRO if _is_aided(f) else HOLDS_TILT
    fuse(f, MAG + axis, innovation, noise, 0.0 if params.mag_corrects_tilt > 0.0 else held)


@compiled
def axis_by_yaw(measured: Vector3, at: int) -> int:
    """Return the axis of a field to fuse as number ``at``: of x and y, the one that tells more of the yaw comes first.

    A turn of a level body by δ changes x by δ y, and y by −δ x. While the yaw is unknown, an update by the other one
    would turn it far beyond where its Jacobian holds, for a field that is only stronger or weaker than expected.
    """
    if at == 2 or abs(measured.y) > abs(measured.x):
        return at
    return 1 - at


@compiled
def fuse_field(f: Filter, measured: Vector3, params: EstimatorParams) -> None:
    """Fuse the magnetic field in the body frame, axis by axis, with an unknown yaw."""
    for at in range(3):
        fuse_field_axis(f, axis_by_yaw(measured, at), measured, params)


@compiled
def fuse_drag(f: Filter, axis: int, force: Vector3, params: EstimatorParams) -> None:
    """Fuse the specific force along the body's x (0) or y (1) axis, which in flight is the drag of the air.

    Drag is −(``momentum_drag_1_s`` + ½ ρ |u| / ballistic coefficient) u for the velocity u relative to the air: that of
    the rotors' momentum and that of the body. Its change with |u| is left out of the Jacobian.
    """
    deviation = math.sqrt(params.drag_variance)
    noise = Noise(deviation, deviation, deviation, _DRAG_GATE, WHITE)
    n = read_nominal(f.nominal)
    v, bias = n.velocity_ned_m_s, n.accel_bias_m_s2
    north, east = n.wind_north_m_s, n.wind_east_m_s
    speed = math.sqrt((v.x - north) * (v.x - north) + (v.y - east) * (v.y - east) + v.z * v.z)
    ballistic = params.ballistic_x_kg_m2 if axis == 0 else params.ballistic_y_kg_m2
    rate = params.momentum_drag_1_s + (0.5 * _AIR_KG_M3 * speed / ballistic if ballistic > 0.0 else 0.0)
    clear(f.h)
    if axis == 0:
        expected = drag_x_jacobian(n.attitude, v, bias, north, east, rate, f.h)
        innovation = force.x - expected
    else:
        expected = drag_y_jacobian(n.attitude, v, bias, north, east, rate, f.h)
        innovation = force.y - expected
    fuse(f, DRAG + axis, innovation, noise, 0.0)


@compiled
def fuse_rest_velocity(f: Filter, axis: int, params: EstimatorParams) -> None:
    """Fuse zero velocity along an axis of a vehicle that stands."""
    velocity = params.rest_velocity_noise_m_s
    noise = Noise(velocity, velocity, velocity, 5.0, WHITE)
    clear(f.h)
    f.h[VELOCITY + axis] = 1.0
    fuse(f, REST_VELOCITY + axis, -f.nominal[4 + axis], noise, 0.0)


@compiled
def fuse_rest_rate(
    f: Filter, axis: int, rate_rad_s: Vector3, variance: float, params: EstimatorParams
) -> None:
    """Fuse zero rate about an axis of a vehicle that stands.

    ``rate_rad_s``, with this variance of noise, is the bias of the gyro, and the motion of a vehicle that sways.
    """
    least = math.sqrt(variance)
    largest = params.rest_rate_noise_rad_s + least
    noise = Noise(least, largest, largest, 3.0, CORRELATED)
    clear(f.h)
    f.h[GYRO_BIAS + axis] = 1.0
    value = rate_rad_s.x if axis == 0 else rate_rad_s.y if axis == 1 else rate_rad_s.z
    fuse(f, REST_RATE + axis, value - f.nominal[10 + axis], noise, 0.0)


@compiled
def fuse_hold(f: Filter, axis: int, held_m: float, params: EstimatorParams) -> None:
    """Fuse a horizontal position that is held without a measurement of it, which bounds velocity and tilt."""
    noise = Noise(params.hold_noise_m, params.hold_noise_m, params.hold_noise_m, 100.0, WHITE)
    clear(f.h)
    f.h[POSITION + axis] = 1.0
    fuse(f, HOLD_POSITION + axis, held_m - f.nominal[7 + axis], noise, 0.0)

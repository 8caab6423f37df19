"""Yaw: the magnetometer with the Earth's field, and GNSS velocity through the bank of yaw models."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import rotate, wrap_pi
from flightstack.core.portable_math import atan2, sin_cos
from flightstack.estimation.alignment import align_yaw, set_field, turn_to_field
from flightstack.estimation.error_state import (
    ATTITUDE,
    EARTH_FIELD,
    read_nominal,
    read_vector,
    turn_between,
    turned,
)
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import axis_by_yaw, fuse_field_axis, speed_accuracy
from flightstack.estimation.imu_input import mean_rate
from flightstack.estimation.kalman import (
    DECLINATION,
    KNOWN_FIELD,
    WHITE,
    Filter,
    Noise,
    clear,
    fuse,
    reset_variance,
)
from flightstack.estimation.memory import (
    NOTHING,
    MemoryRecord,
)
from flightstack.estimation.prediction import DeltaSample, less_bias
from flightstack.estimation.resets import count_yaw_reset, reset_position, reset_velocity
from flightstack.estimation.source_checks import take_field_innovations
from flightstack.estimation.yaw_estimator import (
    attitude_of,
    likeliest,
    mean_turn,
    predict_models,
    start_models,
    tilt_variance,
    update_models,
    variance_of,
)

_LARGEST_TURN_RAD = 0.5
"""Change of the declination beyond which the yaw is aligned again instead of corrected."""
_DECLINATION_NOISE_RAD = 0.01
_COUNTED_TURN_RAD = 0.01
_CONVERGED_RAD = 0.262
"""Deviation of the models' yaw at which it is used: 15 degrees, as in PX4."""
_WRONG_YAW_RAD = 0.436
"""Least difference at which the filter's yaw is wrong: 25 degrees, as in PX4."""
_CERTAIN_SQUARE = 16.0
"""Square of the difference by its variance from which it is certain."""
_REFUSED_S = 1.0
_FIELD_STAGE = 4
"""First of three stages in which the measured field is fused after an alignment."""


@compiled
def take_field(m: MemoryRecord, f: Filter, row: FloatArray, axis: int, params: EstimatorParams) -> int:
    """Fuse an axis of a magnetic field, and return the next one, 0 after the last.

    The first field after the alignment gives the yaw if that is unknown.
    """
    field = read_vector(row, 1)
    if m["flags"]["mag_fault"] == 1:
        return 0
    if axis == 0:
        _start_field(m, f, field, params)
    fuse_field_axis(f, axis, field, params)
    if axis == 2 and m["flags"]["landed"] == 0:
        rate_rad_s = mean_rate(m["sums"]).z - f.nominal[12]
        take_field_innovations(m["checks"], f, rate_rad_s, params.gravity_m_s2)
    return axis + 1 if axis < 2 else 0


@compiled
def _start_field(m: MemoryRecord, f: Filter, field: Vector3, params: EstimatorParams) -> None:
    """Note the field; set the states of the field, and an unknown yaw, by the first one."""
    earth = m["earth"]
    m["field"][0], m["field"][1], m["field"][2] = field.x, field.y, field.z
    if m["flags"]["has_mag"] == 0:
        m["flags"]["has_mag"] = 1
        if m["flags"]["has_yaw"] == 0:
            turn_rad = align_yaw(f, field, read_vector(earth, 0), earth[3], params)
            count_yaw_reset(m, turn_rad)
            m["flags"]["has_yaw"] = 1
        else:
            level = rotate(read_nominal(f.nominal).attitude, field)
            set_field(f, level, read_vector(earth, 0), earth[3], params)


@compiled
def take_earth_field(m: MemoryRecord, f: Filter, stage: int, params: EstimatorParams) -> int:
    """Correct yaw and field with the Earth's field when it has become known; return the next stage.

    On the ground, or if it is far off, the yaw is aligned again, and the measured field is fused. In flight the yaw
    changes as far as it depends on the field: by its declination first, then by its three components.
    """
    flags = m["flags"]
    if stage == 0:
        if flags["field_is_new"] == 0:
            return NOTHING
        if flags["has_mag"] == 0 or flags["mag_fault"] == 1:
            flags["field_is_new"] = 0
            return NOTHING
        return _begin_earth_field(m, f, params)
    if stage >= _FIELD_STAGE:
        field = read_vector(m["field"], 0)
        fuse_field_axis(f, axis_by_yaw(field, stage - _FIELD_STAGE), field, params)
    else:
        _fuse_known_field(m, f, stage - 1, params)
    if stage == _FIELD_STAGE - 1 or stage == _FIELD_STAGE + 2:
        _count_turn(m, f)
        return 0
    return stage + 1


@compiled
def _fuse_known_field(m: MemoryRecord, f: Filter, axis: int, params: EstimatorParams) -> None:
    """Fuse a component of the Earth's field."""
    value = m["earth"][axis]
    noise = params.earth_field_gauss + params.field_scale * abs(value)
    clear(f.h)
    f.h[EARTH_FIELD + axis] = 1.0
    of_model = Noise(noise, noise, noise, 1e3, WHITE)
    fuse(f, KNOWN_FIELD + axis, value - f.nominal[16 + axis], of_model, 0.0)


@compiled
def _begin_earth_field(m: MemoryRecord, f: Filter, params: EstimatorParams) -> int:
    """Align the yaw again, or fuse the declination; return the next stage."""
    known, before = read_vector(m["earth"], 0), read_nominal(f.nominal)
    q, held = before.attitude, before.earth_field_ned_gauss
    pending = m["pending"]
    pending[0], pending[1], pending[2], pending[3] = q.w, q.x, q.y, q.z
    was_rad = atan2(held.y, held.x)
    change_rad = wrap_pi(atan2(known.y, known.x) - was_rad)
    if m["flags"]["landed"] == 1 or abs(change_rad) > _LARGEST_TURN_RAD:
        turn_to_field(f, read_vector(m["field"], 0), known, m["earth"][3], params)
        return _FIELD_STAGE
    _fuse_declination(f, was_rad, change_rad)
    return 1


@compiled
def _count_turn(m: MemoryRecord, f: Filter) -> None:
    """Count the turn since the attitude in ``pending`` as a reset of the yaw; the field is not new any more."""
    m["flags"]["field_is_new"] = 0
    before = m["pending"]
    turn_rad = turn_between(
        Quaternion(before[0], before[1], before[2], before[3]), read_nominal(f.nominal).attitude
    )
    if abs(turn_rad) > _COUNTED_TURN_RAD:
        count_yaw_reset(m, turn_rad)


@compiled
def _fuse_declination(f: Filter, was_rad: float, change_rad: float) -> None:
    """Turn the Earth's field by a change of the declination; the yaw follows as far as it depends on it."""
    north, east = f.nominal[16], f.nominal[17]
    square = north * north + east * east
    clear(f.h)
    f.h[EARTH_FIELD] = -east / square
    f.h[EARTH_FIELD + 1] = north / square
    noise = Noise(_DECLINATION_NOISE_RAD, _DECLINATION_NOISE_RAD, _DECLINATION_NOISE_RAD, 1e3, WHITE)
    fuse(f, DECLINATION, change_rad, noise, 0.0)
    sine, cosine = sin_cos(was_rad + change_rad)
    along = north * cosine + east * sine
    across = f.nominal[17] * cosine - f.nominal[16] * sine
    # the linear update would lengthen the field
    f.nominal[16] = along * cosine - across * sine
    f.nominal[17] = along * sine + across * cosine


@compiled
def predict_yaw(m: MemoryRecord, f: Filter, step: DeltaSample) -> None:
    """Move the models over a step of the flight."""
    if m["yaw_fix"]["updates"] > 0.0:
        angle = less_bias(step.angle_rad, read_vector(f.nominal, 10), step.dt_s)
        velocity = less_bias(step.velocity_m_s, read_vector(f.nominal, 13), step.dt_s)
        predict_models(m["yaw_bank"], angle, velocity, step.dt_s)


@compiled
def take_velocity(m: MemoryRecord, f: Filter, row: FloatArray) -> None:
    """Weigh the models with a GNSS velocity; reset the yaw if it is unknown, or wrong."""
    bank, fix, flags = m["yaw_bank"], m["yaw_fix"], m["flags"]
    if flags["landed"] == 1 or flags["has_gnss"] == 0:
        fix["updates"] = 0.0
        return
    attitude, noise_m_s = read_nominal(f.nominal).attitude, max(speed_accuracy(row), 0.1)
    if fix["updates"] == 0.0:
        start_models(bank, attitude, row[4], row[5], noise_m_s * noise_m_s)
    else:
        update_models(bank, row[4], row[5], noise_m_s * noise_m_s)
    fix["updates"] += 1.0
    fix["turn_rad"] = mean_turn(bank, attitude)
    fix["variance"] = variance_of(bank, attitude, fix["turn_rad"])
    if fix["variance"] > _CONVERGED_RAD * _CONVERGED_RAD:
        return
    if flags["has_yaw"] == 0:
        _reset_to_models(m, f, row)
    elif _is_wrong(m, row[0]):
        flags["mag_fault"] = flags["has_mag"]
        _reset_to_models(m, f, row)


@compiled
def _is_wrong(m: MemoryRecord, time_s: float) -> bool:
    """Return True if the models have contradicted the yaw for a second, or do while GNSS velocities are refused."""
    fix, refused = m["yaw_fix"], m["refused_s"]
    differs = abs(fix["turn_rad"]) > _WRONG_YAW_RAD
    if not (differs and fix["turn_rad"] * fix["turn_rad"] > _CERTAIN_SQUARE * fix["variance"]):
        fix["wrong_s"] = 0.0
    elif fix["wrong_s"] == 0.0:
        fix["wrong_s"] = time_s
    lasts: bool = fix["wrong_s"] > 0.0 and time_s - fix["wrong_s"] > _REFUSED_S
    is_refused: bool = max(refused[0], refused[1]) > _REFUSED_S
    return lasts or (differs and is_refused)


@compiled
def _reset_to_models(m: MemoryRecord, f: Filter, row: FloatArray) -> None:
    """Take tilt and yaw from the models, velocity and position from GNSS."""
    m["yaw_fix"]["wrong_s"] = 0.0
    bank, before = m["yaw_bank"], read_nominal(f.nominal).attitude
    best = bank["models"][likeliest(bank)]
    q = attitude_of(best)
    q = turned(q, Vector3(0.0, 0.0, m["yaw_fix"]["turn_rad"] - turn_between(before, q)))
    f.nominal[0], f.nominal[1], f.nominal[2], f.nominal[3] = q.w, q.x, q.y, q.z
    for axis in range(2):
        reset_variance(f.covariance, ATTITUDE + axis, 1, tilt_variance(best, axis))
    reset_variance(f.covariance, ATTITUDE + 2, 1, m["yaw_fix"]["variance"])
    count_yaw_reset(m, turn_between(before, q))
    m["flags"]["has_yaw"] = 1
    reset_velocity(m, f, row, 0, 2)
    reset_position(m, f, row, 0, 2)

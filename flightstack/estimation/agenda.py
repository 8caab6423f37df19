"""The filter's work in parts: a prediction, then one scalar measurement at a time, so that no sample waits for all.

A step of the filter stays open while its measurements are fused. The state does not move meanwhile, so the result is
that of fusing them at once.
"""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import read_nominal, read_vector, scaled
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import fuse_drag, fuse_rest_rate, fuse_rest_velocity
from flightstack.estimation.height_sources import take_baro, take_range
from flightstack.estimation.imu_input import mean_force, mean_rate, noise_of, read_step
from flightstack.estimation.kalman import Filter
from flightstack.estimation.memory import (
    NOTHING,
    MemoryRecord,
)
from flightstack.estimation.output_predictor import follow
from flightstack.estimation.position_sources import (
    YAW_STAGE,
    hold_position,
    is_platform_at_rest,
    is_velocity_measured,
    take_gnss,
)
from flightstack.estimation.prediction import add_unknown, motion_of, predict, predict_errors
from flightstack.estimation.resets import count_of_resets
from flightstack.estimation.rings import (
    BARO_RING,
    BARO_ROWS,
    GNSS_RING,
    GNSS_ROWS,
    IMU_RING,
    IMU_ROWS,
    MAG_RING,
    MAG_ROWS,
    RANGE_RING,
    RANGE_ROWS,
    Rings,
    count_of,
    is_due,
    oldest_slot,
    pop,
    read_row,
)
from flightstack.estimation.source_checks import add_fault_noise, take_rest_innovation
from flightstack.estimation.yaw_sources import predict_yaw, take_earth_field, take_field, take_velocity

(
    IDLE,
    EARTH_SOURCE,
    REST_SOURCE,
    HOLD_SOURCE,
    MAG_SOURCE,
    BARO_SOURCE,
    RANGE_SOURCE,
    GNSS_SOURCE,
    DRAG_SOURCE,
) = (
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    8,
)
SOURCES = 9
"""What the agenda is at; the sources of measurements in the order in which they are fused."""
MOST_PARTS = 256
"""Bound of the parts of work in one call: more than a step has."""
_FIELD_STAGES = 8
_LATE_S = 0.3
"""Measurements that are older than the horizon by this much are dropped."""
_GAP_S, _GAP_LATE_S = 0.2, 0.02
"""Step that bridges a gap, and what counts as late in it: the motion within the gap is unknown, so that measurements
taken then say little about its end."""
_BEHIND_S = 0.035
"""Time by which the covariance may be behind the state, plus a step: measurements come more often."""
_REST_PERIOD_S, _REST_MEAN_S, _DRAG_PERIOD_S = 0.1, 0.1, 0.05
_STILL_RATE_RAD_S, _STILL_FORCE_M_S2 = 0.08, 1.0


@compiled
def work(m: MemoryRecord, f: Filter, r: Rings, horizon_s: float, params: EstimatorParams) -> bool:
    """Do the next part of the work; return False if no step older than the horizon is open or waits.

    A part is one scalar, with the prediction if that is due, or the end of a step.
    """
    agenda = m["agenda"]
    if agenda["source"] == IDLE:  # noqa: SIM102  # a call that writes stands alone in C
        if not _begin(m, f, r, horizon_s, params):
            return False
    for _ in range(SOURCES):
        if agenda["source"] >= SOURCES:
            break
        following = fuse_next(m, f, r, params)
        if following != NOTHING:
            agenda["axis"], agenda["has_fused"] = following, 1
            if count_of_resets(m) != m["followed"]:  # users of the output follow the count at once
                _move_output(m, f, r, 1.0, params)
            return True
        agenda["source"] += 1
    _finish(m, f, r, params)
    return True


@compiled
def take_field_at_rest(m: MemoryRecord, f: Filter, r: Rings, params: EstimatorParams) -> None:
    """Correct the filter with the Earth's field now, after the open step: a vehicle that is ready may arm next."""
    for _ in range(MOST_PARTS):
        if m["agenda"]["source"] == IDLE:
            break
        work(m, f, r, f.clock[0], params)
    predict_errors(f, noise_of(m["sums"]), params)
    stage = 0
    for _ in range(_FIELD_STAGES):
        stage = take_earth_field(m, f, stage, params)
        if stage <= 0:
            break


@compiled
def _begin(m: MemoryRecord, f: Filter, r: Rings, horizon_s: float, params: EstimatorParams) -> bool:
    """Predict a step that is not later than the horizon; return False if there is none."""
    agenda = m["agenda"]
    if count_of(r, IMU_RING) == 0:
        return False
    slot = oldest_slot(r, IMU_RING)
    if r.imu[slot]["time_s"] > horizon_s:
        return False
    step = read_step(r.imu[slot])
    predict_yaw(m, f, step)
    predict(f, step, params)
    if _is_covariance_due(m, f, r, params):
        predict_errors(f, noise_of(m["sums"]), params)
    add_unknown(f, step)
    add_fault_noise(m["checks"], f, step.dt_s)
    agenda["source"], agenda["axis"], agenda["has_fused"] = EARTH_SOURCE, 0, 0
    return True


@compiled
def _is_covariance_due(m: MemoryRecord, f: Filter, r: Rings, params: EstimatorParams) -> bool:
    """Return True if a measurement may be fused in the step at hand, or the covariance is behind by the most."""
    now_s = f.clock[0]
    rests = m["flags"]["landed"] == 1 and now_s - m["rest_s"] >= _REST_PERIOD_S
    is_asked = rests or m["flags"]["field_is_new"] == 1
    if f.behind[0] > _BEHIND_S or is_asked or params.drag_is_fused > 0.0 or not is_velocity_measured(f):
        return True
    return (
        is_due(r, MAG_RING, r.mag[oldest_slot(r, MAG_RING)], now_s)
        or is_due(r, BARO_RING, r.baro[oldest_slot(r, BARO_RING)], now_s)
        or is_due(r, RANGE_RING, r.range[oldest_slot(r, RANGE_RING)], now_s)
        or is_due(r, GNSS_RING, r.gnss[oldest_slot(r, GNSS_RING)], now_s)
    )


@compiled
def _finish(m: MemoryRecord, f: Filter, r: Rings, params: EstimatorParams) -> None:
    """Move the output as the filter has moved, and close the step."""
    agenda, dt_s = m["agenda"], r.imu[oldest_slot(r, IMU_RING)]["dt_s"]
    is_reset = count_of_resets(m) != m["followed"]  # between two steps, by the Earth's field
    share = 1.0 if is_reset or params.output_s <= dt_s else dt_s / params.output_s
    if is_reset or agenda["has_fused"] == 1 or share < 1.0:  # else the output has moved as the filter has
        _move_output(m, f, r, share, params)
    pop(r, IMU_RING, IMU_ROWS)
    agenda["source"] = IDLE


@compiled
def _move_output(m: MemoryRecord, f: Filter, r: Rings, share: float, params: EstimatorParams) -> None:
    """Move the output by a share of its difference to the filter."""
    m["followed"] = count_of_resets(m)
    follow(r, m["output"], motion_of(read_nominal(f.nominal)), share, params.gravity_m_s2)


@compiled
def fuse_next(m: MemoryRecord, f: Filter, r: Rings, params: EstimatorParams) -> int:
    """Fuse the next scalar of the source at hand."""
    source, axis = m["agenda"]["source"], m["agenda"]["axis"]
    if source == EARTH_SOURCE:
        return take_earth_field(m, f, axis, params)
    if source == REST_SOURCE:
        return _rest(m, f, r, axis, params)
    if source == HOLD_SOURCE:
        if axis == 0 and _stands(m, params):
            return NOTHING
        return hold_position(m, f, axis, params)
    if source == DRAG_SOURCE:
        return _drag(m, f, r, axis, params)
    return _measured(m, f, r, source, axis, params)


@compiled
def _measured(m: MemoryRecord, f: Filter, r: Rings, source: int, axis: int, params: EstimatorParams) -> int:
    """Fuse the next scalar of a sensor whose rows wait."""
    row = m["pending"]
    if axis == 0:  # noqa: SIM102
        if not _take_row(m, f, r, source):
            return NOTHING
    following: int = 0
    if source == MAG_SOURCE:
        following = take_field(m, f, row, axis, params)
    elif source == BARO_SOURCE:
        take_baro(m, f, row, params)
    elif source == RANGE_SOURCE:
        take_range(m, f, row, params)
    elif axis == YAW_STAGE:
        take_velocity(m, f, row)
    else:
        following = take_gnss(m, f, row, axis, params)
    return following


@compiled
def _take_row(m: MemoryRecord, f: Filter, r: Rings, source: int) -> bool:
    """Move the oldest row of a source that is due to ``pending``; drop those that are too late."""
    now_s, row = f.clock[0], m["pending"]
    late_s = _LATE_S if r.imu[oldest_slot(r, IMU_RING)]["dt_s"] < _GAP_S else _GAP_LATE_S
    for _ in range(MAG_ROWS):
        if source == MAG_SOURCE:
            found = _next_row(r, MAG_RING, MAG_ROWS, r.mag[oldest_slot(r, MAG_RING)], now_s, row)
        elif source == BARO_SOURCE:
            found = _next_row(r, BARO_RING, BARO_ROWS, r.baro[oldest_slot(r, BARO_RING)], now_s, row)
        elif source == RANGE_SOURCE:
            found = _next_row(r, RANGE_RING, RANGE_ROWS, r.range[oldest_slot(r, RANGE_RING)], now_s, row)
        else:
            found = _next_row(r, GNSS_RING, GNSS_ROWS, r.gnss[oldest_slot(r, GNSS_RING)], now_s, row)
        if not found:
            return False
        if row[0] > now_s - late_s:
            return True
    return False


@compiled
def _next_row(r: Rings, ring: int, size: int, oldest: FloatArray, now_s: float, row: FloatArray) -> bool:
    """Move the oldest row of a ring to ``row``; return False if none is due."""
    if not is_due(r, ring, oldest, now_s):
        return False
    read_row(oldest, row)
    pop(r, ring, size)
    return True


@compiled
def _stands(m: MemoryRecord, params: EstimatorParams) -> bool:
    """Return True if the vehicle is on the ground and nothing moves it."""
    if m["flags"]["landed"] == 0:
        return False
    rate, force = mean_rate(m["sums"]), mean_force(m["sums"])
    bias = read_vector(m["nominal"], 10)
    off = math.sqrt(force.x * force.x + force.y * force.y + force.z * force.z) - params.gravity_m_s2
    largest = max(abs(rate.x - bias.x), abs(rate.y - bias.y), abs(rate.z - bias.z))
    return abs(off) < _STILL_FORCE_M_S2 and largest < _STILL_RATE_RAD_S


@compiled
def _rest(m: MemoryRecord, f: Filter, r: Rings, stage: int, params: EstimatorParams) -> int:
    """Fuse rest ten times a second: three axes of the velocity, three of the rate."""
    axis: int = stage
    if stage == 0:
        if f.clock[0] - m["rest_s"] < _REST_PERIOD_S or not _stands(m, params):
            return NOTHING
        m["rest_s"] = f.clock[0]
        if not is_platform_at_rest(m, f):
            axis = 3
    if axis < 3:
        fuse_rest_velocity(f, axis, params)
    else:
        _rest_rate(m, f, axis - 3, params)
    return axis + 1 if axis < 5 else 0


@compiled
def _rest_rate(m: MemoryRecord, f: Filter, axis: int, params: EstimatorParams) -> None:
    """Fuse the rate at rest; a platform that moves turns too, so slowly that it looks like a bias."""
    noise = noise_of(m["sums"]).gyro
    density = noise.x if axis == 0 else noise.y if axis == 1 else noise.z
    sways = 0.0 if is_platform_at_rest(m, f) else params.rest_rate_noise_rad_s
    fuse_rest_rate(f, axis, mean_rate(m["sums"]), density / _REST_MEAN_S + sways * sways, params)
    take_rest_innovation(m["checks"], f, axis)


@compiled
def _drag(m: MemoryRecord, f: Filter, r: Rings, axis: int, params: EstimatorParams) -> int:
    """Fuse drag in flight while the velocity over ground is measured, twenty times a second."""
    if axis == 0:
        waits = f.clock[0] - m["drag_s"] < _DRAG_PERIOD_S
        if params.drag_is_fused == 0.0 or m["flags"]["landed"] == 1 or waits or not is_velocity_measured(f):
            return NOTHING
        m["drag_s"] = f.clock[0]
    step = read_step(r.imu[oldest_slot(r, IMU_RING)])
    fuse_drag(f, axis, scaled(step.velocity_m_s, 1.0 / step.dt_s), params)
    return 1 - axis

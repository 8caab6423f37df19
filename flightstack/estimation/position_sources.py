"""Horizontal position and velocity: GNSS from its first fix to resets, and the position held without it."""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import GNSS_BIAS, POSITION, VELOCITY
from flightstack.estimation.estimator_params import EstimatorParams
from flightstack.estimation.fusion import (
    drift_gnss_bias,
    fuse_gnss_position,
    fuse_gnss_velocity,
    fuse_hold,
    gnss_bias_share,
    horizontal_accuracy,
    speed_accuracy,
    vertical_accuracy,
)
from flightstack.estimation.height_sources import reset_height
from flightstack.estimation.kalman import (
    GNSS_POSITION,
    GNSS_VELOCITY,
    Filter,
    deviation,
    reset_variance,
)
from flightstack.estimation.memory import NOTHING, MemoryRecord
from flightstack.estimation.resets import count_correction, reset_position, reset_velocity
from flightstack.estimation.source_checks import (
    follow_drift,
    follow_height_drift,
    position_drifts,
    take_gnss_innovations,
    take_horizontal_innovations,
)

_GNSS_LOST_S = 1.0
_HOLD_PERIOD_S = 0.2
_COUNTED_M = 0.5
"""Correction by the first measurement after an outage that counts as a reset."""
_LONGEST_INTERVAL_S = 2.5
"""Most time that one refused measurement counts."""
_SPEED_SMOOTHING_S = 2.0
_MOVES_M_S = 0.15
YAW_STAGE = 6
"""Stage of a measurement after its velocities (0 to 2) and positions (3 to 5)."""


@compiled
def take_gnss(m: MemoryRecord, f: Filter, row: FloatArray, stage: int, params: EstimatorParams) -> int:
    """Fuse a scalar of a GNSS measurement: three velocities, three positions; return the next stage.

    Without a known yaw only the vertical parts count. The last one resets what was refused too long.
    """
    first = 0 if m["flags"]["has_yaw"] == 1 else 2
    at: int = stage
    if stage == 0:
        _begin_gnss(m, f, row, params)
        at = first
    axis: int = at if at < 3 else at - 3
    fault = m["checks"]["fault"][axis]
    if at < 3:
        fuse_gnss_velocity(f, row, axis, fault, params)
    else:
        fuse_gnss_position(f, row, f.clock[0] - row[0], axis, fault, params)
    if at == YAW_STAGE - 1:
        _end_gnss(m, f, row, first, params)
    return at + 1 if at != 2 else 3 + first


@compiled
def _begin_gnss(m: MemoryRecord, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    """Propagate what belongs to GNSS to the time of the measurement, and note the state before it."""
    if m["flags"]["has_gnss"] == 0:
        _start_gnss(m, f, row, params)
    before = m["before_gnss"]
    before["elapsed_s"] = max(0.0, row[0] - m["last_gnss_s"])
    before["outage_s"] = f.clock[0] - f.observations[GNSS_POSITION]["fused_s"]
    for axis in range(2):
        before["place_m"][axis], before["velocity_m_s"][axis] = f.nominal[7 + axis], f.nominal[4 + axis]
    m["last_gnss_s"] = row[0]
    follow_height_drift(m["checks"], row, m["flags"]["landed"] == 0, speed_accuracy(row))
    follow_drift(m["checks"], f, row, horizontal_accuracy(row))
    drift_gnss_bias(f, row, before["elapsed_s"], params)


@compiled
def _end_gnss(m: MemoryRecord, f: Filter, row: FloatArray, first: int, params: EstimatorParams) -> None:
    """Check the measurement by its innovations, and reset what was refused too long."""
    before, c = m["before_gnss"], m["checks"]
    elapsed_s = before["elapsed_s"]
    if m["flags"]["landed"] == 0:
        take_gnss_innovations(c, f, elapsed_s, m["flags"]["has_baro"] == 1)
        if first == 0:
            take_horizontal_innovations(c, f, elapsed_s, params.gravity_m_s2)
    dx, dy = f.nominal[7] - before["place_m"][0], f.nominal[8] - before["place_m"][1]
    if before["outage_s"] > _GNSS_LOST_S and dx * dx + dy * dy > _COUNTED_M * _COUNTED_M:
        v = before["velocity_m_s"]
        count_correction(m, f, dx, dy, f.nominal[4] - v[0], f.nominal[5] - v[1])
    _count_refused(m, f, first, min(elapsed_s, _LONGEST_INTERVAL_S))
    share = min(elapsed_s / _SPEED_SMOOTHING_S, 1.0)
    for axis in range(2):
        m["gnss_speed_m_s"][axis] += share * (row[4 + axis] - m["gnss_speed_m_s"][axis])
    refused, limit_s = m["refused_s"], params.reset_s
    velocity_s, position_s = max(refused[0], refused[1]), max(refused[3], refused[4])
    if velocity_s > limit_s:
        reset_velocity(m, f, row, 0, 2)
    if velocity_s > limit_s or (position_s > limit_s and not position_drifts(c)):
        reset_position(m, f, row, 0, 2)
    if refused[2] > limit_s:
        reset_velocity(m, f, row, 2, 1)
    if refused[5] > limit_s:
        reset_height(m, f, row)


@compiled
def _count_refused(m: MemoryRecord, f: Filter, first: int, elapsed_s: float) -> None:
    """Add up the time between refused measurements; an accepted one ends it. Time without any does not count."""
    refused = m["refused_s"]
    for i in range(6):
        axis = i - 3 if i >= 3 else i
        if axis < first or f.observations[GNSS_VELOCITY + i]["fused_s"] == f.clock[0]:
            refused[i] = 0.0
        elif refused[i] == 0.0:
            refused[i] = 1e-6  # the series begins
        else:
            refused[i] += elapsed_s


@compiled
def _start_gnss(m: MemoryRecord, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    """Account for the errors of the first GNSS position, which becomes the origin, in the covariance.

    The slow part of that error is the bias of the next ones too: position and bias have opposite errors.
    """
    p = f.covariance
    for axis in range(3):
        accuracy_m = vertical_accuracy(row) if axis == 2 else horizontal_accuracy(row)
        variance = accuracy_m * accuracy_m
        at = POSITION + axis
        share = gnss_bias_share(params, axis)
        slow = min(share * share, 1.0) * variance
        if (
            axis == 2
        ):  # the height is that above the ground, the altitude of the origin has the error of the fix
            reset_variance(p, GNSS_BIAS + axis, 1, variance - slow)
        else:
            p[at, at] += variance
            reset_variance(p, GNSS_BIAS + axis, 1, slow)
            p[at, GNSS_BIAS + axis] = -slow
    m["last_gnss_s"] = row[0]
    m["flags"]["has_gnss"] = 1
    if m["flags"]["landed"] == 1:
        _start_platform(m, f, row)


@compiled
def _start_platform(m: MemoryRecord, f: Filter, row: FloatArray) -> None:
    """Take the first velocity of GNSS as that of what the vehicle stands on: until then it counted as still."""
    for axis in range(2):
        m["gnss_speed_m_s"][axis] = row[4 + axis]
    if not is_platform_at_rest(m, f):
        for axis in range(2):
            reset_variance(f.covariance, VELOCITY + axis, 1, row[4 + axis] * row[4 + axis])


@compiled
def is_velocity_measured(f: Filter) -> bool:
    """Return True if a GNSS velocity was accepted within the last second."""
    fused_s: float = f.observations[GNSS_VELOCITY]["fused_s"]
    return fused_s > 0.0 and f.clock[0] - fused_s < _GNSS_LOST_S


@compiled
def is_platform_at_rest(m: MemoryRecord, f: Filter) -> bool:
    """Return False if GNSS measures that what the vehicle stands on moves, as a boat does."""
    north, east = m["gnss_speed_m_s"][0], m["gnss_speed_m_s"][1]
    is_measured = m["flags"]["has_gnss"] == 1 and f.clock[0] - m["last_gnss_s"] < _GNSS_LOST_S
    return not is_measured or math.sqrt(north * north + east * east) < _MOVES_M_S


@compiled
def hold_position(m: MemoryRecord, f: Filter, axis: int, params: EstimatorParams) -> int:
    """Hold the horizontal position while the velocity is not measured, north before east; return the next axis."""
    hold, now_s = m["hold"], f.clock[0]
    if axis == 0:
        is_used = m["flags"]["has_gnss"] == 1 and m["flags"]["has_yaw"] == 1
        if is_velocity_measured(f) or (is_used and deviation(f, VELOCITY, 2) < params.hold_velocity_m_s):
            hold["fused_s"] = 0.0
            return NOTHING
        if hold["fused_s"] == 0.0:
            hold["place_m"][0], hold["place_m"][1] = f.nominal[7], f.nominal[8]
        if now_s - hold["fused_s"] < _HOLD_PERIOD_S:
            return NOTHING
        hold["fused_s"] = now_s
    fuse_hold(f, axis, hold["place_m"][axis], params)
    return 1 - axis

"""What notices that a flight goes wrong: limits of attitude and position, rotors, the battery, frozen states. Pure.

Each detector has a time for which its limit must be passed before it triggers, and needs ``RELEASE_S`` of good
behaviour to let go, so that a value at the limit does not chatter.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.arrays import vehicle_state
from flightstack.core.compiled import compiled
from flightstack.core.contract import MAX_ROTORS, FloatArray, LoopRow, LoopStatus
from flightstack.core.portable_math import acos, asin, atan2, exp
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle

RELEASE_S = 1.0
NOT_FINITE, BEYOND_ATTITUDE, BEYOND_POSITION, ROTOR_FAULT, MOVING, UNMEASURED = 1, 2, 4, 8, 16, 32
"""Bits of what ``detect`` returns."""
MOVING_ABOVE = 1e-9
"""Speed [m/s] or rate [rad/s] that must change the state in twentieths of a second: its last digit is smaller yet."""
BATTERY_HYSTERESIS = 0.02
TILT_MARGIN_DEG = 15
ROTOR_MEAN_S = 0.03
"""Rotors are compared by means over about this time: loops that shake them are no fault of theirs."""
FASTEST_RAD_S = 1e6
"""A rotor speed beyond this is no measurement; ideal rotors without limits stay below it."""
UNMEASURED_AFTER_S = 0.5
"""A rotor without a measurement for this time is reported as not measured."""

ROLL, PITCH, TILT_ERROR, POSITION, ROTORS = range(5)
TIMERS = 5
M_TRIGGERED = TIMERS
DETECTOR_MEMORY_SIZE = 2 * TIMERS
P_LIMIT, P_TIME, P_ROTORS, P_SLOW = 0, TIMERS, 2 * TIMERS, 2 * TIMERS + 1
R_EXPECTED, R_MEAN, R_ERROR, R_MISSING_S, R_MEASURED = (block * MAX_ROTORS for block in range(5))
ROTOR_MEMORY_SIZE = R_MEASURED + 1

_REFERENCE_AT = LoopRow.REFERENCE_ATTITUDE.start
_COMMAND_AT = LoopRow.ROTOR_COMMAND.start
_SPEED_AT = LoopRow.ROTOR_SPEED.start
_STATUS_AT = LoopRow.STATUS
_BAD_OUTPUT = LoopStatus.OUTPUT_NOT_FINITE


def detector_params(behaviour: Behaviour, vehicle: Vehicle) -> FloatArray:
    """Return the numbers that ``detect`` takes, shape (12,); a limit of 0 is off.

    Limits and times are in the order roll, pitch, tilt error [rad], position error [m], rotor speed [share]. Then
    come the number of rotors, and the speed below which errors count as shares of that speed.
    """
    b = behaviour
    least_deg = b.max_tilt_deg + TILT_MARGIN_DEG
    limits = (
        math.radians(max(b.max_roll_deg, least_deg)) if b.max_roll_deg > 0 else 0.0,
        math.radians(max(b.max_pitch_deg, least_deg)) if b.max_pitch_deg > 0 else 0.0,
        math.radians(b.max_tilt_error_deg),
        b.max_position_error_m,
        b.rotor_error if b.rotor_check else 0.0,
    )
    times = (b.max_roll_s, b.max_pitch_s, b.max_tilt_error_s, b.max_position_error_s, b.rotor_error_ms * 1e-3)
    slow_rad_s = 0.1 * min(1e4, *(rotor.max_speed_rad_s for rotor in vehicle.rotors))
    return np.array([*limits, *times, len(vehicle.rotors), slow_rad_s], dtype=np.float64)


def rotor_params(vehicle: Vehicle, dt_s: float) -> FloatArray:
    """Return the numbers that ``follow_rotors`` takes: for each rotor the share of its lag that passes in ``dt_s``,
    then that of the mean's time, and ``dt_s``.
    """
    shares = [1.0 - exp(-dt_s / r.lag_s) if r.lag_s > 0.0 else 1.0 for r in vehicle.rotors]
    return np.array([*shares, 1.0 - exp(-dt_s / ROTOR_MEAN_S), dt_s], dtype=np.float64)


@compiled
def follow_rotors(row: FloatArray, memory: FloatArray, params: FloatArray) -> None:
    """Compare each rotor's measured speed with what its commands lead to; once per inner tick.

    ``row`` (48,) holds speeds from before its commands. ``memory`` (33,) keeps, for each rotor, the speed that the
    commands lead to (first-order lag, exact for commands that are held), its mean, the mean of the error, and the time
    without a measurement. A command that is not finite, or beyond ``FASTEST_RAD_S``, is left out. Such a speed is a
    missing measurement: the mean of the error decays meanwhile, so that no old error outlasts the measurements.
    """
    count = len(params) - 2
    share, dt_s = params[count], params[count + 1]
    for i in range(count):
        expected = memory[R_EXPECTED + i]
        memory[R_MEAN + i] += (expected - memory[R_MEAN + i]) * share
        speed, command = row[_SPEED_AT + i], row[_COMMAND_AT + i]
        is_measured = abs(speed) <= FASTEST_RAD_S  # NaN is not
        error = speed - expected if is_measured else 0.0
        memory[R_ERROR + i] += (error - memory[R_ERROR + i]) * share
        memory[R_MISSING_S + i] = 0.0 if is_measured else memory[R_MISSING_S + i] + dt_s
        if abs(command) <= FASTEST_RAD_S:
            memory[R_EXPECTED + i] = expected + (command - expected) * params[i]


@compiled
def _watch(memory: FloatArray, index: int, beyond: bool, time_s: float, dt_s: float) -> None:
    """Advance one timer.

    The timer counts how long the value has been on the other side than the detector's answer.
    """
    triggered = memory[M_TRIGGERED + index] > 0.0
    if beyond == triggered:
        memory[index] = 0.0
        return
    memory[index] += dt_s
    if memory[index] >= (RELEASE_S if triggered else time_s) - 1e-9:
        memory[index] = 0.0
        memory[M_TRIGGERED + index] = 0.0 if triggered else 1.0


@compiled
def _found(memory: FloatArray) -> int:
    """Return the bits of the detectors that are triggered."""
    bits = (BEYOND_ATTITUDE, BEYOND_ATTITUDE, BEYOND_ATTITUDE, BEYOND_POSITION, ROTOR_FAULT)
    result = 0
    for index in range(TIMERS):
        if memory[M_TRIGGERED + index] > 0.0:
            result |= bits[index]
    return result


@compiled
def _rotor_error(row: FloatArray, rotors: FloatArray, params: FloatArray) -> float:
    """Return the largest mean error of a rotor's speed as share of the mean speed that was expected.

    A simulator that measures no speeds sends zeros: while none other has come in this flight nothing is known, and
    the error is 0. After that, zeros are rotors that stand: an empty battery stops them all.
    """
    worst = 0.0
    for i in range(int(params[P_ROTORS])):
        if 0.0 < abs(row[_SPEED_AT + i]) <= FASTEST_RAD_S:
            rotors[R_MEASURED] = 1.0
        worst = max(worst, abs(rotors[R_ERROR + i]) / max(abs(rotors[R_MEAN + i]), params[P_SLOW]))
    return worst if rotors[R_MEASURED] > 0.0 else 0.0


@compiled
def detect(
    state: FloatArray,
    setpoint: FloatArray,
    row: FloatArray,
    rotors: FloatArray,
    memory: FloatArray,
    params: FloatArray,
    on_ground: bool,
    dt_s: float,
) -> int:
    """Advance all detectors by one outer tick; return the bits of what is wrong, ``MOVING`` and ``UNMEASURED``.

    ``state`` (13,), ``setpoint`` (11,) and ``row`` (48,), the newest row of the inner loop, as in ``contract``;
    ``rotors`` (33,) is the memory of ``follow_rotors``; ``memory`` (10,) is updated; ``params`` come from
    ``detector_params``. A state that is not finite leaves the other detectors, and what they found, as they are.
    ``on_ground``: the feet hold the vehicle, and its attitude need not follow the reference; it must still be upright.
    """
    status = int(row[_STATUS_AT])
    for value in state:
        if not math.isfinite(value):
            return NOT_FINITE | _found(memory)
    result = NOT_FINITE if status & _BAD_OUTPUT != 0 else 0
    now = vehicle_state(state)
    v, w = now.velocity_ned_m_s, now.rates_frd_rad_s
    if max(abs(v.x), abs(v.y), abs(v.z), abs(w.x), abs(w.y), abs(w.z)) > MOVING_ABOVE:
        result |= MOVING
    for i in range(int(params[P_ROTORS])):
        if params[P_LIMIT + ROTORS] > 0.0 and rotors[R_MISSING_S + i] >= UNMEASURED_AFTER_S:
            result |= UNMEASURED
    qw, qx, qy, qz = now.attitude
    roll = atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy))
    pitch = asin(min(1.0, max(-1.0, 2.0 * (qw * qy - qz * qx))))
    # cosine between the thrust axes: third columns of the two rotation matrices
    rw, rx, ry, rz = (
        row[_REFERENCE_AT],
        row[_REFERENCE_AT + 1],
        row[_REFERENCE_AT + 2],
        row[_REFERENCE_AT + 3],
    )
    cosine = (
        4.0 * (qx * qz + qw * qy) * (rx * rz + rw * ry)
        + 4.0 * (qy * qz - qw * qx) * (ry * rz - rw * rx)
        + (1.0 - 2.0 * (qx * qx + qy * qy)) * (1.0 - 2.0 * (rx * rx + ry * ry))
    )
    tilt_error = 0.0 if on_ground else acos(min(1.0, max(-1.0, cosine)))
    p = now.position_ned_m
    dx, dy, dz = p.x - setpoint[0], p.y - setpoint[1], p.z - setpoint[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    errors = (abs(roll), abs(pitch), tilt_error, distance, _rotor_error(row, rotors, params))
    for index in range(TIMERS):
        limit = params[P_LIMIT + index]
        beyond = limit > 0.0 and not errors[index] <= limit
        _watch(memory, index, beyond, params[P_TIME + index], dt_s)
    return result | _found(memory)


def battery_level(before: int, remaining: float, thresholds: tuple[float, float, float]) -> int:
    """Return how low the battery is: 0 enough or never known, 1 low, 2 critical, 3 emergency.

    ``thresholds`` are the shares of charge for low, critical and emergency. A level once reached is left
    only when the charge lies ``BATTERY_HYSTERESIS`` above its threshold; an unknown charge (NaN) keeps it.
    """
    if math.isnan(remaining):
        return before
    reached = sum(remaining <= threshold for threshold in thresholds)
    kept = sum(remaining <= threshold + BATTERY_HYSTERESIS for threshold in thresholds)
    return max(reached, min(before, kept))

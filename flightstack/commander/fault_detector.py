"""Failure detectors: limits of attitude and position, rotors, the battery. Pure.

A detector triggers after its limit is exceeded for its trigger time, and releases after the value is within the limit
for ``RELEASE_S``, so that a value at the limit does not chatter.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.commander.failsafe import Failsafe
from flightstack.core.arrays import vehicle_state
from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import (
    MAX_ROTORS,
    SETPOINT_SIZE,
    FloatArray,
    LoopRow,
    LoopStatus,
    Quaternion,
    Record,
    RecordArray,
    Vector3,
)
from flightstack.core.portable_math import acos, exp, pitch_angle, roll_angle
from flightstack.params.behaviour import Behaviour
from flightstack.params.vehicle import Vehicle

RELEASE_S = 1.0
NOT_FINITE, BEYOND_ATTITUDE, BEYOND_POSITION, ROTOR_FAULT, MOVING, UNMEASURED = 1, 2, 4, 8, 16, 32
"""Bits of the value of ``detect``."""
MOVING_ABOVE = 1e-9
"""Speed [m/s] or rate [rad/s] above which the state must change within 50 ms: the change exceeds its last digit."""
BATTERY_HYSTERESIS = 0.02
TILT_MARGIN_DEG = 15
ROTOR_MEAN_S = 0.03
"""Time constant of the averaged rotor speed error: oscillating commands must not trigger the rotor detector."""
FASTEST_RAD_S = 1e6
"""A larger rotor speed is not a measurement; ideal rotors without limits stay below it."""
UNMEASURED_AFTER_S = 0.5
"""Time without a measurement after which a rotor is reported as not measured."""

FAULTS = (
    (NOT_FINITE, Failsafe.NOT_FINITE),
    (BEYOND_ATTITUDE, Failsafe.ATTITUDE),
    (BEYOND_POSITION, Failsafe.POSITION_ERROR),
    (ROTOR_FAULT, Failsafe.ROTOR),
)

TIMERS = 5
DETECTORS = np.dtype([("time", "f8", TIMERS), ("triggered", "i8", TIMERS)])
"""For each detector its output, and the time [s] for which the input has contradicted this output."""
LIMITS = np.dtype(
    [
        ("limit", "f8", TIMERS),  # rad, rad, rad, m, share of the rotor speed; 0 is off
        ("time", "f8", TIMERS),  # s beyond the limit before a detector triggers
        ("checks_speeds", "i8"),  # 1 with a limit of the rotor speed
        ("rotors", "i8"),
        ("slow", "f8"),  # rad/s; the relative error's least denominator
        ("thrust", "f8", MAX_ROTORS),  # N s²
    ]
)
ROTOR_SPEEDS = np.dtype(
    [
        (
            "expected",
            "f8",
            MAX_ROTORS,
        ),  # rad/s: first-order lag of the commands, exact for a zero-order hold
        ("mean", "f8", MAX_ROTORS),  # of the expected speed
        ("error", "f8", MAX_ROTORS),  # mean of the measured minus the expected speed
        ("missing", "f8", MAX_ROTORS),  # s without a measurement
        ("measured", "i8"),  # 1 after the first measured speed other than 0
        ("thrust", "f8"),  # N, at the mean speeds
    ]
)
ROTOR_LAGS = np.dtype(
    [
        ("lag", "f8", MAX_ROTORS),  # filter coefficient of each rotor's lag, per tick
        ("mean", "f8"),  # filter coefficient of ROTOR_MEAN_S, per tick
        ("dt", "f8"),  # s
        ("rotors", "i8"),
    ]
)

_REFERENCE_AT = LoopRow.REFERENCE_ATTITUDE.start
_COMMAND_AT = LoopRow.ROTOR_COMMAND.start
_SPEED_AT = LoopRow.ROTOR_SPEED.start
_STATUS_AT = LoopRow.STATUS
_BAD_OUTPUT = LoopStatus.OUTPUT_NOT_FINITE


def detector_limits(behaviour: Behaviour, vehicle: Vehicle) -> RecordArray:
    """Return ``LIMITS``, shape (1,), in the order roll, pitch, tilt error, position error, rotor speed."""
    b = behaviour
    least_deg = b.max_tilt_deg + TILT_MARGIN_DEG
    limits: RecordArray = np.zeros(1, LIMITS)
    limits["limit"] = (
        math.radians(max(b.max_roll_deg, least_deg)) if b.max_roll_deg > 0 else 0.0,
        math.radians(max(b.max_pitch_deg, least_deg)) if b.max_pitch_deg > 0 else 0.0,
        math.radians(b.max_tilt_error_deg),
        b.max_position_error_m,
        b.rotor_error if b.rotor_check else 0.0,
    )
    limits["time"] = (
        b.max_roll_s, b.max_pitch_s, b.max_tilt_error_s, b.max_position_error_s, b.rotor_error_ms * 1e-3
    )  # fmt: skip
    limits["checks_speeds"] = b.rotor_check and b.rotor_error > 0.0
    limits["rotors"] = len(vehicle.rotors)
    limits["thrust"][0, : len(vehicle.rotors)] = [rotor.thrust_coefficient_n_s2 for rotor in vehicle.rotors]
    limits["slow"] = 0.1 * min(1e4, *(rotor.max_speed_rad_s for rotor in vehicle.rotors))
    return limits


def rotor_lags(vehicle: Vehicle, dt_s: float) -> RecordArray:
    """Return ``ROTOR_LAGS``, shape (1,), for ticks of ``dt_s``."""
    lags: RecordArray = np.zeros(1, ROTOR_LAGS)
    for i, rotor in enumerate(vehicle.rotors):
        lags["lag"][0, i] = 1.0 - exp(-dt_s / rotor.lag_s) if rotor.lag_s > 0.0 else 1.0
    lags["mean"], lags["dt"], lags["rotors"] = 1.0 - exp(-dt_s / ROTOR_MEAN_S), dt_s, len(vehicle.rotors)
    return lags


@compiled
def follow_rotors(row: FloatArray, speeds: RecordArray, lags: RecordArray) -> None:
    """Compare each rotor's measured speed with the speed expected from its commands; once per inner tick.

    ``row`` (48,) holds speeds measured before its commands; ``speeds`` (1,) holds ``ROTOR_SPEEDS``. A command that is
    not finite, or beyond ``FASTEST_RAD_S``, is ignored. Such a speed is a missing measurement: the mean error decays
    until the next measurement.
    """
    s, lag = speeds[0], lags[0]
    for i in range(lag["rotors"]):
        expected = s["expected"][i]
        s["mean"][i] += (expected - s["mean"][i]) * lag["mean"]
        speed, command = row[_SPEED_AT + i], row[_COMMAND_AT + i]
        is_measured = abs(speed) <= FASTEST_RAD_S  # NaN is not
        error = speed - expected if is_measured else 0.0
        s["error"][i] += (error - s["error"][i]) * lag["mean"]
        s["missing"][i] = 0.0 if is_measured else s["missing"][i] + lag["dt"]
        if abs(command) <= FASTEST_RAD_S:
            s["expected"][i] = expected + (command - expected) * lag["lag"][i]


@compiled
def _advance_detector(detectors: Record, index: int, beyond: bool, time_s: float, dt_s: float) -> None:
    """Advance one detector by ``dt_s``."""
    time, triggered = detectors["time"], detectors["triggered"]
    if beyond == (triggered[index] != 0):
        time[index] = 0.0
        return
    time[index] += dt_s
    if time[index] >= (RELEASE_S if triggered[index] else time_s) - 1e-9:
        time[index] = 0.0
        triggered[index] = 0 if triggered[index] else 1


@compiled
def _fault_bits(detectors: Record) -> int:
    """Return the bits of the detectors that are triggered."""
    bits = (BEYOND_ATTITUDE, BEYOND_ATTITUDE, BEYOND_ATTITUDE, BEYOND_POSITION, ROTOR_FAULT)
    result = 0
    for index in range(TIMERS):
        if detectors["triggered"][index]:
            result |= bits[index]
    return result


@compiled
def _rotor_error(row: FloatArray, speeds: Record, limits: Record) -> float:
    """Return the largest mean error of a rotor's speed as share of its mean expected speed.

    A simulator without speed measurements sends zeros: the error is 0 until the first other value of a flight. After
    that, zeros are stopped rotors: an empty battery stops them all.
    """
    worst = 0.0
    for i in range(limits["rotors"]):
        if 0.0 < abs(row[_SPEED_AT + i]) <= FASTEST_RAD_S:
            speeds["measured"] = 1
        worst = max(worst, abs(speeds["error"][i]) / max(abs(speeds["mean"][i]), limits["slow"]))
    return worst if speeds["measured"] else 0.0


@compiled
def _thrust_n(speeds: Record, limits: Record) -> float:
    """Return the thrust at the mean measured speeds; without measurements, at the mean expected speeds.

    A measured speed that does not change counts: a rotor that is stuck turns so. If instead its telemetry is, the
    vehicle is not found landed, and stands with little thrust until it is disarmed.
    """
    thrust_n = 0.0
    for i in range(limits["rotors"]):
        speed = speeds["mean"][i] + (speeds["error"][i] if speeds["measured"] else 0.0)
        thrust_n += limits["thrust"][i] * speed * abs(speed)
    return thrust_n


@compiled
def _tilt_between(q: Quaternion, reference: FloatArray) -> float:
    """Return the angle [rad] between the thrust axes: between the third columns of the rotation matrices."""
    qw, qx, qy, qz = q
    rw, rx, ry, rz = reference[0], reference[1], reference[2], reference[3]
    cosine = (
        4.0 * (qx * qz + qw * qy) * (rx * rz + rw * ry)
        + 4.0 * (qy * qz - qw * qx) * (ry * rz - rw * rx)
        + (1.0 - 2.0 * (qx * qx + qy * qy)) * (1.0 - 2.0 * (rx * rx + ry * ry))
    )
    return acos(min(1.0, max(-1.0, cosine)))


@compiled
def _distance(p: Vector3, setpoint: FloatArray) -> float:
    dx, dy, dz = p.x - setpoint[0], p.y - setpoint[1], p.z - setpoint[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@compiled
def _is_moving(v: Vector3, rates: Vector3) -> bool:
    return max(abs(v.x), abs(v.y), abs(v.z), abs(rates.x), abs(rates.y), abs(rates.z)) > MOVING_ABOVE


@compiled
def detect(
    state: FloatArray,
    setpoint: FloatArray,
    row: FloatArray,
    rotor_speeds: RecordArray,
    detectors: RecordArray,
    limits_array: RecordArray,
    on_ground: bool,
    dt_s: float,
) -> int:
    """Advance all detectors by one outer tick; return the bits of the faults, ``MOVING`` and ``UNMEASURED``.

    ``state`` (13,), ``setpoint`` (11,) and ``row`` (48,), the newest row of the inner loop, as in ``contract``. A state
    that is not finite leaves the other detectors unchanged. ``on_ground`` disables the tilt error: ground contact
    determines the attitude. The limits of roll and pitch still apply.
    """
    speeds, memory, limits = rotor_speeds[0], detectors[0], limits_array[0]
    status = int(row[_STATUS_AT])
    for value in state:
        if not math.isfinite(value):
            return NOT_FINITE | _fault_bits(memory)
    result = NOT_FINITE if status & _BAD_OUTPUT != 0 else 0
    now = vehicle_state(state)
    if _is_moving(now.velocity_ned_m_s, now.rates_frd_rad_s):
        result |= MOVING
    for i in range(limits["rotors"]):
        if limits["checks_speeds"] != 0 and speeds["missing"][i] >= UNMEASURED_AFTER_S:
            result |= UNMEASURED
    w, x, y, z = now.attitude
    roll, pitch = roll_angle(w, x, y, z), pitch_angle(w, x, y, z)
    tilt_error = 0.0 if on_ground else _tilt_between(now.attitude, row[_REFERENCE_AT:])
    distance = _distance(now.position_ned_m, setpoint)
    errors = (abs(roll), abs(pitch), tilt_error, distance, _rotor_error(row, speeds, limits))
    speeds["thrust"] = _thrust_n(speeds, limits)
    for index in range(TIMERS):
        limit = limits["limit"][index]
        beyond = limit > 0.0 and not errors[index] <= limit
        _advance_detector(memory, index, beyond, limits["time"][index], dt_s)
    return result | _fault_bits(memory)


def battery_level(before: int, remaining: float, thresholds: tuple[float, float, float]) -> int:
    """Return the battery level: 0 normal or unknown so far, 1 low, 2 critical, 3 emergency.

    ``thresholds`` are the charges for low, critical and emergency, 0 to 1. A level ends only when the charge is
    ``BATTERY_HYSTERESIS`` above its threshold; an unknown charge (NaN) keeps it.
    """
    if math.isnan(remaining):
        return before
    reached = sum(remaining <= threshold for threshold in thresholds)
    kept = sum(remaining <= threshold + BATTERY_HYSTERESIS for threshold in thresholds)
    return max(reached, min(before, kept))


class FaultDetector:
    """Evaluates each row of the loops, and state and setpoint once per outer tick."""

    def __init__(
        self, vehicle: Vehicle, behaviour: Behaviour, outer_hz: float, divisor: int, state: FloatArray
    ) -> None:
        """Monitor ``state`` (13,), which is written in place; ``divisor`` is inner ticks per outer tick."""
        self._vehicle = vehicle
        self._state = state
        self._dt_s = 1.0 / outer_hz
        self.detectors: RecordArray = np.zeros(1, DETECTORS)
        """Memory of the detectors, for ``detect``, as ``limits``."""
        self.rotors: RecordArray = np.zeros(1, ROTOR_SPEEDS)
        """Expected and measured speeds of the rotors, for ``follow_rotors``, as ``lags``."""
        self._no_error_setpoint = np.zeros(SETPOINT_SIZE)
        self.lags = rotor_lags(vehicle, self._dt_s / divisor)
        self._thrust_n = self.rotors["thrust"].data  # read ten times as fast as the field
        self._unmeasured: set[int] = set()
        self.found = 0
        """Bits of ``detect`` from the last update."""
        self.set_behaviour(behaviour)
        row = np.zeros(LoopRow.SIZE)
        self._follow = direct(follow_rotors, row, self.rotors, self.lags)
        self._detect = direct(
            detect,
            state,
            self._no_error_setpoint,
            row,
            self.rotors,
            self.detectors,
            self.limits,
            False,
            self._dt_s,
        )

    def set_behaviour(self, behaviour: Behaviour) -> None:
        """Set new limits, from the next update on."""
        self.limits = detector_limits(behaviour, self._vehicle)

    def begin(self) -> None:
        """Reset all detectors at the start of a flight."""
        self.detectors[:] = np.zeros(1, DETECTORS)
        self.rotors[:] = np.zeros(1, ROTOR_SPEEDS)
        self._unmeasured.clear()
        self.found = 0

    def follow_rotors(self, row: FloatArray) -> None:
        """Take the newest row of the inner loop, shape (48,), once per inner tick."""
        self._follow(row, self.rotors, self.lags)

    def update(
        self, setpoint: FloatArray, row: FloatArray, position_is_controlled: bool, on_ground: bool
    ) -> int:
        """Advance by one outer tick; return the bits of ``detect``.

        ``setpoint`` (11,) and ``row`` (48,) are the newest of the outer and the inner loop. Position errors count only
        while the position is controlled: not on the ground, nor under attitude setpoints.
        """
        if not position_is_controlled:
            self._no_error_setpoint[:3] = self._state[:3]
            setpoint = self._no_error_setpoint
        self.found = self._detect(
            self._state, setpoint, row, self.rotors, self.detectors, self.limits, on_ground, self._dt_s
        )
        return self.found

    @property
    def rotor_thrust_n(self) -> float:
        """Thrust at the mean speeds of the rotors: measured, or expected from their commands."""
        thrust_n: float = self._thrust_n[0]
        return thrust_n

    @property
    def moves(self) -> bool:
        """True if the velocities and rates in the state are so large that the state must change."""
        return self.found & MOVING != 0

    @property
    def is_quiet(self) -> bool:
        """True if no fault was found."""
        return not self.found & ~(MOVING | UNMEASURED)

    def take_unmeasured(self) -> list[int]:
        """Return the rotors, from 1, whose speed is no longer measured; each one once per flight."""
        if not self.found & UNMEASURED:
            return []
        missing_s = self.rotors["missing"][0, : len(self._vehicle.rotors)]
        fresh = {int(i) + 1 for i in np.flatnonzero(missing_s >= UNMEASURED_AFTER_S)} - self._unmeasured
        self._unmeasured |= fresh
        return sorted(fresh)

    def failsafes(self) -> set[Failsafe]:
        """Return the failsafes of the faults found."""
        return {failsafe for bit, failsafe in FAULTS if self.found & bit}

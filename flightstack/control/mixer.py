"""Mixer: rotor speeds for a wrench, any rotor set, with limits; priority roll and pitch, then thrust, then yaw.

``firmware/core/fs_mixer.c`` is generated from this file.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from flightstack.control.control_law import ControlLaw, NoMemory, NoParams
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3, Wrench
from flightstack.params.vehicle import Vehicle

UNLIMITED_SPEED_SQUARED = 1e12  # (rad/s)²: finite limit of ideal rotors, never reached
ROUNDING = 1.0 / 2**53  # largest relative error of one operation
WORK_ROWS = 3

PerRotor: TypeAlias = Annotated[FloatArray, "rotors"]
"""A number for each rotor; the size in C."""
Work: TypeAlias = Annotated[FloatArray, WORK_ROWS, "rotors"]
"""Scratch space of the mixer."""


class Mixer(NamedTuple):
    """Rotor geometry and limits of n rotors.

    ``allocation`` (n, 4) maps (thrust [N], torque FRD [N m]) to Ω² [rad²/s²]: the pseudo-inverse of
    ``effectiveness`` (4, n), the least-norm solution for more than four rotors.
    ``low`` and ``high`` (n,) bound Ω²; ``spin`` (n,) is +1 for a rotor that turns clockwise from above.
    """

    allocation: Annotated[FloatArray, "rotors", 4]
    effectiveness: Annotated[FloatArray, 4, "rotors"]
    low: PerRotor
    high: PerRotor
    spin: PerRotor
    # computed from these by ``derived``
    middle: PerRotor
    """Mean of ``low`` and ``high``, (n,)."""
    reach: PerRotor
    """Distance from ``middle`` to either limit, less a rounding margin, (n,)."""
    is_inverse: float
    """1 if ``effectiveness`` inverts ``allocation`` except for rounding and every rotor adds thrust, else 0."""
    is_even: float
    """1 if all rotors have the same limits and the same share of the thrust, else 0."""


def mixer_for(vehicle: Vehicle) -> Mixer:
    """Compute the mixer of a vehicle from its rotor list."""
    limit = UNLIMITED_SPEED_SQUARED
    low = [-limit if vehicle.ideal_rotors else r.min_speed_rad_s * r.min_speed_rad_s for r in vehicle.rotors]
    high = [limit if vehicle.ideal_rotors else r.max_speed_rad_s * r.max_speed_rad_s for r in vehicle.rotors]
    spin = np.array([float(r.spin) for r in vehicle.rotors])
    return derived(vehicle.allocation(), vehicle.effectiveness(), np.array(low), np.array(high), spin)


def derived(
    allocation: FloatArray, effectiveness: FloatArray, low: FloatArray, high: FloatArray, spin: FloatArray
) -> Mixer:
    """Return the mixer for these arrays, with its derived fields."""
    middle = 0.5 * low + 0.5 * high
    reach = (0.5 * high - 0.5 * low) - 8.0 * ROUNDING * (abs(low) + abs(high))
    is_inverse = float(_is_inverse(allocation.tolist(), effectiveness.tolist()))
    is_even = float(all(_is_same(column) for column in (allocation[:, 0], low, high)))
    return Mixer(allocation, effectiveness, low, high, spin, middle, reach, is_inverse, is_even)


def _is_inverse(allocation: list[list[float]], effectiveness: list[list[float]]) -> bool:
    """Return True if effectiveness times allocation is the identity up to rounding, and every rotor adds thrust."""
    if not all(shares[0] > 0.0 for shares in allocation):
        return False
    for row, effects in enumerate(effectiveness):
        for column in range(4):
            total, magnitude = -1.0 if row == column else 0.0, 0.0
            for effect, shares in zip(effects, allocation, strict=True):
                total += effect * shares[column]
                magnitude += abs(shares[column])
            if not abs(total) <= 1024.0 * ROUNDING * max(map(abs, effects)) * magnitude:
                return False
    return True


def _is_same(values: FloatArray) -> bool:
    """Return True if all numbers are equal except for rounding."""
    return bool((abs(values[0] - values) <= 16.0 * ROUNDING * abs(values[0])).all())


@compiled
def _allocate(wrench: Wrench, mixer: Mixer, work: Work) -> tuple[bool, bool]:
    """Write each rotor's part of roll and pitch, of yaw, and of roll, pitch and thrust, without limits.

    Return two flags: no rotor is near a limit; a rotor is at or beyond a limit even without yaw.
    """
    base, turn, lift = work[0], work[1], work[2]
    torque, is_free, is_thrust_limited = wrench.torque_frd_n_m, True, False
    for i in range(mixer.low.size):
        base[i] = mixer.allocation[i, 1] * torque.x + mixer.allocation[i, 2] * torque.y
        turn[i] = mixer.allocation[i, 3] * torque.z
        lift[i] = base[i] + mixer.allocation[i, 0] * wrench.thrust_n
        off = abs(lift[i] - mixer.middle[i])
        if not off + abs(turn[i]) <= mixer.reach[i]:
            is_free = False
            if not off <= mixer.reach[i]:
                is_thrust_limited = True
    return is_free, is_thrust_limited


@compiled
def _limit_even(thrust_n: float, mixer: Mixer, work: Work) -> tuple[float, float]:
    """Limit roll and pitch, then thrust, for identical rotors; return the scale of roll and pitch, and the thrust.

    The rotors with the largest and the smallest part of roll and pitch determine both.
    """
    base, lift = work[0], work[2]
    share, low, high = mixer.allocation[0, 0], mixer.low[0], mixer.high[0]
    upper, lower = base[0], base[0]
    for i in range(1, mixer.low.size):
        upper, lower = max(upper, base[i]), min(lower, base[i])
    scale = 1.0
    if upper - lower > high - low:
        scale = (high - low) / (upper - lower)
        upper *= scale
        lower *= scale
    thrust_n = max(min(thrust_n, (high - upper) / share), (low - lower) / share)
    for i in range(mixer.low.size):
        lift[i] = min(max(base[i] * scale + share * thrust_n, low), high)  # beyond by no more than rounding
    return scale, thrust_n


@compiled
def _largest_yaw_scale(mixer: Mixer, work: Work) -> float:
    """Return the share of yaw, in [0, 1], that fits within the limits."""
    turn, lift = work[1], work[2]
    scale = 1.0
    for i in range(mixer.low.size):
        room = mixer.high[i] - lift[i] if turn[i] > 0.0 else lift[i] - mixer.low[i]
        size = abs(turn[i])
        if scale * size > room:
            scale = room / size
    return scale


@compiled
def _signed_root(square: float) -> float:
    root = math.sqrt(abs(square))
    return root if square >= 0.0 else -root


@compiled
def _largest_scale(base: PerRotor, direction: PerRotor, low: PerRotor, high: PerRotor) -> float:
    """Return the largest k in [0, 1] for which low ≤ base + k·direction ≤ high holds for every rotor."""
    scale = 1.0
    for i in range(base.size):
        step = direction[i]
        room = high[i] - base[i] if step > 0.0 else low[i] - base[i]
        if scale * abs(step) > abs(room):  # never if the step is zero
            scale = max(0.0, room / step)
    return scale


@compiled
def _fit_roll_pitch(speed_squared: PerRotor, mixer: Mixer) -> float:
    """Scale the roll-pitch part so that some thrust brings it within the limits; return the scale in [0, 1].

    Rotor i allows thrusts from (low − b)/a to (high − b)/a, where b is its roll-pitch part and a its Ω² per newton. A
    common thrust exists if no rotor's minimum exceeds another's maximum; a > 0 for any vehicle that hovers.
    """
    scale = 1.0
    n = speed_squared.size
    for i in range(n):
        for j in range(n):
            share_i, share_j = mixer.allocation[i, 0], mixer.allocation[j, 0]
            spread = speed_squared[i] * share_j - speed_squared[j] * share_i
            room = mixer.high[i] * share_j - mixer.low[j] * share_i
            if spread * scale > room:
                scale = max(0.0, room / spread)
    for i in range(n):
        speed_squared[i] *= scale
    return scale


@compiled
def _fit_thrust(base: PerRotor, thrust_n: float, mixer: Mixer) -> float:
    """Return the thrust nearest to ``thrust_n`` that keeps every rotor, with its roll-pitch part, within its limits."""
    for i in range(base.size):
        if mixer.allocation[i, 0] > 0.0:
            thrust_n = min(thrust_n, (mixer.high[i] - base[i]) / mixer.allocation[i, 0])
    for i in range(base.size):
        if mixer.allocation[i, 0] > 0.0:
            thrust_n = max(thrust_n, (mixer.low[i] - base[i]) / mixer.allocation[i, 0])
    return thrust_n


@compiled
def _fit(wrench: Wrench, mixer: Mixer, rotor_speed_rad_s: PerRotor, work: Work) -> Wrench:
    """Mix for rotors that differ, or if effectiveness does not invert allocation."""
    n = mixer.low.size
    base, yaw = work[0], work[1]
    torque = wrench.torque_frd_n_m
    for i in range(n):
        base[i] = mixer.allocation[i, 1] * torque.x + mixer.allocation[i, 2] * torque.y
        yaw[i] = mixer.allocation[i, 3] * torque.z
    _fit_roll_pitch(base, mixer)
    thrust_n = _fit_thrust(base, wrench.thrust_n, mixer)
    for i in range(n):
        base[i] = min(max(base[i] + mixer.allocation[i, 0] * thrust_n, mixer.low[i]), mixer.high[i])
    scale = _largest_scale(base, yaw, mixer.low, mixer.high)
    total, roll, pitch, heading = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        squared = base[i] + scale * yaw[i]
        rotor_speed_rad_s[i] = _signed_root(squared)
        total += mixer.effectiveness[0, i] * squared
        roll += mixer.effectiveness[1, i] * squared
        pitch += mixer.effectiveness[2, i] * squared
        heading += mixer.effectiveness[3, i] * squared
    return Wrench(total, Vector3(roll, pitch, heading))


@compiled
def mix(wrench: Wrench, mixer: Mixer, rotor_speed_rad_s: PerRotor, work: Work) -> Wrench:
    """Write the rotor speeds nearest to ``wrench``; return the wrench that they achieve.

    ``rotor_speed_rad_s`` has at least n elements; ``work``, shape (``WORK_ROWS``, n), is scratch space. Torque about
    roll and pitch has priority (it keeps the vehicle upright), then thrust, then yaw. With ideal rotors Ω² may be
    negative: the speed then has its sign.

    If effectiveness inverts allocation, the achieved wrench follows from the scales without a multiplication.
    """
    if mixer.is_inverse == 0.0:
        return _fit(wrench, mixer, rotor_speed_rad_s, work)
    is_free, is_thrust_limited = _allocate(wrench, mixer, work)
    tilt_scale, thrust_n, yaw_scale = 1.0, wrench.thrust_n, 1.0
    if not is_free:
        if is_thrust_limited:
            if mixer.is_even == 0.0:
                return _fit(wrench, mixer, rotor_speed_rad_s, work)
            tilt_scale, thrust_n = _limit_even(thrust_n, mixer, work)
        yaw_scale = _largest_yaw_scale(mixer, work)
    for i in range(mixer.low.size):
        rotor_speed_rad_s[i] = _signed_root(work[2, i] + yaw_scale * work[1, i])
    if is_free:
        return wrench
    torque = wrench.torque_frd_n_m
    roll, pitch = torque.x, torque.y
    if tilt_scale < 1.0:
        roll, pitch = tilt_scale * roll, tilt_scale * pitch
    return Wrench(thrust_n, Vector3(roll, pitch, yaw_scale * torque.z))


@compiled
def allocation_step(
    memory: NoMemory,
    wrench: Wrench,
    rotors: Mixer,
    params: NoParams,
    dt_s: float,
    rotor_speed_rad_s: PerRotor,
    work: Work,
) -> tuple[NoMemory, Wrench]:
    """Mix without memory; see ``mix``."""
    achieved = mix(wrench, rotors, rotor_speed_rad_s, work)
    return memory, achieved


ALLOCATION = ControlLaw(
    "allocation", allocation_step, NoMemory, NoParams, (0.0,), lambda vehicle, gains: NoParams(0.0), ()
)


@compiled
def relative_rotor_speed(rotor_speed_rad_s: PerRotor, spin: PerRotor) -> float:
    """Return Ω_r of the paper: counter-clockwise minus clockwise rotor speeds [rad/s]."""
    total = 0.0
    for i in range(spin.size):
        total -= spin[i] * rotor_speed_rad_s[i]
    return total

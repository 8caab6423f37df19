"""From a wrench to rotor speeds, for any rotor set, with limits: roll and pitch before thrust before yaw."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.compiled import compiled
from flightstack.contract import FloatArray, Vector3, Wrench
from flightstack.params.vehicle import Vehicle

UNLIMITED_SPEED_SQUARED = 1e12  # (rad/s)²: stands for "no limit" with ideal rotors, and stays finite


class Mixer(NamedTuple):
    """Rotor geometry in the form that the mixer computes with, n rotors.

    ``allocation`` (n, 4) maps (thrust [N], torque FRD [N m]) to Ω² [rad²/s²]: the pseudo-inverse of
    ``effectiveness`` (4, n), which is the least-norm choice when there are more than four rotors.
    ``low`` and ``high`` (n,) bound Ω²; ``spin`` (n,) is +1 for a rotor that turns clockwise from above.
    """

    allocation: FloatArray
    effectiveness: FloatArray
    low: FloatArray
    high: FloatArray
    spin: FloatArray


def mixer_for(vehicle: Vehicle) -> Mixer:
    """Compute the mixer of a vehicle from its rotor list."""
    effectiveness = vehicle.effectiveness()
    limit = UNLIMITED_SPEED_SQUARED
    low = [-limit if vehicle.ideal_rotors else r.min_speed_rad_s**2 for r in vehicle.rotors]
    high = [limit if vehicle.ideal_rotors else r.max_speed_rad_s**2 for r in vehicle.rotors]
    return Mixer(
        np.ascontiguousarray(np.linalg.pinv(effectiveness)),
        np.ascontiguousarray(effectiveness),
        np.array(low),
        np.array(high),
        np.array([float(r.spin) for r in vehicle.rotors]),
    )


@compiled
def _largest_scale(base: FloatArray, direction: FloatArray, low: FloatArray, high: FloatArray) -> float:
    """Largest k in [0, 1] for which low ≤ base + k·direction ≤ high holds for every rotor."""
    scale = 1.0
    for i in range(base.size):
        step = direction[i]
        room = high[i] - base[i] if step > 0.0 else low[i] - base[i]
        if step != 0.0 and scale * abs(step) > abs(room):
            scale = max(0.0, room / step)
    return scale


@compiled
def _fit_roll_pitch(speed_squared: FloatArray, mixer: Mixer) -> float:
    """Scale the roll-pitch part so that some thrust brings it between the limits; return the scale in [0, 1].

    Rotor i allows the thrusts from (low − b)/a to (high − b)/a, a being its share of a newton. There is a
    common one when no rotor's least is above another's most; a > 0 for any vehicle that hovers.
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
def _fit_thrust(base: FloatArray, thrust_n: float, mixer: Mixer) -> float:
    """Thrust nearest to ``thrust_n`` that keeps every rotor within its limits beside the roll-pitch part."""
    least, most = -math.inf, math.inf
    for i in range(base.size):
        per_newton = mixer.allocation[i, 0]
        if per_newton > 0.0:
            least = max(least, (mixer.low[i] - base[i]) / per_newton)
            most = min(most, (mixer.high[i] - base[i]) / per_newton)
    return max(min(thrust_n, most), least)


@compiled
def mix(wrench: Wrench, mixer: Mixer, rotor_speed_rad_s: FloatArray, work: FloatArray) -> Wrench:
    """Write the rotor speeds that come nearest to ``wrench``; return the wrench that they make.

    ``rotor_speed_rad_s`` has room for the rotors; ``work``, shape (2, n), is scratch space. Torque about roll
    and pitch is served first (they keep the vehicle upright), then thrust, then yaw with what is left. With
    ideal rotors Ω² may be negative: the speed then carries the sign.
    """
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
        rotor_speed_rad_s[i] = math.sqrt(squared) if squared >= 0.0 else -math.sqrt(-squared)
        total += mixer.effectiveness[0, i] * squared
        roll += mixer.effectiveness[1, i] * squared
        pitch += mixer.effectiveness[2, i] * squared
        heading += mixer.effectiveness[3, i] * squared
    return Wrench(total, Vector3(roll, pitch, heading))


@compiled
def relative_rotor_speed(rotor_speed_rad_s: FloatArray, spin: FloatArray) -> float:
    """Ω_r of the paper: counter-clockwise minus clockwise rotor speeds [rad/s]."""
    total = 0.0
    for i in range(spin.size):
        total -= spin[i] * rotor_speed_rad_s[i]
    return total

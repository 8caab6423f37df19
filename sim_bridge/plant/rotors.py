"""The rotor set in compiled code: commands with their limits, first-order lag, thrust and torques.

A rotor without lag jumps to its commanded speed. By convention the jump has no reaction on the frame (no spin-up
torque). A drive of limited torque (``max_drive_torque_n_m`` of a vehicle file) slows the lag down: the sum of J_r·Ω̇
and of the drag torque d·Ω|Ω| stays within the limit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record
from flightstack.simulator_link.hot_frames import ARMED_FLAG

_LARGEST_COMMAND_RAD_S = 1e6  # ten times the largest speed that a vehicle file may have
_ARMED = ARMED_FLAG


class RotorForces(NamedTuple):
    """Forces and torques of all rotors on the body, in body axes FRD."""

    thrust_n: float  # along −z
    roll_n_m: float
    pitch_n_m: float
    drag_torque_n_m: float  # about z, reaction to the drag of the air on the rotors
    spin_up_torque_n_m: float  # about z, reaction to the rotors' acceleration: −Σ s·J_r·Ω̇
    momentum_n_m_s: float  # about z: Σ s·J_r·Ω, s = +1 for a clockwise rotor
    power_w: float  # mechanical, against the drag of the air: Σ d·|Ω|³


@compiled
def take_commands(m: Record, command: FloatArray, flags: int) -> None:
    """Store the commands [rad/s] within the limits; disarmed or unpowered rotors are commanded to stop.

    A command that is not finite, or absurdly large, is counted, and the last good one holds.
    """
    rotors, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    has_power = m["curve_count"] == 0 or m["charge"] > 0.0
    armed = flags & _ARMED != 0 and has_power
    for i in range(m["rotor_count"]):
        rotor = rotors[i]
        if not armed:
            held[i] = 0.0
        elif abs(command[i]) < _LARGEST_COMMAND_RAD_S:  # false for NaN
            held[i] = min(max(command[i], rotor["min_speed"]), rotor["max_speed"])
        else:
            m["bad_commands"] += 1
        if rotor["lag_rate"] == math.inf:
            speed[i] = held[i]


@compiled
def drive_acceleration(m: Record, i: int, speed: float) -> float:
    """Return the acceleration [rad/s²] of rotor ``i`` at a speed: that of its lag, within the torque of its drive."""
    rotor = m["rotor"][i]
    wanted = (m["command"][i] - speed) * rotor["lag_rate"]
    drag = abs(rotor["drag"]) * speed * abs(speed)
    most, inertia = rotor["max_torque"], abs(rotor["momentum"])
    limited: float = min(max(wanted, (-most - drag) / inertia), (most - drag) / inertia)
    return limited


@compiled
def _limited_half_step(m: Record, i: int) -> float:
    """Return the speed of a rotor with a limited drive after half a step, by the midpoint rule, without overshoot."""
    begin, target, h = m["rotor_speed"][i], m["command"][i], 0.5 * m["step_s"]
    end = begin + h * drive_acceleration(m, i, begin + 0.5 * h * drive_acceleration(m, i, begin))
    passed = (target - begin) * (target - end) < 0.0
    speed: float = target if passed else end
    return speed


@compiled
def half_step(m: Record) -> None:
    """Advance the rotor speeds by half a step; without a torque limit by the exact solution of the lag."""
    rotors, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    for i in range(m["rotor_count"]):
        if rotors[i]["max_torque"] < math.inf:
            speed[i] = _limited_half_step(m, i)
        else:
            speed[i] = held[i] + (speed[i] - held[i]) * rotors[i]["half_step_decay"]


@compiled
def rotor_forces(m: Record) -> RotorForces:
    """Return forces and torques at the present rotor speeds; the thrust of a rotor is b·Ω·|Ω|."""
    rotors, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    thrust, roll, pitch, drag, spin_up, momentum, power = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(m["rotor_count"]):
        rotor, w = rotors[i], speed[i]
        w2 = w * abs(w)
        thrust += rotor["thrust"] * w2
        roll += rotor["roll"] * w2
        pitch += rotor["pitch"] * w2
        drag += rotor["drag"] * w2
        momentum += rotor["momentum"] * w
        power += abs(rotor["drag"] * w2 * w)
        if rotor["max_torque"] < math.inf:
            spin_up -= rotor["momentum"] * drive_acceleration(m, i, w)
        elif held[i] != w:  # always equal without lag
            spin_up -= rotor["momentum"] * (held[i] - w) * rotor["lag_rate"]
    return RotorForces(thrust, roll, pitch, drag, spin_up, momentum, power)

"""The rotor set in compiled code: commands with their limits, first-order lag, thrust and torques.

A rotor without lag jumps to its speed: that is a convention, with no reaction on the frame (no spin-up torque).
A drive of limited torque (``max_drive_torque_n_m`` of a vehicle file) slows the lag down: the sum of J_r·Ω̇ and of the
drag torque d·Ω|Ω| stays within it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.simulator_link.hot_frames import ARMED_FLAG
from sim_bridge.plant.layout import (
    DRAG,
    HALF_STEP_DECAY,
    HIGHEST,
    LAG_RATE,
    LOWEST,
    MOMENTUM,
    MOST_TORQUE,
    PITCH,
    ROLL,
    THRUST,
    Record,
)

_LARGEST_COMMAND_RAD_S = 1e6  # ten times the largest speed that a vehicle file may have
_ARMED = ARMED_FLAG


class RotorForces(NamedTuple):
    """What the rotors do to the body, in body axes FRD."""

    thrust_n: float  # along −z
    roll_n_m: float
    pitch_n_m: float
    drag_torque_n_m: float  # about z, reaction of the air's drag on the rotors
    spin_up_torque_n_m: float  # about z, reaction of the rotors' acceleration: −Σ s·J_r·Ω̇
    momentum_n_m_s: float  # about z: Σ s·J_r·Ω, s = +1 for a clockwise rotor
    power_w: float  # mechanical, against the air's drag: Σ d·|Ω|³


@compiled
def take_commands(m: Record, command: FloatArray, flags: int) -> None:
    """Store the commands [rad/s] within the limits; rotors stop when not armed or without power.

    A command that is not a sane number is counted, and the last good one holds.
    """
    rotor, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    has_power = m["curve_count"] == 0 or m["charge"] > 0.0
    armed = flags & _ARMED != 0 and has_power
    for i in range(m["rotor_count"]):
        if not armed:
            held[i] = 0.0
        elif abs(command[i]) < _LARGEST_COMMAND_RAD_S:  # false for NaN
            held[i] = min(max(command[i], rotor[i, LOWEST]), rotor[i, HIGHEST])
        else:
            m["bad_commands"] += 1
        if rotor[i, LAG_RATE] == math.inf:
            speed[i] = held[i]


@compiled
def driven(m: Record, i: int, speed: float) -> float:
    """Acceleration [rad/s²] of rotor ``i`` at a speed: the lag's, as far as the torque of its drive allows."""
    rotor = m["rotor"]
    wanted = (m["command"][i] - speed) * rotor[i, LAG_RATE]
    drag = abs(rotor[i, DRAG]) * speed * abs(speed)
    most, inertia = rotor[i, MOST_TORQUE], abs(rotor[i, MOMENTUM])
    limited: float = min(max(wanted, (-most - drag) / inertia), (most - drag) / inertia)
    return limited


@compiled
def _driven_half_step(m: Record, i: int) -> float:
    """Speed of a rotor with a limited drive after half a step, by the midpoint rule; not beyond its command."""
    begin, target, h = m["rotor_speed"][i], m["command"][i], 0.5 * m["step_s"]
    end = begin + h * driven(m, i, begin + 0.5 * h * driven(m, i, begin))
    passed = (target - begin) * (target - end) < 0.0
    speed: float = target if passed else end
    return speed


@compiled
def half_step(m: Record) -> None:
    """Advance the rotor speeds by half a step: the exact solution of Ω̇ = (command − Ω)/lag, where nothing limits it."""
    rotor, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    for i in range(m["rotor_count"]):
        if rotor[i, MOST_TORQUE] < math.inf:
            speed[i] = _driven_half_step(m, i)
        else:
            speed[i] = held[i] + (speed[i] - held[i]) * rotor[i, HALF_STEP_DECAY]


@compiled
def rotor_forces(m: Record) -> RotorForces:
    """Forces and torques at the present rotor speeds; thrust of a rotor is b·Ω·|Ω|."""
    rotor, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    thrust, roll, pitch, drag, spin_up, momentum, power = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(m["rotor_count"]):
        w = speed[i]
        w2 = w * abs(w)
        thrust += rotor[i, THRUST] * w2
        roll += rotor[i, ROLL] * w2
        pitch += rotor[i, PITCH] * w2
        drag += rotor[i, DRAG] * w2
        momentum += rotor[i, MOMENTUM] * w
        power += abs(rotor[i, DRAG] * w2 * w)
        if rotor[i, MOST_TORQUE] < math.inf:
            spin_up -= rotor[i, MOMENTUM] * driven(m, i, w)
        elif held[i] != w:  # never where there is no lag
            spin_up -= rotor[i, MOMENTUM] * (held[i] - w) * rotor[i, LAG_RATE]
    return RotorForces(thrust, roll, pitch, drag, spin_up, momentum, power)

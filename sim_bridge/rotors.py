"""The rotor set in compiled code: commands with their limits, first-order lag, thrust and torques."""

from __future__ import annotations

import math
from typing import NamedTuple

from flightstack.compiled import compiled
from flightstack.contract import FloatArray
from flightstack.mavlink.hot_frames import ARMED_FLAG
from sim_bridge.layout import (
    DRAG,
    HALF_STEP_DECAY,
    HIGHEST,
    LAG_RATE,
    LOWEST,
    MOMENTUM,
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
def half_step(m: Record) -> None:
    """Advance the rotor speeds by half a step: the exact solution of Ω̇ = (command − Ω)/lag."""
    rotor, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    for i in range(m["rotor_count"]):
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
        if held[i] != w:  # never where there is no lag
            spin_up -= rotor[i, MOMENTUM] * (held[i] - w) * rotor[i, LAG_RATE]
    return RotorForces(thrust, roll, pitch, drag, spin_up, momentum, power)

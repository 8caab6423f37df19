"""How MuJoCo's contact with the ground is set: as firm as the rigid plant's, without a bounce, and without creep.

A contact in MuJoCo wants the acceleration a* = −b·v − k·r of the touching point (v its speed, r its depth) and gets
the share d/(1 − d) of what is missing as acceleration of the point's effective mass. With b = 2/(d·T), k = 1/(d·T²·ζ*²)
and R feet under a mass the whole stands on a spring and damper with

    κ = R·d/(1 − d)     ω² = κ/(1 + κ)·k     2·ζ·ω = κ/(1 + κ)·b

from which T and ζ*, MuJoCo's ``solref``, follow for the ω and ζ of ``sim_bridge/plant/contact.py``.
"""

from __future__ import annotations

import math

from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.contact import DAMPING_RATIO, contact_model

_IMPEDANCE = 0.1
IMPEDANCE = f"{_IMPEDANCE} {_IMPEDANCE} 0.001"
"""MuJoCo's ``solimp``: the same at any depth."""
FRICTION_STIFFNESS = 10
"""Of friction over that of the normal force: a foot that is pushed creeps less."""
CREEP_ITERATIONS = 4
"""Of the solver that takes the rest of the creep away."""


def reference(vehicle: Vehicle, step_s: float) -> tuple[float, float]:
    """Return MuJoCo's ``solref`` for an integration step: time constant [s] and damping ratio."""
    ground = contact_model(vehicle, step_s, single_point=False)
    frequency = math.sqrt(ground.stiffness_n_m / vehicle.mass_kg)
    feet = len(vehicle.rotors) * _IMPEDANCE / (1.0 - _IMPEDANCE)
    share = feet / (1.0 + feet) / _IMPEDANCE
    time_s = share / (DAMPING_RATIO * frequency)
    return time_s, math.sqrt(share) / (frequency * time_s)

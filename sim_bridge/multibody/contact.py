"""How MuJoCo's contact with the ground is set: firm, without a bounce, and feet that do not creep.

A contact in MuJoCo is a spring and damper with a time constant and a damping ratio, whose force also depends on an
impedance: the nearer to 1, the harder.
"""

from __future__ import annotations

TIME_S = 0.01
"""Time constant; MuJoCo takes two steps where that is longer."""

_IMPEDANCE = 0.9
REFERENCE = f"{TIME_S} 1"
IMPEDANCE = f"{_IMPEDANCE} {_IMPEDANCE} 0.001"
FRICTION_STIFFNESS = 10
"""Of friction over that of the normal force: a foot that is pushed creeps less."""
CREEP_ITERATIONS = 4
"""Of the solver that takes the rest of the creep away."""

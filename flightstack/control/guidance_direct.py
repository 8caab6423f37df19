"""The built-in guidance law: the setpoint of mission and modes, unchanged.

A module of its own, as each built-in law: the firmware has a C file of it.
"""

from __future__ import annotations

from flightstack.control.control_law import ControlLaw, NoMemory, NoParams
from flightstack.core.compiled import compiled
from flightstack.core.contract import PositionSetpoint, VehicleState


@compiled
def direct_step(
    memory: NoMemory, state: VehicleState, setpoint: PositionSetpoint, params: NoParams, dt_s: float
) -> tuple[NoMemory, PositionSetpoint]:
    """Return the setpoint, which the trajectory of mission and modes has made feasible."""
    return memory, setpoint


DIRECT = ControlLaw(
    "direct", direct_step, NoMemory, NoParams, (0.0,), lambda vehicle, gains: NoParams(0.0), ()
)

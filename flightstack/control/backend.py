"""Interface of the control loops: implementations in Python, C on the host, and C on a target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from flightstack.core.contract import FloatArray, LoopRow, LoopStatus
from flightstack.params.spec import ParamSpec
from flightstack.params.vehicle import Vehicle


class ControlBackend(Protocol):
    """Outer loop, attitude reference, attitude controller and mixer, stepped once per inner tick.

    ``state`` (13,) and ``setpoint`` (11,) are the array forms of ``VehicleState`` and ``PositionSetpoint``;
    ``row`` (48,) is written as ``LoopRow`` describes.
    """

    name: str
    version: str
    """Implementation and version, for the log."""
    attitude_target: FloatArray
    """Array form of the latest ``AttitudeTarget``, shape (5,)."""

    @property
    def parameter_specs(self) -> Sequence[ParamSpec]:
        """Declarations of the loops' parameters, with defaults from vehicle and gains file."""

    def get_parameter(self, name: str) -> float:
        """Return the parameter's value in the loops; raise KeyError if unknown."""

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter from the next tick on; the caller checks its range. Raise KeyError if unknown."""

    def warm_up(self, state: FloatArray, setpoint: FloatArray, rotor_speed_rad_s: FloatArray) -> None:
        """Prepare for the arrays that ``step`` will receive, so that the first tick meets its deadline."""

    def reset(self, state: FloatArray) -> None:
        """Reset the integrators to zero and the reference to the present attitude, at rest."""

    def set_attitude_target(self, target: FloatArray) -> None:
        """Use ``target``, shape (5,), instead of the outer loop's target. Call once per outer period.

        The attitude is interpolated over an outer period, as for the outer loop's targets; the thrust changes at once.
        The caller then passes ``outer_due`` false to ``step``: the outer loop's integrators hold, and its next target
        is interpolated from this one.
        """

    def step(
        self,
        state: FloatArray,
        setpoint: FloatArray,
        rotor_speed_rad_s: FloatArray,
        outer_due: bool,
        row: FloatArray,
    ) -> None:
        """Run the outer loop if it is due, then the inner loop; write ``row`` with the rotor commands."""

    def idle(self, state: FloatArray, rotor_speed_rad_s: FloatArray, armed: bool, row: FloatArray) -> None:
        """Write ``row`` for a vehicle that must not fly: rotors at idle speed when armed, else stopped."""

    def hold(self) -> None:
        """Keep a target running in a tick in which the last rotor commands are held."""

    def close(self) -> None:
        """Release resources; no other call may follow."""


class IdleRow:
    """Writes the row of a tick without control."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._speed = np.array([max(0.0, rotor.min_speed_rad_s) for rotor in vehicle.rotors])
        self._columns = slice(LoopRow.ROTOR_COMMAND.start, LoopRow.ROTOR_COMMAND.start + self._speed.size)

    def write(self, state: FloatArray, rotor_speed_rad_s: FloatArray, armed: bool, row: FloatArray) -> None:
        """Write ``row`` (48,): rotors at idle speed when armed, else stopped; the reference at the attitude."""
        row[:] = 0.0
        row[LoopRow.STATE] = state
        row[LoopRow.REFERENCE_ATTITUDE] = state[6:10]
        if armed:
            row[self._columns] = self._speed
        row[LoopRow.ROTOR_SPEED] = rotor_speed_rad_s
        row[LoopRow.STATUS] = LoopStatus.IDLE

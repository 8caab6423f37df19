"""Seam between the flight stack and the control loops that fly: Python, C on the host, or C on a target."""

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
    """What computes: implementation and version, for the log."""
    attitude_target: FloatArray
    """Array form of the latest ``AttitudeTarget``, shape (5,)."""

    @property
    def parameter_specs(self) -> Sequence[ParamSpec]:
        """Declarations of all that may be tuned of the loops, with the defaults that vehicle and gains file give."""

    def get_parameter(self, name: str) -> float:
        """Return a parameter as the loops use it; raise KeyError if they have none of that name."""

    def set_parameter(self, name: str, value: float) -> None:
        """Change a parameter, checked by its declaration, from the next tick on; raise KeyError if unknown."""

    def warm_up(self, state: FloatArray, setpoint: FloatArray, rotor_speed_rad_s: FloatArray) -> None:
        """Do what takes time once, on the arrays that ``step`` will get: the first tick must not take a second."""

    def reset(self, state: FloatArray) -> None:
        """Forget the past: integrators zero, the reference at the present attitude, at rest."""

    def set_attitude_target(self, target: FloatArray) -> None:
        """Fly ``target``, shape (5,), in place of the outer loop's: call it once in each outer period.

        The attitude moves there in a straight line over an outer period, as the outer loop's targets do; the
        thrust is taken at once. ``step`` is then called with ``outer_due`` false; the outer loop's integrators
        rest, and its next target starts from this one.
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

    def close(self) -> None:
        """End; nothing is called after it."""


class IdleRow:
    """Writes rows of loops that rest."""

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

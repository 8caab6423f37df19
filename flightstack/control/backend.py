"""The seam between the flight stack and the loops that fly: Python now, C on host or target beside it."""

from __future__ import annotations

from typing import Protocol

from flightstack.contract import FloatArray


class ControlBackend(Protocol):
    """Outer loop, attitude reference, attitude controller and mixer, stepped once per inner tick.

    ``state`` (13,) and ``setpoint`` (11,) are the array forms of ``VehicleState`` and ``PositionSetpoint``;
    ``row`` (48,) is written as ``LoopRow`` describes.
    """

    name: str
    attitude_target: FloatArray
    """Array form of the latest ``AttitudeTarget``, shape (5,)."""

    def reset(self, state: FloatArray) -> None:
        """Forget the past: integrators zero, the reference at the present attitude, at rest."""

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

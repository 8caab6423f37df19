"""What the simulator asks of a plant, and the choices that every plant takes."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from sim_bridge.plant.battery import FULL, BatteryOptions, BatteryState
from sim_bridge.plant.disturbance import NO_DISTURBANCE, Disturbance


class InitialState(NamedTuple):
    """State at time zero; by default at rest on the ground, level, heading north."""

    position_ned_m: Vector3 = Vector3(0.0, 0.0, 0.0)
    velocity_ned_m_s: Vector3 = Vector3(0.0, 0.0, 0.0)
    euler_rad: Vector3 = Vector3(0.0, 0.0, 0.0)  # roll, pitch, yaw
    rates_frd_rad_s: Vector3 = Vector3(0.0, 0.0, 0.0)


AT_REST = InitialState()


class PlantOptions(NamedTuple):
    """Choices beside the vehicle."""

    disturbance: Disturbance = NO_DISTURBANCE
    seed: int = 1
    initial: InitialState = AT_REST
    ground: bool = True
    limits: bool = True  # of the rotor speeds
    battery: BatteryOptions | None = FULL  # None: the vehicle flies without one


class Plant(Protocol):
    """A model of the vehicle and its surroundings that the simulator drives.

    ``output`` is an array of dtype ``OUTPUT``, shape (1,), that the simulator sets: the plant writes its
    state there after each call of ``advance`` and of ``show``.
    """

    output: RecordArray

    @property
    def bad_commands(self) -> int:
        """Commands that were not a number and were replaced by the last good one."""
        ...

    def set_step(self, step_s: float) -> None:
        """Choose the fixed step of the integration."""
        ...

    def set_rotor_speeds(self, speeds_rad_s: tuple[float, ...]) -> None:
        """Put the rotors at once at these speeds."""
        ...

    def advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        """Advance with the rotor speed commands held; ``flags`` as in FS_ACTUATORS.

        Returns the bits CONTACT and DIVERGED of ``layout``.
        """
        ...

    @property
    def battery(self) -> BatteryState | None:
        """The battery; None for a vehicle without one."""
        ...

    def set_charge(self, share: float) -> None:
        """Set the charge of the battery."""
        ...

    def set_rotor_fault(self, rotor: int, share: float = 1.0, speed_rad_s: float | None = None) -> None:
        """Let a rotor (from 0) give a share of its thrust and torque, and turn at one speed only.

        The defaults make it whole again.
        """
        ...

    def rotor_speeds_rad_s(self) -> list[float]:
        """Rotor speeds in full precision, in the order of the vehicle file."""
        ...

    def show(self) -> int:
        """Write the present state to ``output``; returns as ``advance``."""
        ...

    def acceleration_ned_m_s2(self) -> Vector3:
        """Acceleration at the present state."""
        ...

    def airspeed_m_s(self) -> float:
        """Speed relative to the air."""
        ...

    @property
    def ground_softness_m(self) -> float:
        """How far the ground gives way under the vehicle's weight; more with longer steps."""
        ...

    def buried_m(self) -> float:
        """How far the vehicle reaches into the ground in the state shown (negative above it, where known)."""
        ...

    def about(self) -> str | None:
        """Tell what the user should know of how the plant was made, if anything."""
        ...

    def euler_rad(self) -> Vector3 | None:
        """Roll, pitch, yaw where they are states of the plant, else None."""
        ...

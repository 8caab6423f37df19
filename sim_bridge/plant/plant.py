"""The interface of a plant, and the options of all plants."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from flightstack.core.contract import FloatArray, RecordArray, Vector3
from sim_bridge.plant.battery import FULL, BatteryOptions, BatteryState
from sim_bridge.plant.disturbance import NO_DISTURBANCE, Disturbance
from sim_bridge.plant.faults.effects import PlantFaults


class InitialState(NamedTuple):
    """State at time zero; by default at rest on the ground, level, heading north."""

    position_ned_m: Vector3 = Vector3(0.0, 0.0, 0.0)
    velocity_ned_m_s: Vector3 = Vector3(0.0, 0.0, 0.0)
    euler_rad: Vector3 = Vector3(0.0, 0.0, 0.0)  # roll, pitch, yaw
    rates_frd_rad_s: Vector3 = Vector3(0.0, 0.0, 0.0)


AT_REST = InitialState()


class PlantOptions(NamedTuple):
    """Options beside the vehicle."""

    disturbance: Disturbance = NO_DISTURBANCE
    seed: int = 1
    initial: InitialState = AT_REST
    ground: bool = True
    limits: bool = True  # on the rotor speeds
    battery: BatteryOptions | None = FULL  # None: fly without a battery
    slope_rad: float = 0.0  # of the ground, which rises to the north; rigid plant
    boat_ned_m_s: Vector3 = Vector3(0.0, 0.0, 0.0)  # velocity of the ground, level

    @property
    def start(self) -> InitialState:
        """State at time zero; a vehicle at rest stands on the slope. Its velocity is that against the ground."""
        if self.initial != AT_REST:
            return self.initial
        return AT_REST._replace(euler_rad=Vector3(0.0, self.slope_rad, 0.0))


class Plant(Protocol):
    """A model of the vehicle and its environment.

    ``output``, an array of dtype ``OUTPUT`` and shape (1,), may be replaced by the caller: ``advance`` and ``show``
    write the state to it.
    """

    output: RecordArray

    @property
    def bad_commands(self) -> int:
        """Number of invalid commands, which the last good one replaced."""
        ...

    def set_step(self, step_s: float) -> None:
        """Set the fixed integration step [s]."""
        ...

    def set_rotor_speeds(self, speeds_rad_s: tuple[float, ...]) -> None:
        """Set the rotor speeds."""
        ...

    def advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        """Advance with the rotor speed commands held, ``flags`` as in FS_ACTUATORS.

        Returns the bits CONTACT and DIVERGED of ``layout``.
        """
        ...

    @property
    def battery(self) -> BatteryState | None:
        """State of the battery; None without one."""
        ...

    @property
    def current_a(self) -> float:
        """Current of the battery; 0 without one."""
        ...

    def set_charge(self, share: float) -> None:
        """Set the charge of the battery, 0 to 1."""
        ...

    def set_faults(self, faults: PlantFaults) -> None:
        """Set all faults and disturbances; those of an earlier call end."""
        ...

    def rotor_speeds_rad_s(self) -> list[float]:
        """Return the rotor speeds in full precision, in the order of the vehicle file."""
        ...

    def show(self) -> int:
        """Write the present state to ``output``; return the bits of ``advance``."""
        ...

    def acceleration_ned_m_s2(self) -> Vector3:
        """Return the acceleration at the present state."""
        ...

    def airspeed_m_s(self) -> float:
        """Return the airspeed."""
        ...

    @property
    def rest_depth_m(self) -> float:
        """Depth [m] at which the vehicle rests on the ground; it grows with the step."""
        ...

    def penetration_m(self) -> float:
        """Return the depth [m] below the rest depth in the present state; above the ground 0 or negative."""
        ...

    def description(self) -> str | None:
        """Return a description of the plant for the user, or None."""
        ...

    def euler_rad(self) -> Vector3 | None:
        """Return roll, pitch, yaw if they are states of the plant, else None."""
        ...

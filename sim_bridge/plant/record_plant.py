"""Common part of all plants: rotors and their faults, battery and disturbances in one record."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np

from flightstack.core.contract import FloatArray, RecordArray
from flightstack.core.portable_math import distance, exp
from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.battery import BatteryState, battery_state, set_battery
from sim_bridge.plant.layout import MEMORY, OUTPUT
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.plant.turbulence import Turbulence

DEFAULT_STEP_S = 1e-3


class RecordPlant(ABC):
    """A plant over the record ``MEMORY``; see ``Plant`` for its methods."""

    def __init__(self, vehicle: Vehicle, options: PlantOptions) -> None:
        self.output: RecordArray = np.zeros(1, OUTPUT)
        self._vehicle = vehicle
        self.memory: RecordArray = np.zeros(1, MEMORY)
        """State, rotors, faults and disturbances, dtype ``MEMORY``, shape (1,)."""
        m = self.memory[0]
        disturbance = options.disturbance
        m["wind"], m["force"] = disturbance.wind_ned_m_s, disturbance.force_ned_n
        m["steady_torque"] = m["torque"] = disturbance.torque_frd_n_m
        self._turbulence = Turbulence(m, disturbance, options.seed)
        m["ground"] = options.ground
        m["mass"], m["weight"] = vehicle.mass_kg, vehicle.weight_n
        m["inertia"], m["drag"] = vehicle.inertia_kg_m2, vehicle.linear_drag_n_s_m
        self._set_rotors(options.limits)
        self._has_battery = vehicle.battery is not None and options.battery is not None
        if vehicle.battery is not None and options.battery is not None:
            set_battery(m, vehicle.battery, options.battery)

    def _set_rotors(self, limits: bool) -> None:
        m = self.memory[0]
        m["rotor_count"] = len(self._vehicle.rotors)
        for index, rotor in enumerate(self._vehicle.rotors):
            x, y, _ = rotor.position_frd_m
            b = rotor.thrust_coefficient_n_s2
            m["rotor"][index] = (
                b,
                -y * b,
                x * b,
                -rotor.spin * rotor.torque_coefficient_n_m_s2,
                rotor.spin * rotor.inertia_kg_m2,
                1.0 / rotor.lag_s if rotor.lag_s > 0.0 else math.inf,
                rotor.min_speed_rad_s if limits else -math.inf,
                rotor.max_speed_rad_s if limits else math.inf,
                0.0,  # set with the step
                # without lag the speeds are imposed
                rotor.max_drive_torque_n_m if rotor.lag_s > 0.0 and rotor.inertia_kg_m2 > 0.0 else math.inf,
            )
        self._healthy: RecordArray = m["rotor"].copy()

    def set_rotor_fault(self, rotor: int, share: float = 1.0, speed_rad_s: float | None = None) -> None:
        """Scale thrust and torque of a rotor, and fix its commanded speed; see ``Plant``."""
        m, healthy = self.memory[0], self._healthy[rotor]
        now = m["rotor"][rotor]
        for name in ("thrust", "roll", "pitch", "drag"):
            now[name] = share * healthy[name]
        now["min_speed"], now["max_speed"] = healthy["min_speed"], healthy["max_speed"]
        if speed_rad_s is not None:
            now["min_speed"] = now["max_speed"] = speed_rad_s
            m["command"][rotor] = speed_rad_s  # holds also if the next command is invalid

    @property
    def battery(self) -> BatteryState | None:
        """State of the battery; None without one."""
        return battery_state(self.memory[0]) if self._has_battery else None

    def set_charge(self, share: float) -> None:
        """Set the charge of the battery, 0 to 1."""
        self.memory[0]["charge"] = share

    @property
    def bad_commands(self) -> int:
        """Number of invalid commands, which the last good one replaced."""
        return int(self.memory[0]["bad_commands"])

    def set_step(self, step_s: float) -> None:
        """Set the fixed integration step [s]."""
        m = self.memory[0]
        m["step_s"] = step_s
        for index, rotor in enumerate(self._vehicle.rotors):
            decay = exp(-0.5 * step_s / rotor.lag_s) if rotor.lag_s > 0.0 else 0.0
            m["rotor"][index]["half_step_decay"] = decay
        self._turbulence.set_step(step_s)

    def rotor_speeds_rad_s(self) -> list[float]:
        """Return the rotor speeds in full precision, in the order of the vehicle file."""
        speeds: list[float] = self.memory[0]["rotor_speed"][: len(self._vehicle.rotors)].tolist()
        return speeds

    def set_rotor_speeds(self, speeds_rad_s: tuple[float, ...]) -> None:
        """Set the rotor speeds."""
        self.memory[0]["rotor_speed"][: len(speeds_rad_s)] = speeds_rad_s

    @abstractmethod
    def _advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        """Advance by steps for which noise is available; return the bits of ``advance``."""

    def advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        """Advance by ``steps`` steps with the commands (shape (8,), rad/s) held; see ``Plant``."""
        if not self._turbulence.active:
            return self._advance(command_rad_s, flags, steps)
        result = 0
        while steps > 0:
            count = min(steps, self._turbulence.rows_left())
            result = self._advance(command_rad_s, flags, count)
            steps -= count
        return result

    def airspeed_m_s(self) -> float:
        """Return the airspeed."""
        m = self.memory[0]
        return distance(*(m["body"][3:6] - m["wind"] - m["gust"]).tolist())

    def description(self) -> str | None:
        """Return a description of the plant for the user, or None."""
        return None

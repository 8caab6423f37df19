"""Common part of all plants: rotors, their faults and dead time, battery and disturbances in one record."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque

import numpy as np

from flightstack.core.contract import MAX_ROTORS, FloatArray, RecordArray, Vector3
from flightstack.core.portable_math import exp, sin_cos
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from sim_bridge.plant.battery import BatteryState, battery_state, set_battery, set_pack
from sim_bridge.plant.dimensions import foot_z_m, propeller_radius_m
from sim_bridge.plant.faults.effects import PlantFaults, RotorFault
from sim_bridge.plant.layout import MEMORY, NOISE_ROWS, OUTPUT
from sim_bridge.plant.loading import AS_BUILT, Body, Loading, inverse, loaded
from sim_bridge.plant.near_ground import airspeed
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.plant.turbulence import Turbulence


class DeadTime:
    """Delays the commands of single rotors by whole integration steps."""

    def __init__(self) -> None:
        self._delays_s: dict[int, float] = {}
        self._waiting: dict[int, deque[float]] = {}
        self._step_s = 1.0
        self._command: FloatArray = np.zeros(MAX_ROTORS)

    @property
    def is_active(self) -> bool:
        """True if a rotor is delayed."""
        return bool(self._delays_s)

    def set_step(self, step_s: float) -> None:
        """Set the integration step [s]; commands that wait keep their order."""
        self._step_s = step_s
        for rotor, delay_s in self._delays_s.items():
            self._fill(rotor, delay_s, self._waiting[rotor][0])

    def set_delay(self, rotor: int, delay_s: float, held_rad_s: float) -> None:
        """Set the dead time of a rotor [s], 0 for none; ``held_rad_s`` is commanded until the first command is due."""
        if delay_s == self._delays_s.get(rotor, 0.0):
            return
        if delay_s == 0.0:
            del self._delays_s[rotor], self._waiting[rotor]
            return
        self._delays_s[rotor] = delay_s
        self._waiting.setdefault(rotor, deque())
        self._fill(rotor, delay_s, held_rad_s)

    def _fill(self, rotor: int, delay_s: float, held_rad_s: float) -> None:
        """Give a queue its length: the oldest commands go, or ``held_rad_s`` comes before them."""
        waiting, count = self._waiting[rotor], math.ceil(delay_s / self._step_s - 1e-9)
        while len(waiting) > count:
            waiting.popleft()
        waiting.extendleft([held_rad_s] * (count - len(waiting)))

    def delayed(self, command_rad_s: FloatArray) -> FloatArray:
        """Take the commands of one step, shape (8,); return those that act in it, valid until the next call."""
        out = self._command
        out[:] = command_rad_s
        for rotor, waiting in self._waiting.items():
            waiting.append(out.item(rotor))
            out[rotor] = waiting.popleft()
        return out


DEFAULT_STEP_S = 1e-3


class RecordPlant(ABC):
    """A plant over the record ``MEMORY``; see ``Plant`` for its methods."""

    def __init__(self, vehicle: Vehicle, options: PlantOptions) -> None:
        self.output: RecordArray = np.zeros(1, OUTPUT)
        self._vehicle = vehicle
        self.memory: RecordArray = np.zeros(1, MEMORY)
        """State, rotors, faults and disturbances, dtype ``MEMORY``, shape (1,)."""
        self.currents_a: FloatArray = self.memory["current"]
        """Current of the battery as in the memory, shape (1,)."""
        m = self.memory[0]
        disturbance = options.disturbance
        self._boat = np.array(options.boat_ned_m_s)
        self._is_on_boat, self._boat_m = bool(self._boat.any()), np.zeros(3)
        m["ground_slope"] = sin_cos(options.slope_rad)
        m["wind"], m["force"] = disturbance.wind_ned_m_s - self._boat, disturbance.force_ned_n
        m["steady_torque"] = m["torque"] = disturbance.torque_frd_n_m
        self._disturbance = disturbance
        self._turbulence = Turbulence(m, disturbance, options.seed)
        self._dead_time = DeadTime()
        self._is_plain = not (self._turbulence.active or self._is_on_boat)  # no work between two steps
        self._loading = AS_BUILT
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

    # ------------------------------------------------------------------ faults

    def set_faults(self, faults: PlantFaults) -> None:
        """Set all faults and disturbances; see ``Plant``."""
        for index in range(len(self._vehicle.rotors)):
            self._set_rotor_fault(index, faults.rotors[index])
        if faults.loading != self._loading:
            self._loading = faults.loading
            self._set_loading(faults.loading)
        self._set_air(faults)
        if self._has_battery:
            assert self._vehicle.battery is not None
            set_pack(self.memory[0], self._vehicle.battery, faults.extra_resistance_ohm, faults.dead_cells)
        self._is_plain = not (self._turbulence.active or self._dead_time.is_active or self._is_on_boat)

    def _set_rotor_fault(self, rotor: int, fault: RotorFault) -> None:
        """Scale thrust and torque of a rotor, fix its commanded speed, and delay its commands."""
        m, healthy = self.memory[0], self._healthy[rotor]
        now = m["rotor"][rotor]
        for name in ("thrust", "roll", "pitch", "drag"):
            now[name] = fault.share * healthy[name]
        now["min_speed"], now["max_speed"] = healthy["min_speed"], healthy["max_speed"]
        self._dead_time.set_delay(rotor, fault.delay_s, float(m["command"][rotor]))
        if fault.speed_rad_s is not None:
            now["min_speed"] = now["max_speed"] = fault.speed_rad_s
            m["command"][rotor] = fault.speed_rad_s  # holds also if the next command is invalid

    def _set_loading(self, loading: Loading) -> None:
        """Set payload and centre of gravity."""
        m, vehicle = self.memory[0], self._vehicle
        ix, iy, iz = vehicle.inertia_kg_m2
        diagonal = (Vector3(ix, 0.0, 0.0), Vector3(0.0, iy, 0.0), Vector3(0.0, 0.0, iz))
        body = loaded(Body(vehicle.mass_kg, Vector3(0.0, 0.0, 0.0), diagonal), loading)
        m["mass"], m["weight"] = body.mass_kg, body.mass_kg * GRAVITY_M_S2
        m["centre"], m["inertia_matrix"] = body.centre_m, body.inertia_kg_m2
        m["inverse_inertia"] = inverse(body.inertia_kg_m2)
        m["is_loaded"] = loading != AS_BUILT

    def _set_air(self, faults: PlantFaults) -> None:
        """Set mean wind, gusts, wind shear and ground effect."""
        m, vehicle, options = self.memory[0], self._vehicle, self._disturbance
        m["wind"] = np.array(options.wind_ned_m_s) + np.array(faults.wind_step_ned_m_s) - self._boat
        self._turbulence.set_gust(options.gust_m_s if faults.gust_m_s is None else faults.gust_m_s)
        m["alters_air"] = faults.wind_shear != 0.0 or faults.ground_effect
        m["shear"], m["surface_z"] = faults.wind_shear, foot_z_m(vehicle)
        m["rotor_z"] = math.fsum(rotor.position_frd_m[2] for rotor in vehicle.rotors) / len(vehicle.rotors)
        m["propeller_radius"] = propeller_radius_m(vehicle) if faults.ground_effect else 0.0

    @property
    def battery(self) -> BatteryState | None:
        """State of the battery; None without one."""
        return battery_state(self.memory) if self._has_battery else None

    @property
    def current_a(self) -> float:
        """Current of the battery; 0 without one."""
        return float(self.currents_a[0])

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
        self._dead_time.set_step(step_s)

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
        if self._is_plain:
            return self._advance(command_rad_s, flags, steps)
        result = 0
        while steps > 0:
            count = min(steps, self._turbulence.rows_left()) if self._turbulence.active else steps
            acting = command_rad_s
            if self._dead_time.is_active:
                count, acting = 1, self._dead_time.delayed(command_rad_s)
            result = self._advance(acting, flags, count)
            steps -= count
            self._boat_m += self._boat * (count * float(self.memory[0]["step_s"]))
        self._add_boat()
        return result

    def quiet_steps(self) -> int:
        """Return for how many of the next steps, at most 1024, ``advance`` does nothing but call its kernel."""
        if self._is_plain:
            return NOISE_ROWS
        if self._dead_time.is_active or self._is_on_boat:
            return 0
        return self._turbulence.rows_left()

    def _add_boat(self) -> None:
        """Add the motion of the boat to ``output``: the equations are those of a frame that moves with it."""
        if self._is_on_boat:
            state = self.output[0]["state"]
            state[0:3] += self._boat_m
            state[3:6] += self._boat

    def airspeed_m_s(self) -> float:
        """Return the airspeed."""
        return airspeed(self.memory)

    def description(self) -> str | None:
        """Return a description of the plant for the user, or None."""
        return None

"""The plants whose equations are compiled functions over one record."""

from __future__ import annotations

import math

import numpy as np

from flightstack.contract import FloatArray, Quaternion, Vector3
from flightstack.geometry import quaternion_from_euler, rotate
from flightstack.params.vehicle import Vehicle
from sim_bridge.battery import BatteryState, battery_state, set_battery
from sim_bridge.ground import Ground, ground_contact
from sim_bridge.integrator import advance_kernel, slope_kernel
from sim_bridge.layout import DRAG, HIGHEST, LOWEST, MEMORY, OUTPUT, THRUST, RecordArray
from sim_bridge.plant import InitialState, PlantOptions
from sim_bridge.turbulence import Turbulence

DEFAULT_STEP_S = 1e-3


class CompiledPlant:
    """A plant whose equations are compiled functions over the record ``MEMORY``."""

    def __init__(self, vehicle: Vehicle, name: str, options: PlantOptions) -> None:
        self.output: RecordArray = np.zeros(1, OUTPUT)
        self._paper = name == "paper"
        self._vehicle = vehicle
        self._memory: RecordArray = np.zeros(1, MEMORY)
        self._kernel = advance_kernel(name)
        self._slope = slope_kernel(name)
        m = self._memory[0]
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
        self.set_step(DEFAULT_STEP_S)
        self._set_state(options.initial)

    def _set_rotors(self, limits: bool) -> None:
        m = self._memory[0]
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
            )
        self._healthy: FloatArray = m["rotor"].copy()

    def set_rotor_fault(self, rotor: int, share: float = 1.0, speed_rad_s: float | None = None) -> None:
        """Let a rotor give a share of its thrust and torque, and turn at one speed only; see ``Plant``."""
        m, healthy = self._memory[0], self._healthy[rotor]
        row = m["rotor"][rotor]
        row[THRUST : DRAG + 1] = share * healthy[THRUST : DRAG + 1]
        row[LOWEST], row[HIGHEST] = healthy[LOWEST], healthy[HIGHEST]
        if speed_rad_s is not None:
            row[LOWEST] = row[HIGHEST] = speed_rad_s
            m["command"][rotor] = speed_rad_s  # also where the next command is not a number

    @property
    def battery(self) -> BatteryState | None:
        """The battery; None for a vehicle without one."""
        return battery_state(self._memory[0]) if self._has_battery else None

    def set_charge(self, share: float) -> None:
        """Set the charge of the battery."""
        self._memory[0]["charge"] = share

    def _set_state(self, initial: InitialState) -> None:
        body = self._memory[0]["body"]
        body[0:3], body[3:6] = initial.position_ned_m, initial.velocity_ned_m_s
        if self._paper:
            body[6:9], body[9:12] = initial.euler_rad, initial.rates_frd_rad_s
        else:
            body[6:10], body[10:13] = quaternion_from_euler(*initial.euler_rad), initial.rates_frd_rad_s
        # each friction spring starts relaxed: its anchor lies straight below or above its contact point
        m = self._memory[0]
        attitude = quaternion_from_euler(*initial.euler_rad)
        for index in range(int(m["point_count"])):
            arm = rotate(attitude, Vector3(*m["point"][index, :3].tolist()))
            m["anchor"][index] = (body[0] + arm.x, body[1] + arm.y, initial.euler_rad.z)

    def _set_ground(self, ground: Ground) -> None:
        m = self._memory[0]
        count = len(ground.points)
        m["point_count"] = count
        m["point"][:count] = ground.points
        m["ground_z"] = ground.foot_z_m - ground.rest_depth_m
        m["reach"] = float(np.linalg.norm(ground.points[:, :3], axis=1).max())
        m["stiffness"], m["damping"] = ground.stiffness_n_m, ground.damping_n_s_m
        m["ramp"] = ground.rest_depth_m
        arms = [math.hypot(*rotor.position_frd_m[:2]) for rotor in self._vehicle.rotors]
        m["lever"] = sum(arms) / len(arms)

    @property
    def bad_commands(self) -> int:
        """Commands that were not a number and were replaced by the last good one."""
        return int(self._memory[0]["bad_commands"])

    def set_step(self, step_s: float) -> None:
        """Choose the fixed step of the integration [s]."""
        m = self._memory[0]
        m["step_s"] = step_s
        for index, rotor in enumerate(self._vehicle.rotors):
            m["rotor"][index, -1] = math.exp(-0.5 * step_s / rotor.lag_s) if rotor.lag_s > 0.0 else 0.0
        self._turbulence.set_step(step_s)
        self._set_ground(ground_contact(self._vehicle, step_s, single_point=self._paper))

    def rotor_speeds_rad_s(self) -> list[float]:
        """Rotor speeds in full precision, in the order of the vehicle file."""
        speeds: list[float] = self._memory[0]["rotor_speed"][: len(self._vehicle.rotors)].tolist()
        return speeds

    def set_rotor_speeds(self, speeds_rad_s: tuple[float, ...]) -> None:
        """Put the rotors at once at these speeds."""
        self._memory[0]["rotor_speed"][: len(speeds_rad_s)] = speeds_rad_s

    def advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        """Advance by ``steps`` steps with the commands (shape (8,), rad/s) held; see ``Plant``."""
        if self._turbulence.active:
            return self._advance_in_gusts(command_rad_s, flags, steps)
        return self._kernel(self._memory, command_rad_s, flags, steps, self.output)

    def _advance_in_gusts(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        result = 0
        while steps > 0:
            count = min(steps, self._turbulence.rows_left())
            result = self._kernel(self._memory, command_rad_s, flags, count, self.output)
            steps -= count
        return result

    def show(self) -> int:
        """Write the present state to ``output``; returns as ``advance``."""
        return self._kernel(self._memory, self._memory[0]["command"], 0, 0, self.output)

    def acceleration_ned_m_s2(self) -> Vector3:
        """Acceleration at the present state."""
        self._slope(self._memory)
        x, y, z = self._memory[0]["slope"][0, 3:6].tolist()
        return Vector3(x, y, z)

    @property
    def ground_softness_m(self) -> float:
        """How far the ground gives way under the vehicle's weight; more with longer steps."""
        return float(self._memory[0]["ramp"])

    def buried_m(self) -> float:
        """How far the lowest contact point lies below the ground (negative above it) in the state shown."""
        m, state = self._memory[0], self.output[0]["state"].tolist()
        points = m["point"][: int(m["point_count"]), :3].tolist()
        lowest = max(rotate(Quaternion(*state[6:10]), Vector3(*point)).z for point in points)
        return float(state[2] + lowest - m["ground_z"] - m["ramp"])

    def airspeed_m_s(self) -> float:
        """Speed relative to the air."""
        m = self._memory[0]
        return float(np.linalg.norm(m["body"][3:6] - m["wind"] - m["gust"]))

    def euler_rad(self) -> Vector3 | None:
        """Roll, pitch, yaw where they are states of the plant, else None."""
        if not self._paper:
            return None
        roll, pitch, yaw = self._memory[0]["body"][6:9].tolist()
        return Vector3(roll, pitch, yaw)

"""The rigid and the paper plant: equations as compiled functions over one record."""

from __future__ import annotations

import math

from flightstack.core.compiled import direct
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import quaternion_from_euler, rotate
from flightstack.core.portable_math import distance
from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.contact import ContactModel, contact_model
from sim_bridge.plant.integrator import advance_kernel, slope_kernel
from sim_bridge.plant.plant import InitialState, PlantOptions
from sim_bridge.plant.record_plant import DEFAULT_STEP_S, RecordPlant


class CompiledPlant(RecordPlant):
    """A plant whose equations are compiled functions over the record ``MEMORY``."""

    def __init__(self, vehicle: Vehicle, name: str, options: PlantOptions) -> None:
        super().__init__(vehicle, options)
        self._paper = name == "paper"
        self.kernel = advance_kernel(name)
        """Kernel of ``advance``: memory, commands, flags, steps and output."""
        self._call = self.kernel
        self._last_command: FloatArray | None = None
        self._bound: FloatArray | None = None
        self._slope = slope_kernel(name)
        self.set_step(DEFAULT_STEP_S)
        self._set_state(options.start)

    def _set_state(self, initial: InitialState) -> None:
        body = self.memory[0]["body"]
        body[0:3], body[3:6] = initial.position_ned_m, initial.velocity_ned_m_s
        if self._paper:
            body[6:9], body[9:12] = initial.euler_rad, initial.rates_frd_rad_s
        else:
            body[6:10], body[10:13] = quaternion_from_euler(*initial.euler_rad), initial.rates_frd_rad_s
        # each friction spring starts relaxed, with its anchor vertically below or above its contact point
        m = self.memory[0]
        attitude = quaternion_from_euler(*initial.euler_rad)
        for index in range(int(m["point_count"])):
            arm = rotate(attitude, Vector3(*m["point"][index].tolist()))
            sine, cosine = m["ground_slope"].tolist()
            along = cosine * (body[0] + arm.x) - sine * (body[2] + arm.z)
            m["anchor"][index] = (along, body[1] + arm.y, initial.euler_rad.z)

    def _set_contact(self, contact: ContactModel) -> None:
        m = self.memory[0]
        count = len(contact.points_frd_m)
        m["point_count"] = count
        m["point"][:count], m["point_share"][:count] = contact.points_frd_m, contact.shares
        m["ground_z"] = contact.foot_z_m - contact.rest_depth_m
        m["reach"] = max(distance(*point) for point in contact.points_frd_m.tolist())
        m["stiffness"], m["damping"] = contact.stiffness_n_m, contact.damping_n_s_m
        m["ramp"] = contact.rest_depth_m
        arms = [distance(*rotor.position_frd_m[:2]) for rotor in self._vehicle.rotors]
        m["lever"] = math.fsum(arms) / len(arms)

    def set_step(self, step_s: float) -> None:
        """Set the fixed integration step [s]."""
        is_new = step_s != self.memory[0]["step_s"]
        super().set_step(step_s)
        if is_new:
            self._set_contact(contact_model(self._vehicle, step_s, single_point=self._paper))

    def _advance(self, command_rad_s: FloatArray, flags: int, steps: int) -> int:
        if command_rad_s is not self._bound:
            self._bind(command_rad_s)
        return self._call(self.memory, command_rad_s, flags, steps, self.output)

    def _bind(self, command_rad_s: FloatArray) -> None:
        """Call the kernel through its dispatcher, and directly from the second use of the same array on."""
        self._call, self._bound = self.kernel, None
        if command_rad_s is self._last_command:
            self._call = direct(self.kernel, self.memory, command_rad_s, 0, 1, self.output)
            self._bound = command_rad_s
        self._last_command = command_rad_s

    def show(self) -> int:
        """Write the present state to ``output``; return the bits of ``advance``."""
        result = self.kernel(self.memory, self.memory[0]["command"], 0, 0, self.output)
        self._add_boat()
        return result

    def acceleration_ned_m_s2(self) -> Vector3:
        """Return the acceleration at the present state."""
        self._slope(self.memory)
        x, y, z = self.memory[0]["slope"][0, 3:6].tolist()
        return Vector3(x, y, z)

    @property
    def rest_depth_m(self) -> float:
        """Depth [m] at which the vehicle rests; it grows with the step."""
        return float(self.memory[0]["ramp"])

    def penetration_m(self) -> float:
        """Return the depth [m] of the lowest contact point below its rest depth; negative above it."""
        m, state = self.memory[0], self.output[0]["state"].tolist()
        points = m["point"][: int(m["point_count"])].tolist()
        arms = [rotate(Quaternion(*state[6:10]), Vector3(*point)) for point in points]
        sine, cosine = m["ground_slope"].tolist()
        lowest = max(cosine * (state[2] + arm.z) + sine * (state[0] + arm.x) for arm in arms)
        return float(lowest - m["ground_z"] - m["ramp"])

    def euler_rad(self) -> Vector3 | None:
        """Return roll, pitch, yaw if they are states of the plant, else None."""
        if not self._paper:
            return None
        roll, pitch, yaw = self.memory[0]["body"][6:9].tolist()
        return Vector3(roll, pitch, yaw)

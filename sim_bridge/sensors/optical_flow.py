"""Optical flow: the angular rate at which the ground passes below the lens, about the body's x and y axes.

With the ground at the distance d along +z, and the velocity (u, v) against it along x and y of the body:

    flow_x = p − v / d            flow_y = q + u / d

The signs are MAVLink's (OPTICAL_FLOW_RAD): a positive rotation of the body about an axis is a positive flow about it.
"""

from __future__ import annotations

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, RecordArray, Vector3
from flightstack.core.geometry import conjugate, rotate
from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.sensors.layout import FLOW, write_ground, write_numbers
from sim_bridge.sensors.noise import NormalStream, limited, with_fault
from sim_bridge.sensors.rangefinder import ground_distance_m

_LEVEL = PlantOptions()


@compiled
def measure_flow(sensors: RecordArray, state: FloatArray, origin: FloatArray, noise: FloatArray) -> None:
    """Write the flow [rad/s] and its quality to ``out``; ``noise`` are two standard normal deviates."""
    sensor = sensors[0]
    if sensor["is_frozen"] != 0:
        return
    distance = ground_distance_m(state, origin, sensor)
    q = Quaternion(state[6], state[7], state[8], state[9])
    ground = sensor["ground_velocity"]
    velocity = rotate(conjugate(q), Vector3(state[3] - ground[0], state[4] - ground[1], state[5] - ground[2]))
    out, bias, most = sensor["out"], sensor["fault_bias"], sensor["max_rate_rad_s"]
    if distance < max(sensor["min_height_m"], 1e-3):
        out[0], out[1], out[2] = 0.0, 0.0, 0.0
        return
    spread = with_fault(sensor["noise_rad_s"], sensor["fault_noise"])
    out[0] = limited(state[10] - velocity.y / distance + bias[0] + spread * noise[0], most)
    out[1] = limited(state[11] + velocity.x / distance + bias[1] + spread * noise[1], most)
    out[2] = 1.0 if abs(out[0]) < most and abs(out[1]) < most else 0.0


class OpticalFlow:
    """The flow sensor of a vehicle."""

    def __init__(self, vehicle: Vehicle, options: PlantOptions = _LEVEL) -> None:
        self.records: RecordArray = np.zeros(1, FLOW)
        self.out: FloatArray = self.records["out"][0]
        """The last measurement."""
        self._noise = NormalStream(options.seed, "flow", width=2)
        self._origin: FloatArray = np.zeros(3)
        write_numbers(self.records[0], vehicle.sensors.numbers["flow"])
        write_ground(self.records[0], vehicle, options)

    def measure(self, state: FloatArray) -> FloatArray:
        """Measure at a state."""
        measure_flow(self.records, state, self._origin, self._noise.row())
        return self.out

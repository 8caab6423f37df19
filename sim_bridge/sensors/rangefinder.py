"""Rangefinder: the distance along the sensor's axis, +z of the body, to the ground.

Out of its range, or tilted beyond 60° against the ground, the sensor has no echo: quality 0 and the longest distance.
"""

from __future__ import annotations

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, RecordArray, Vector3
from flightstack.core.geometry import rotate
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import whole
from flightstack.mavlink.link import Message
from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.sensors.layout import RANGE, write_ground, write_numbers
from sim_bridge.sensors.noise import NormalStream, quantised, with_fault

_LEAST_COSINE = 0.5
_LEVEL = PlantOptions()
_UNKNOWN_VARIANCE = 255


@compiled
def ground_distance_m(state: FloatArray, mounting: FloatArray, sensor: Record) -> float:
    """Return the distance to the ground along +z of the body, or −1 if the axis does not point down."""
    q = Quaternion(state[6], state[7], state[8], state[9])
    sine, cosine = sensor["slope"][0], sensor["slope"][1]
    axis = rotate(q, Vector3(0.0, 0.0, 1.0))
    down = cosine * axis.z + sine * axis.x
    if down < _LEAST_COSINE:
        return -1.0
    at = rotate(q, Vector3(mounting[0], mounting[1], mounting[2]))
    height = sensor["surface_z"] - cosine * state[2] - sine * state[0] - cosine * at.z - sine * at.x
    distance: float = height / down
    return distance


@compiled
def measure_range(sensors: RecordArray, state: FloatArray, noise: FloatArray) -> None:
    """Write distance and quality to ``out``; ``noise`` are two standard normal deviates."""
    sensor = sensors[0]
    if sensor["is_frozen"] != 0:
        return
    true = ground_distance_m(state, sensor["position_frd_m"], sensor)
    error = with_fault(sensor["noise_m"], sensor["fault_noise"]) * noise[0]
    error += sensor["noise_share"] * true * noise[1]
    value = quantised(true + error + sensor["fault_bias"][0], sensor["resolution_m"])
    has_echo = true >= 0.0 and sensor["min_m"] <= value <= sensor["max_m"]
    sensor["out"][0], sensor["out"][1] = (value, 1.0) if has_echo else (sensor["max_m"], 0.0)


class Rangefinder:
    """The rangefinder of a vehicle."""

    def __init__(self, vehicle: Vehicle, options: PlantOptions = _LEVEL) -> None:
        self.records: RecordArray = np.zeros(1, RANGE)
        self.out: FloatArray = self.records["out"][0]
        """The last measurement."""
        self._noise = NormalStream(options.seed, "range", width=2)
        write_numbers(self.records[0], vehicle.sensors.numbers["range"])
        write_ground(self.records[0], vehicle, options)

    def measure(self, state: FloatArray) -> FloatArray:
        """Measure at a state."""
        measure_range(self.records, state, self._noise.row())
        return self.out


def distance_message(sensor: Record, time_us: int, distance_m: float, quality: float) -> Message:
    """Return DISTANCE_SENSOR with a measurement; ``sensor`` is the record of the rangefinder."""
    return mavlink.MAVLink_distance_sensor_message(
        time_us // 1000,
        whole(float(sensor["min_m"]) * 100.0, 0, 65535),
        whole(float(sensor["max_m"]) * 100.0, 0, 65535),
        whole(distance_m * 100.0, 0, 65535),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        0,
        mavlink.MAV_SENSOR_ROTATION_PITCH_270,
        _UNKNOWN_VARIANCE,
        signal_quality=100 if quality > 0.0 else 1,
    )

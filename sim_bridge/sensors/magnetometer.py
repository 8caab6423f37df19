"""Magnetometer: the earth's field in the body frame, disturbed by iron and by the current of the battery.

out = (I + S)·Rᵀ·B + h + c·I_battery + n
"""

from __future__ import annotations

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Quaternion, RecordArray, Vector3
from flightstack.core.geometry import conjugate, rotate
from flightstack.params.vehicle import Vehicle
from sim_bridge.sensors.layout import MAG, write_numbers
from sim_bridge.sensors.noise import NormalStream, limited, quantised, with_fault


@compiled
def measure_mag(mags: RecordArray, state: FloatArray, current_a: float, noise: FloatArray) -> None:
    """Write the field [gauss FRD] to ``out``; ``noise`` are three standard normal deviates."""
    mag = mags[0]
    if mag["is_frozen"] != 0:
        return
    earth, out = mag["earth"], mag["out"]
    spread = with_fault(mag["noise_gauss"], mag["fault_noise"])
    attitude = Quaternion(state[6], state[7], state[8], state[9])
    true = rotate(conjugate(attitude), Vector3(earth[0], earth[1], earth[2]))
    for axis in range(3):
        row = mag["matrix"][axis]
        value = row[0] * true.x + row[1] * true.y + row[2] * true.z
        value += mag["offset"][axis] + mag["per_ampere"][axis] * current_a + mag["fault_bias"][axis]
        value += spread * noise[axis]
        out[axis] = quantised(limited(value, mag["range_gauss"]), mag["resolution_gauss"])


class Magnetometer:
    """The magnetometer of a vehicle."""

    def __init__(self, vehicle: Vehicle, seed: int, earth_ned_gauss: Vector3) -> None:
        self.records: RecordArray = np.zeros(1, MAG)
        self.out: FloatArray = self.records["out"][0]
        """The last measurement."""
        self._call = measure_mag
        mag, self.noise = self.records[0], NormalStream(seed, "mag", width=3)
        write_numbers(mag, vehicle.sensors.numbers["mag"])
        mag["earth"] = earth_ned_gauss
        mag["matrix"] = np.eye(3) + mag["soft_iron"] * self.noise.first(10)[:9].reshape(3, 3)
        mag["offset"] = mag["hard_iron_gauss"] * self.noise.first(4)[:3]
        mag["per_ampere"] = mag["current_gauss_a"] * self.noise.first(4)[:3]

    def measure(self, state: FloatArray, current_a: float) -> FloatArray:
        """Measure at a state; ``current_a`` is that of the battery."""
        arguments = (self.records, state, current_a, self.noise.row())
        if self._call is measure_mag:
            self._call = direct(measure_mag, *arguments)
        self._call(*arguments)
        return self.out

"""GNSS receiver: position and velocity with white and correlated errors, late, with the accuracy that it states.

The correlated error is a first-order Gauss-Markov process on each axis. The stated accuracies are the standard
deviations of the model: horizontally over both axes (√2 σ), as u-blox receivers state them.

Jamming raises the noise floor: by a factor 1 / (1 − s) for the share s of the satellites that is lost, and a fix
needs four. A jump or a slow spoof moves the position and is not stated.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.params.vehicle import Vehicle
from sim_bridge.sensors.layout import GNSS, write_numbers
from sim_bridge.sensors.noise import NormalStream, gauss_markov, step_to, with_fault

LEAST_SATELLITES = 4


class Fix(NamedTuple):
    """One message of the receiver."""

    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    eph_m: float
    epv_m: float
    fix_type: int
    satellites: int


@compiled
def measure_gnss(receivers: RecordArray, time_us: int, state: FloatArray, noise: FloatArray) -> None:
    """Write position and velocity NED to ``out``; ``noise`` are nine standard normal deviates."""
    gnss = receivers[0]
    out, factor = gnss["out"], gnss["noise_factor"]
    decay, share = gauss_markov(step_to(gnss, time_us), gnss["drift_time_s"])
    for axis in range(3):
        drift_m = gnss["horizontal_drift_m"] if axis < 2 else gnss["vertical_drift_m"]
        gnss["drift"][axis] = decay * gnss["drift"][axis] + share * drift_m * noise[axis]
    if gnss["is_frozen"] != 0:
        return
    for axis in range(3):
        white = gnss["horizontal_noise_m"] if axis < 2 else gnss["vertical_noise_m"]
        speed = gnss["velocity_noise_m_s"] if axis < 2 else gnss["vertical_velocity_noise_m_s"]
        error = gnss["drift"][axis] + with_fault(white, gnss["fault_noise"]) * noise[3 + axis]
        out[axis] = state[axis] + gnss["fault_bias"][axis] + factor * error
        out[3 + axis] = state[3 + axis] + gnss["fault_rate"][axis] + factor * speed * noise[6 + axis]


class GnssReceiver:
    """The receiver of a vehicle."""

    def __init__(self, vehicle: Vehicle, seed: int) -> None:
        self.records: RecordArray = np.zeros(1, GNSS)
        gnss, self._noise = self.records[0], NormalStream(seed, "gnss", width=9)
        write_numbers(gnss, vehicle.sensors.numbers["gnss"])
        horizontal, vertical = float(gnss["horizontal_drift_m"]), float(gnss["vertical_drift_m"])
        spread = np.array([horizontal, horizontal, vertical])
        gnss["drift"] = spread * self._noise.first(4)[:3]
        gnss["measured_us"] = -1
        noise_m, vertical_noise_m = float(gnss["horizontal_noise_m"]), float(gnss["vertical_noise_m"])
        self._eph_m = math.sqrt(2.0 * (horizontal * horizontal + noise_m * noise_m))
        self._epv_m = math.sqrt(vertical * vertical + vertical_noise_m * vertical_noise_m)
        self._first_fix_us = round(float(gnss["first_fix_s"]) * 1e6)
        self.latency_us = round(float(gnss["latency_s"]) * 1e6)
        """Time from a measurement to its message."""
        self._call = measure_gnss
        self.jam(0.0)

    def jam(self, lost_share: float) -> None:
        """Take this share of the satellites."""
        gnss = self.records[0]
        self._jam = 1.0 / max(1.0 - lost_share, 0.05)
        gnss["noise_factor"] = self._jam
        self._satellites = math.floor(float(gnss["satellites"]) * (1.0 - lost_share) + 0.5)

    def measure(self, time_us: int, state: FloatArray) -> Fix:
        """Measure at a state."""
        arguments = (self.records, time_us, state, self._noise.row())
        if self._call is measure_gnss:
            self._call = direct(measure_gnss, *arguments)
        self._call(*arguments)
        has_fix = self._satellites >= LEAST_SATELLITES and time_us >= self._first_fix_us
        kind = mavlink.GPS_FIX_TYPE_3D_FIX if has_fix else mavlink.GPS_FIX_TYPE_NO_FIX
        x, y, z, vx, vy, vz = self.records["out"][0].tolist()
        accuracy = self._eph_m * self._jam, self._epv_m * self._jam
        return Fix(Vector3(x, y, z), Vector3(vx, vy, vz), *accuracy, kind, self._satellites)

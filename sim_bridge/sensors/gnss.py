"""GNSS receiver: position and velocity with white and correlated errors, late, with the accuracy that it states.

The correlated error is a first-order Gauss-Markov process on each axis. The stated accuracies are the standard
deviations of the model: horizontally over both axes (√2 σ), as u-blox receivers state them.

Jamming raises the noise floor: by a factor 1 / (1 − s) for the share s of the satellites that is lost, and a fix
needs four. A jump or a slow spoof moves the position and is not stated.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, RecordArray, Vector3
from flightstack.mavlink.dialect import mavlink
from flightstack.params.vehicle import Vehicle
from sim_bridge.sensors.layout import GNSS, write_numbers
from sim_bridge.sensors.noise import NormalStream, gauss_markov, with_fault

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
def measure_gnss(receivers: RecordArray, state: FloatArray, noise: FloatArray) -> None:
    """Write position and velocity NED to ``out``; ``noise`` are nine standard normal deviates."""
    gnss = receivers[0]
    out, factor = gnss["out"], gnss["noise_factor"]
    for axis in range(3):
        gnss["drift"][axis] = gnss["decay"] * gnss["drift"][axis] + gnss["wander"][axis] * noise[axis]
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
        gnss["decay"], share = gauss_markov(1.0 / float(gnss["rate_hz"]), float(gnss["drift_time_s"]))
        gnss["drift"], gnss["wander"] = spread * self._noise.first(4)[:3], share * spread
        noise_m, vertical_noise_m = float(gnss["horizontal_noise_m"]), float(gnss["vertical_noise_m"])
        self._eph_m = math.sqrt(2.0 * (horizontal * horizontal + noise_m * noise_m))
        self._epv_m = math.sqrt(vertical * vertical + vertical_noise_m * vertical_noise_m)
        self._latency_us = round(float(gnss["latency_s"]) * 1e6)
        self._first_fix_us = round(float(gnss["first_fix_s"]) * 1e6)
        self._waiting: deque[tuple[int, Fix]] = deque()
        self.lost_share = 0.0
        """Share of the satellites that jamming takes."""

    def measure(self, time_us: int, state: FloatArray) -> None:
        """Measure at a state; the message is due after the latency."""
        gnss = self.records[0]
        jam = 1.0 / max(1.0 - self.lost_share, 0.05)
        gnss["noise_factor"] = jam
        measure_gnss(self.records, state, self._noise.row())
        satellites = math.floor(float(gnss["satellites"]) * (1.0 - self.lost_share) + 0.5)
        has_fix = satellites >= LEAST_SATELLITES and time_us >= self._first_fix_us
        kind = mavlink.GPS_FIX_TYPE_3D_FIX if has_fix else mavlink.GPS_FIX_TYPE_NO_FIX
        x, y, z, vx, vy, vz = gnss["out"].tolist()
        fix = Fix(
            Vector3(x, y, z), Vector3(vx, vy, vz), self._eph_m * jam, self._epv_m * jam, kind, satellites
        )
        self._waiting.append((time_us + self._latency_us, fix))

    @property
    def next_due_us(self) -> int:
        """Time of the next message."""
        return self._waiting[0][0] if self._waiting else 1 << 64

    def due(self, time_us: int) -> Fix | None:
        """Return the newest message that is due, once; older ones are dropped."""
        fix = None
        while self._waiting and self._waiting[0][0] <= time_us:
            fix = self._waiting.popleft()[1]
        return fix

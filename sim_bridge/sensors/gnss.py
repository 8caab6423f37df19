"""GNSS receiver: position and velocity with white and correlated errors, late, with the accuracy that it states.

The correlated error is a first-order Gauss-Markov process on each axis. The stated accuracies are the standard
deviations of the model: horizontally over both axes (√2 σ), as u-blox receivers state them. A fix waits in the receiver
for its latency.

Jamming raises the noise floor: by a factor 1 / (1 − s) for the share s of the satellites that is lost, and a fix
needs four. A jump or a slow spoof moves the position and is not stated.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.core.array_items import store
from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Record, RecordArray, Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame, geographic
from flightstack.core.periods import NEVER_US
from flightstack.mavlink.dialect import mavlink
from flightstack.params.vehicle import Vehicle
from flightstack.simulator_link.gps_kernels import FIX_SIZE, FixRow
from sim_bridge.sensors.layout import GNSS, write_numbers
from sim_bridge.sensors.noise import NormalStream, gauss_markov, step_to, with_fault

LEAST_SATELLITES = 4
_FIX_3D, _NO_FIX = float(mavlink.GPS_FIX_TYPE_3D_FIX), float(mavlink.GPS_FIX_TYPE_NO_FIX)


@compiled
def _measure(gnss: Record, time_us: int, state: FloatArray, noise: FloatArray) -> None:
    """Write position and velocity NED to ``out``; ``noise`` are nine standard normal deviates."""
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


@compiled
def _fix(gnss: Record, time_us: int, place: FloatArray) -> FixRow:
    """Return the fix of the last measurement; ``place`` is the origin, as for ``receive_gnss``."""
    out = gnss["out"]
    kind = _FIX_3D if gnss["seen"] >= LEAST_SATELLITES and time_us >= gnss["first_fix_us"] else _NO_FIX
    origin, scales = GeoPoint(place[0], place[1], place[2]), (place[3], place[4])
    point = geographic(origin, scales, Vector3(out[0], out[1], out[2]))
    return FixRow(
        point.latitude_deg, point.longitude_deg, point.altitude_m, gnss["eph_m"], gnss["epv_m"],
        out[3], out[4], out[5], kind, float(gnss["seen"]),
    )  # fmt: skip


@compiled
def receive_gnss(receiver: Any, time_us: int, state: FloatArray) -> int:
    """Measure if it is due; return 1 if a fix is sent at ``time_us``, the newest whose latency is over, in ``sent``.

    ``receiver`` are the arguments of ``GnssReceiver``; ``times_us`` has the time of the next measurement, period and
    latency. The next call is due at ``due_us``.
    """
    gnss_array, due_us, times_us, waiting_us, waiting, count, sent, place, noise, cursor = receiver
    gnss = gnss_array[0]
    next_us, period_us, latency_us = times_us[0], times_us[1], times_us[2]
    if time_us >= next_us:
        next_us = times_us[0] = (time_us // period_us + 1) * period_us
        at = cursor[0]
        cursor[0] = at + 1
        _measure(gnss, time_us, state, noise[at])
        waiting_us[count[0]] = time_us + latency_us
        store(waiting[count[0]], _fix(gnss, time_us, place))
        count[0] += 1
    over = 0
    while over < count[0] and waiting_us[over] <= time_us:
        over += 1
    if over > 0:
        copy_all(waiting[over - 1], sent)
        count[0] -= over
        for i in range(count[0]):
            waiting_us[i] = waiting_us[over + i]
            copy_all(waiting[over + i], waiting[i])
    due_us[0] = min(next_us, waiting_us[0] if count[0] > 0 else NEVER_US)
    return 1 if over > 0 else 0


class GnssReceiver:
    """The receiver of a vehicle."""

    def __init__(self, vehicle: Vehicle, seed: int, home: GeoPoint) -> None:
        """``home`` is the origin of the state."""
        self.records: RecordArray = np.zeros(1, GNSS)
        gnss, noise = self.records[0], NormalStream(seed, "gnss", width=9)
        write_numbers(gnss, vehicle.sensors.numbers["gnss"])
        horizontal, vertical = float(gnss["horizontal_drift_m"]), float(gnss["vertical_drift_m"])
        spread = np.array([horizontal, horizontal, vertical])
        gnss["drift"] = spread * noise.first(4)[:3]
        gnss["measured_us"] = -1
        gnss["first_fix_us"] = round(float(gnss["first_fix_s"]) * 1e6)
        noise_m, vertical_noise_m = float(gnss["horizontal_noise_m"]), float(gnss["vertical_noise_m"])
        self._eph_m = math.sqrt(2.0 * (horizontal * horizontal + noise_m * noise_m))
        self._epv_m = math.sqrt(vertical * vertical + vertical_noise_m * vertical_noise_m)
        period_us, latency_us = (
            round(1e6 / float(gnss["rate_hz"])),
            round(float(gnss["latency_s"]) * 1e6),
        )
        self.noise = noise
        """Its deviates."""
        self.due_us = np.zeros(1, np.int64)
        """Time of the next measurement or fix."""
        self._times_us = np.array([0, period_us, latency_us])
        self._count = np.zeros(1, np.int64)
        most = (
            latency_us // period_us + 3
        )  # as measurements fall on steps, up to two are nearer to each other
        self.sent: FloatArray = np.zeros(FIX_SIZE)
        """The newest fix that was sent."""
        self.arguments: tuple[Any, ...] = (
            self.records, self.due_us, self._times_us, np.zeros(most, np.int64), np.zeros((most, FIX_SIZE)),
            self._count, self.sent, np.array((*home, *LocalFrame(home).scales)), noise.block, noise.cursor,
        )  # fmt: skip
        """Of ``receive_gnss``."""
        self._call = receive_gnss
        self.jam(0.0)

    def jam(self, lost_share: float) -> None:
        """Take this share of the satellites."""
        gnss = self.records[0]
        factor = 1.0 / max(1.0 - lost_share, 0.05)
        gnss["noise_factor"], gnss["eph_m"], gnss["epv_m"] = (
            factor,
            self._eph_m * factor,
            self._epv_m * factor,
        )
        gnss["seen"] = math.floor(float(gnss["satellites"]) * (1.0 - lost_share) + 0.5)

    def receive(self, time_us: int, state: FloatArray) -> FloatArray | None:
        """Return the fix that is sent at ``time_us``, as ``FixRow``, None without one; measure if it is due."""
        self.noise.ready()
        if self._call is receive_gnss:
            self._call = direct(receive_gnss, self.arguments, time_us, state)
        return self.sent if self._call(self.arguments, time_us, state) else None

    def restart(self) -> None:
        """Drop the fixes that wait, and measure next at once."""
        self._count[0] = self.due_us[0] = self._times_us[0] = 0

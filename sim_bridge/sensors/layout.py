"""Memory of the sensors: one NumPy record each, with the numbers of the vehicle file in SI units.

An angle of the file in degrees is in radians here, and its name ends in ``_rad`` instead of ``_deg``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.core.contract import MAX_ROTORS, Record
from flightstack.core.portable_math import sin_cos
from flightstack.params.sensors import TABLES, Numbers
from flightstack.params.vehicle import Vehicle
from sim_bridge.plant.dimensions import foot_z_m
from sim_bridge.plant.plant import PlantOptions

IMU_NOISE = 12
"""Normal deviates for one measurement of an inertial sensor: six white ones, six of the biases."""


def _fields(sensor: str) -> list[tuple[Any, ...]]:
    return [
        (_in_radians(item.key), "f8", len(item.consumer))
        if isinstance(item.consumer, tuple)
        else (_in_radians(item.key), "f8")
        for item in TABLES[sensor]
    ]


def _in_radians(key: str) -> str:
    return key.replace("_deg", "_rad")


def write_numbers(record: Record, numbers: Numbers) -> None:
    """Write the numbers of the vehicle file to the record of a sensor."""
    for key, value in numbers.items():
        scale = math.pi / 180.0 if "_deg" in key else 1.0
        record[_in_radians(key)] = np.multiply(value, scale)


def _dtype(sensor: str, *state: tuple[Any, ...], channels: tuple[int, ...] = ()) -> np.dtype[np.void]:
    """Return the record type of a sensor, of several ``channels`` that fail separately."""
    faults = [
        (
            "fault_noise",
            "f8",
            *channels,
        ),  # standard deviation of white noise on top, in the unit of the output
        ("is_frozen", "i8", *channels),  # 1: the last output stays
    ]
    return np.dtype([*_fields(sensor), *state, *faults], align=True)


MOTION = np.dtype(
    [
        ("attitude", "f8", 4),  # at the last measurement
        ("velocity", "f8", 3),  # of the mounting, m/s NED, then
        ("phase", "f8", MAX_ROTORS),  # angle of each rotor's imbalance, rad
        ("turn", "f8", (MAX_ROTORS, 2)),  # sine and cosine of this angle
        ("speed", "f8", MAX_ROTORS),  # of each rotor at the last measurement, rad/s
        ("rotor_count", "i8"),
        ("rotor_position", "f8", (MAX_ROTORS, 3)),  # m FRD
        ("spin", "f8", MAX_ROTORS),  # +1 clockwise seen from above
        ("imbalance", "f8"),  # kg m
        ("mass", "f8"),  # kg
        ("inertia", "f8", 3),  # kg m²
        ("mounting", "f8", 3),  # m FRD
        ("dt_s", "f8"),  # time since the last measurement
        ("row", "i8"),  # of the noise
    ],
    align=True,
)
"""Motion of the inertial sensors' mounting."""

IMU = _dtype(
    "imu",
    ("matrix", "f8", (2, 3, 3)),  # scale and misalignment of gyro and accelerometer
    ("turn_on", "f8", 6),  # bias at switch-on: rad/s, m/s²
    ("per_kelvin", "f8", 6),  # bias over the rise of the temperature
    ("bias", "f8", 6),  # that wanders
    ("decay", "f8"),  # of the bias over one measurement
    ("wander", "f8", 2),  # its standard deviation over one measurement
    ("white", "f8", 2),  # standard deviation of a measurement
    ("rise", "f8"),  # of the temperature, K
    ("warming", "f8"),  # decay of its rest over one measurement
    ("fault_bias", "f8", 6),  # rad/s, m/s²
    ("out", "f8", 6),  # rates rad/s, specific force m/s², FRD
    channels=(2,),
)
"""One inertial sensor."""

MAG = _dtype(
    "mag",
    ("earth", "f8", 3),  # field of the earth, gauss NED
    ("matrix", "f8", (3, 3)),  # unit matrix and soft iron
    ("offset", "f8", 3),  # hard iron, gauss
    ("per_ampere", "f8", 3),  # gauss/A
    ("fault_bias", "f8", 3),
    ("out", "f8", 3),  # gauss FRD
)

BARO = _dtype(
    "baro",
    ("offset", "f8"),  # hPa
    ("drift", "f8"),  # hPa
    ("measured_us", "i8"),  # time of the last measurement, -1 before the first
    ("disc_loading", "f8", MAX_ROTORS),  # thrust of each rotor over Ω·|Ω| and the area of all rotors, Pa s²
    ("rotor_radius", "f8"),  # m
    ("surface_z", "f8"),  # m NED, of the ground
    ("altitude", "f8"),  # of the origin above mean sea level, m
    ("fault_bias", "f8", 1),  # hPa
    ("out", "f8", 3),  # pressure hPa, pressure altitude m, temperature °C
)

GNSS = _dtype(
    "gnss",
    ("drift", "f8", 3),  # correlated error, m NED
    ("measured_us", "i8"),  # time of the last measurement, -1 before the first
    ("fault_bias", "f8", 3),  # m NED
    ("fault_rate", "f8", 3),  # m/s NED: the velocity of a spoofed position
    ("noise_factor", "f8"),  # of jamming
    ("first_fix_us", "i8"),  # time without a fix after switch-on
    ("eph_m", "f8"),  # stated accuracies
    ("epv_m", "f8"),
    ("seen", "i8"),  # number of satellites
    ("out", "f8", 6),  # position m NED, velocity m/s NED
)

_GROUND = (
    ("surface_z", "f8"),  # m along the normal of the ground
    ("slope", "f8", 2),  # sine and cosine; the ground rises to the north
    ("ground_velocity", "f8", 3),  # m/s NED
)

RANGE = _dtype(
    "range",
    *_GROUND,
    ("fault_bias", "f8", 1),
    ("out", "f8", 2),  # distance m, quality 0 to 1
)

FLOW = _dtype(
    "flow",
    *_GROUND,
    ("fault_bias", "f8", 2),
    ("out", "f8", 3),  # flow about x and y rad/s, quality 0 to 1
)


def write_ground(record: Record, vehicle: Vehicle, options: PlantOptions) -> None:
    """Write the ground under a vehicle to the record of a sensor that looks down."""
    record["surface_z"], record["slope"] = foot_z_m(vehicle), sin_cos(options.slope_rad)
    record["ground_velocity"] = options.boat_ned_m_s


SENSORS = {"imu": IMU, "mag": MAG, "baro": BARO, "gnss": GNSS, "range": RANGE, "flow": FLOW}
"""The record type of each sensor, by its name in ``TABLES``."""

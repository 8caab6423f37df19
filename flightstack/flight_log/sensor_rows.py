"""Rows of the flight log for samples and true states that quiet ticks record as well, and when rows are due."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.portable_math import atan2, distance
from flightstack.core.record_types import dtype_of
from flightstack.simulator_link.gps_kernels import FixRow

TRUTH_INTERVAL_US, GLOBAL_INTERVAL_US, ESTIMATOR_INTERVAL_US = 10_000, 100_000, 500_000
"""Intervals of PX4's logger; the last one is also that of the validity and accuracy of the local position."""
INVALID_INTERVAL_US = 100_000
"""That interval while the position is not valid."""


class DueTimes(NamedTuple):
    """Time of the next row of each kind that comes at intervals, ``NEVER_US`` without a log."""

    local_us: int
    """Of the columns of the estimate in the rows of the outer loop, which are made without a log too."""
    truth_us: int
    """Of the true state."""
    global_us: int
    """Of its place on the earth, which is recorded with it."""
    estimator_us: int


DUE_TIMES = dtype_of(DueTimes)

_GAS_CONSTANT_DRY_AIR = 287.1
_KELVIN = 273.15


@compiled
def store_mag(row: FloatArray, time_us: int, x: float, y: float, z: float) -> None:
    """Fill a row of ``MAG_GROUP`` with a field [gauss FRD]."""
    row[0], row[1], row[2], row[3] = time_us, x, y, z


@compiled
def store_baro(
    row: FloatArray, time_us: int, pressure_hpa: float, altitude_m: float, temperature_c: float
) -> None:
    """Fill a row of ``BARO_GROUP``; the density is that of dry air."""
    pressure_pa = pressure_hpa * 100.0
    row[0], row[1], row[2], row[3] = time_us, altitude_m, temperature_c, pressure_pa
    row[4] = pressure_pa / (_GAS_CONSTANT_DRY_AIR * (temperature_c + _KELVIN))


@compiled
def store_gnss(row: FloatArray, time_us: int, fix: FixRow, speed_accuracy_m_s: float) -> None:
    """Fill a row of ``GNSS_GROUP``."""
    north, east = fix.north_m_s, fix.east_m_s
    row[0], row[1], row[2], row[3] = time_us, fix.latitude_deg, fix.longitude_deg, fix.altitude_m
    row[4], row[5], row[6] = north, east, fix.down_m_s
    row[7], row[8], row[9] = fix.eph_m, fix.epv_m, speed_accuracy_m_s
    row[10], row[11] = fix.fix_type, fix.satellites
    row[12], row[13] = distance(north, east), atan2(east, north)


@compiled
def store_truth(row: FloatArray, state: FloatArray, offset_m: FloatArray) -> None:
    """Fill a row of ``TRUTH_GROUP`` with the true state, shape (13,); ``offset_m`` is that of its origin."""
    for i in range(len(state)):
        row[i] = state[i]
    for i in range(3):
        row[i] += offset_m[i]


@compiled
def store_global(row: FloatArray, state: FloatArray, place: FloatArray) -> None:
    """Fill a row of ``TRUTH_GLOBAL_GROUP``, as ``LocalFrame.to_geo`` does.

    ``place`` is the origin: latitude and longitude [°], altitude [m], metres per degree to the north and to the east.
    """
    longitude_deg = place[1] + state[1] / place[4]
    if abs(longitude_deg) > 180.0:  # beyond the date line
        longitude_deg = (longitude_deg + 180.0) % 360.0 - 180.0
    row[0], row[1], row[2] = place[0] + state[0] / place[3], longitude_deg, place[2] - state[2]

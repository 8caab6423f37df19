"""The payload of HIL_GPS in compiled code, with the values that ``sensor_frames`` writes and reads.

A module of its own, with few imports: the key of a kernel in the cache depends on all of them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from flightstack.core.array_items import as_tuple, store
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.portable_math import atan2, distance, whole_within
from flightstack.simulator_link.frame_kernels import read_bytes, write_bytes

GPS_SIZE, GPS_NUMBER_AT = 39, 36
"""Size of the payload, and the place of the receiver's number in it."""
_UNKNOWN = 0xFFFF
_LARGEST = 2.0**31 - 1.0


class FixRow(NamedTuple):
    """A fix as a row of numbers. An accuracy that is not known is NaN."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    eph_m: float
    epv_m: float
    north_m_s: float
    east_m_s: float
    down_m_s: float
    fix_type: float
    satellites: float


FIX_SIZE = len(FixRow._fields)


@compiled
def _centi(value: float) -> int:
    """Return hundredths, limited to what is known."""
    return whole_within(value * 100.0, 0.0, _UNKNOWN - 1.0)


@compiled
def write_gps(payload: Any, time_us: int, row: FloatArray) -> None:
    """Write the payload of a fix; values beyond the fields are limited."""
    fix = FixRow(*as_tuple(row, FIX_SIZE))
    course_deg = math.degrees(atan2(fix.east_m_s, fix.north_m_s)) % 360.0
    write_bytes(payload, 0, 8, time_us)
    write_bytes(payload, 8, 4, whole_within(fix.latitude_deg * 1e7, -_LARGEST - 1.0, _LARGEST))
    write_bytes(payload, 12, 4, whole_within(fix.longitude_deg * 1e7, -_LARGEST - 1.0, _LARGEST))
    write_bytes(payload, 16, 4, whole_within(fix.altitude_m * 1e3, -_LARGEST - 1.0, _LARGEST))
    write_bytes(payload, 20, 2, _centi(fix.eph_m))
    write_bytes(payload, 22, 2, _centi(fix.epv_m))
    write_bytes(payload, 24, 2, _centi(distance(fix.north_m_s, fix.east_m_s)))
    write_bytes(payload, 26, 2, whole_within(fix.north_m_s * 100.0, -32768.0, 32767.0))
    write_bytes(payload, 28, 2, whole_within(fix.east_m_s * 100.0, -32768.0, 32767.0))
    write_bytes(payload, 30, 2, whole_within(fix.down_m_s * 100.0, -32768.0, 32767.0))
    write_bytes(payload, 32, 2, _centi(course_deg) % 36000)
    payload[34], payload[35] = int(fix.fix_type), int(fix.satellites)
    write_bytes(payload, GPS_NUMBER_AT, 3, 0)  # the first receiver; its yaw is not available


@compiled
def _signed(payload: Any, at: int, count: int) -> int:
    """Return a signed number of ``count`` bytes."""
    value: int = read_bytes(payload, at, count)
    return value - (1 << (8 * count)) if value >> (8 * count - 1) else value


@compiled
def _accuracy(payload: Any, at: int) -> float:
    centimetres = read_bytes(payload, at, 2)
    return math.nan if centimetres == _UNKNOWN else centimetres * 0.01


@compiled
def read_gps(payload: Any, row: FloatArray) -> None:
    """Read a fix from the payload."""
    place = _signed(payload, 8, 4) * 1e-7, _signed(payload, 12, 4) * 1e-7, _signed(payload, 16, 4) * 1e-3
    velocity = _signed(payload, 26, 2) * 0.01, _signed(payload, 28, 2) * 0.01, _signed(payload, 30, 2) * 0.01
    accuracy = _accuracy(payload, 20), _accuracy(payload, 22)
    store(
        row, place + accuracy + velocity + (float(payload[34]), float(payload[35]))
    )  # Numba knows no other form

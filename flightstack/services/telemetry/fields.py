"""Conversion of vehicle values to single-precision and 32-bit time fields."""

from __future__ import annotations

import math

from flightstack.core.contract import FloatArray
from flightstack.core.portable_math import yaw_angle
from flightstack.vehicle.status import VehicleStatus

NAN = math.nan
_SINGLE_LIMIT = 1e18
"""Larger numbers become infinite: single-precision fields, and products of them, must hold the rest."""


def floats(array: FloatArray) -> list[float]:
    """Return the values as ``singles`` does."""
    return singles(array.tolist())


def singles(values: list[float]) -> list[float]:
    """Return ``values`` with infinity for numbers that single precision cannot hold."""
    for value in values:  # in every message: ``any`` takes twice as long
        if abs(value) > _SINGLE_LIMIT:
            return [math.copysign(math.inf, v) if abs(v) > _SINGLE_LIMIT else v for v in values]
    return values


def wrapped(time: int) -> int:
    """Return a time wrapped to 32 bits."""
    return time & 0xFFFFFFFF


def boot_ms(f: VehicleStatus) -> int:
    """Return the time since boot as the field ``time_boot_ms``, which wraps after 49.7 days."""
    return wrapped(f.time_us // 1000)


def heading_deg(q: list[float]) -> float:
    """Return the heading of a quaternion [deg], in [0, 360); 0 for a NaN quaternion."""
    return math.degrees(yaw_angle(*q)) % 360.0 if math.isfinite(q[0]) else 0.0

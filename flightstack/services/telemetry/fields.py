"""Conversion of vehicle values to single-precision and 32-bit time fields."""

from __future__ import annotations

import math

from flightstack.core.contract import FloatArray
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


def euler(q: list[float]) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [rad] of a quaternion w, x, y, z. Plain Python: telemetry needs no compiled code."""
    w, x, y, z = q
    sin_pitch = min(1.0, max(-1.0, 2.0 * (w * y - z * x)))
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sin_pitch),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def heading_deg(q: list[float]) -> float:
    """Return the heading of a quaternion [deg], in [0, 360); 0 for a NaN quaternion."""
    return math.degrees(euler(q)[2]) % 360.0 if math.isfinite(q[0]) else 0.0

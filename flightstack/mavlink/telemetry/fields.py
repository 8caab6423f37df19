"""Numbers of the vehicle as MAVLink's fields hold them: rounded, bounded, and nothing that cannot be packed."""

from __future__ import annotations

import math

from flightstack.contract import FloatArray
from flightstack.mavlink.telemetry.facts import VehicleFacts

NAN = math.nan
_SINGLE_LIMIT = 1e18
"""Beyond this a number counts as infinite: single-precision fields, and their products, must hold it."""


def whole(value: float, low: int, high: int) -> int:
    """Round into an integer field; what is not finite becomes 0."""
    return max(low, min(high, round(value))) if math.isfinite(value) else 0


def int16(value: float) -> int:
    """Round into a 16-bit field."""
    return whole(value, -32768, 32767)


def int32(value: float) -> int:
    """Round into a 32-bit field."""
    return whole(value, -(2**31), 2**31 - 1)


def floats(array: FloatArray) -> list[float]:
    """Return the values for fields of single precision, which not every double fits."""
    return singles(array.tolist())


def singles(values: list[float]) -> list[float]:
    """Return ``values`` with infinity in place of what single precision cannot hold."""
    for value in values:  # in every message: ``any`` takes twice as long
        if abs(value) > _SINGLE_LIMIT:
            return [math.copysign(math.inf, v) if abs(v) > _SINGLE_LIMIT else v for v in values]
    return values


def boot_ms(f: VehicleFacts) -> int:
    """Time since boot in the 32-bit field that wraps."""
    return (f.time_us // 1000) & 0xFFFFFFFF


def euler(q: list[float]) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a quaternion w, x, y, z (plain Python: telemetry needs no compiled code)."""
    w, x, y, z = q
    sin_pitch = min(1.0, max(-1.0, 2.0 * (w * y - z * x)))
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sin_pitch),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def heading_deg(q: list[float]) -> float:
    """Heading in [0, 360) of a quaternion; 0 for one that is not a number."""
    return math.degrees(euler(q)[2]) % 360.0 if math.isfinite(q[0]) else 0.0

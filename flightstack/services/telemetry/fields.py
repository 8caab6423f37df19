"""Conversion of vehicle values to the units of fields."""

from __future__ import annotations

import math

from flightstack.vehicle.status import VehicleStatus

NAN = math.nan
DEGREES = 180.0 / math.pi


def wrapped(time: int) -> int:
    """Return a time wrapped to 32 bits."""
    return time & 0xFFFFFFFF


def boot_ms(f: VehicleStatus) -> int:
    """Return the time since boot as the field ``time_boot_ms``, which wraps after 49.7 days."""
    return f.time_us // 1000 & 0xFFFFFFFF

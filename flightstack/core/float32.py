"""Numbers as MAVLink's 32-bit floats carry them."""

from __future__ import annotations

import math
import struct

LARGEST_FLOAT32 = 3.4028234663852886e38
_FLOAT32 = struct.Struct("<f")


def as_float32(value: float) -> float:
    """Round to a 32-bit float; beyond its range, infinity."""
    try:
        return float(_FLOAT32.unpack(_FLOAT32.pack(value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def shortest(value: float) -> float:
    """Return the shortest decimal number with the same 32-bit float as ``value``; infinity and NaN stay as they are."""
    if not abs(value) <= LARGEST_FLOAT32:
        return value
    (narrow,) = _FLOAT32.unpack(_FLOAT32.pack(value))
    for digits in range(6, 9):
        text = f"{narrow:.{digits}g}"
        if _FLOAT32.pack(float(text)) == _FLOAT32.pack(narrow):
            return float(text)
    return float(f"{narrow:.9g}")

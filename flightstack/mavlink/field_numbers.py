"""Numbers as the fixed-size fields of messages and logs hold them. Pure."""

from __future__ import annotations

import math
import struct

_SINGLE = struct.Struct("<f")
_SIZES = {"b": 8, "h": 16, "i": 32, "q": 64}
RANGES: dict[str, tuple[int, int]] = {"?": (0, 1)}
"""Smallest and largest value of each integer code of ``struct``."""
for _code, _bits in _SIZES.items():
    RANGES[_code] = -(1 << _bits - 1), (1 << _bits - 1) - 1
    RANGES[_code.upper()] = 0, (1 << _bits) - 1

COUNTERS = frozenset({
    "errors_comm", "errors_count1", "errors_count2", "errors_count3", "errors_count4", "rxerrors",
    "breach_count", "clipping_0", "clipping_1", "clipping_2", "reset_counter", "sequence",
    "mission_update_counter", "ticks", "overruns", "missed", "step", "steps", "repeats", "out_of_order",
    "frames", "bad_frames", "skipped_octets", "uart_overruns", "dropped_frames", "uart_errors",
    "loop_overruns", "safe_states",
})  # fmt: skip
"""Fields of messages and topics that count, and wrap.

Other unsigned fields saturate: a quantity need not have a unit, as ``eph`` and ``rssi``.
"""


def whole(value: float, low: int, high: int) -> int:
    """Round a quantity into an integer field, saturated; a value that is not finite becomes 0."""
    if not isinstance(value, int) and not math.isfinite(value):
        return 0
    return max(low, min(high, round(value)))


def int16(value: float) -> int:
    """Round a quantity into a signed 16-bit field."""
    return whole(value, -32768, 32767)


def int32(value: float) -> int:
    """Round a quantity into a signed 32-bit field."""
    return whole(value, -(2**31), 2**31 - 1)


def fitted(value: float, code: str, wraps: bool) -> float:
    """Return ``value`` as a field of the ``struct`` code ``code`` holds it.

    An integer that ``wraps`` is taken modulo the field's range, as clocks and counters are; any other saturates.
    A floating-point number too large for its field becomes infinite.
    """
    if code in RANGES:
        low, high = RANGES[code]
        if not wraps:
            return whole(value, low, high)
        finite = isinstance(value, int) or math.isfinite(value)
        return (round(value) - low) % (high - low + 1) + low if finite else 0
    try:
        number = float(value)
        if code == "f":
            _SINGLE.pack(number)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    return number

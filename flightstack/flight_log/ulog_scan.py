"""Positions of the messages in a ULog file. Pure."""

from __future__ import annotations

import sys
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.compiled import IS_DISABLED, compiled
from flightstack.flight_log.ulog import DATA_HEADER, DATA_TYPE, HEADER_SIZE, MESSAGE_HEADER, MESSAGE_TYPES

Positions: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

_MESSAGE_HEADER, _DATA_HEADER = MESSAGE_HEADER.size, DATA_HEADER.size
_IS_KNOWN = bytes(kind in MESSAGE_TYPES for kind in range(256))
_KNOWN = np.frombuffer(_IS_KNOWN, np.uint8)
_COMPILED_BYTES = 50_000_000
"""Size from which a file is worth the import of Numba, which takes as long as 2 million messages without it [B]."""


@compiled
def scan_kernel(content: Any, is_known: Any, positions: Any, numbers: Any) -> int:
    """Write the position of each message and that behind the last one to ``positions``; return their number.

    ``numbers`` gets the subscription id of each message of data, −1 for others. ``content`` and ``is_known``, by the
    type of a message, are bytes or arrays of uint8.
    """
    at, end, count = HEADER_SIZE, len(content), 0
    while at + _MESSAGE_HEADER <= end:
        after = at + _MESSAGE_HEADER + (content[at] | content[at + 1] << 8)
        kind = content[at + 2]
        if after > end or not is_known[kind] or (kind == DATA_TYPE and after < at + _DATA_HEADER):
            break
        positions[count] = at
        numbers[count] = content[at + 3] | content[at + 4] << 8 if kind == DATA_TYPE else -1
        count += 1
        at = after
    positions[count] = at
    return count + 1


def scan_messages(content: bytes) -> tuple[Positions, Positions]:
    """Return the position of each message, and the subscription id of each message of data, −1 for others.

    There is a further position, that behind the last message. It is the size of the file if messages of known types
    fill it to its last byte. The format has no end mark and no checksums: damage inside a message is not detected.
    """
    most = len(content) // _MESSAGE_HEADER + 1
    positions, numbers = np.empty(most, np.int64), np.empty(most, np.int64)
    if not IS_DISABLED and ("numba" in sys.modules or len(content) >= _COMPILED_BYTES):
        count = scan_kernel(np.frombuffer(content, np.uint8), _KNOWN, positions, numbers)
    else:
        scan = getattr(scan_kernel, "py_func", scan_kernel)
        count = scan(content, _IS_KNOWN, positions.data, numbers.data)
    return positions[:count].copy(), numbers[: count - 1].copy()  # most of the memory is not used

"""Positions of the messages in a ULog file. Pure."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.compiled import IS_DISABLED, compiled
from flightstack.flight_log.ulog import DATA_HEADER, DATA_TYPE, HEADER_SIZE, MESSAGE_HEADER, MESSAGE_TYPES

Positions: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]
Words: TypeAlias = np.ndarray[Any, np.dtype[np.uint16]]

_MESSAGE_HEADER, _DATA_HEADER = MESSAGE_HEADER.size, DATA_HEADER.size
_IS_KNOWN = bytes(kind in MESSAGE_TYPES for kind in range(256))
_KNOWN = np.frombuffer(_IS_KNOWN, np.uint8)
_COMPILED_BYTES = 50_000_000
"""Size from which a file is worth the import of Numba, which takes as long as 2 million messages without it [B]."""


class Messages(NamedTuple):
    """The messages of a file in its order: n rows of data, and m others."""

    rows: Positions
    """Position of each row, shape (n,)."""
    sizes: Words
    """Size of each row behind size and type [B], shape (n,)."""
    numbers: Words
    """Subscription id of each row, shape (n,)."""
    others: Positions
    """Position of each message that is no row, shape (m,)."""
    end: int
    """Position behind the last message: the size of the file if messages of known types fill it to its last byte."""


@compiled
def scan_kernel(
    content: Any, is_known: Any, rows: Any, sizes: Any, numbers: Any, others: Any
) -> tuple[int, int, int]:
    """Fill the arrays of ``Messages``; return the number of rows, that of the others, and ``end``.

    ``content`` and ``is_known``, by the type of a message, are bytes or arrays of uint8.
    """
    at, end, count, others_count = HEADER_SIZE, len(content), 0, 0
    while at + _MESSAGE_HEADER <= end:
        size = content[at] | content[at + 1] << 8
        kind = content[at + 2]
        after = at + _MESSAGE_HEADER + size
        if after > end or not is_known[kind] or (kind == DATA_TYPE and after < at + _DATA_HEADER):
            break
        if kind == DATA_TYPE:
            rows[count] = at
            sizes[count] = size
            numbers[count] = content[at + 3] | content[at + 4] << 8
            count += 1
        else:
            others[others_count] = at
            others_count += 1
        at = after
    return count, others_count, at


def scan_messages(content: bytes) -> Messages:
    """Find all messages up to the first that is cut off or of no known type.

    The format has no end mark and no checksums: damage inside a message is not detected.
    """
    most = len(content) // _DATA_HEADER
    rows, others = np.empty(most, np.int64), np.empty(len(content) // _MESSAGE_HEADER, np.int64)
    sizes, numbers = np.empty(most, np.uint16), np.empty(most, np.uint16)
    arrays = (rows, sizes, numbers, others)
    if not IS_DISABLED and ("numba" in sys.modules or len(content) >= _COMPILED_BYTES):
        count, others_count, end = scan_kernel(np.frombuffer(content, np.uint8), _KNOWN, *arrays)
    else:
        scan = getattr(scan_kernel, "py_func", scan_kernel)
        count, others_count, end = scan(content, _IS_KNOWN, *(array.data for array in arrays))
    return Messages(  # copies: most of the memory is not used
        rows[:count].copy(),
        sizes[:count].copy(),
        numbers[:count].copy(),
        others[:others_count].copy(),
        end,
    )

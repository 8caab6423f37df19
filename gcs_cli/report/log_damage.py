"""Is a ULog file whole? Its format has no end mark and no checksums, but its messages must follow each other."""

from __future__ import annotations

_FILE_HEADER = 16
_MESSAGE_HEADER = 3  # size of the payload, two bytes, little endian; type
_TYPES = frozenset(b"BFIMPQADRLCSO")


def is_whole(log: bytes) -> bool:
    """Tell whether messages of known types fill the file to its last byte. Damage inside of one is not seen."""
    at, end = _FILE_HEADER, len(log)
    while at + _MESSAGE_HEADER <= end:
        if log[at + 2] not in _TYPES:
            return False
        at += _MESSAGE_HEADER + log[at] + 256 * log[at + 1]
    return at == end

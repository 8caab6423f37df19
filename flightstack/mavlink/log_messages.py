"""LOG_DATA messages with their data as bytes."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Message

BLOCK = 90
"""Bytes in one LOG_DATA."""


def log_data_message(log_id: int, offset: int, data: bytes) -> Message:
    """Return LOG_DATA with up to 90 bytes; without data, ``offset`` is the end of the log."""
    return mavlink.MAVLink_log_data_message(log_id, offset, len(data), data.ljust(BLOCK, b"\x00"))


def log_data(message: Message) -> bytes:
    """Return the data of a received LOG_DATA, whose count may be any."""
    return bytes(message.data[: min(message.count, BLOCK)])

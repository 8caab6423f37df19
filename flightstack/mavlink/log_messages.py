"""LOG_DATA messages with their data as bytes."""

from __future__ import annotations

import struct

from flightstack.mavlink.dialect import mavlink

BLOCK = 90
"""Bytes in one LOG_DATA."""
_LAYOUT = struct.Struct("<IHB90s")


class LogDataMessage(mavlink.MAVLink_log_data_message):  # type: ignore[misc]
    """LOG_DATA with bytes as data: pymavlink packs 90 integers one by one."""

    def pack(self, mav: object, force_mavlink1: bool = False) -> bytes:
        """Return the frame."""
        content = _LAYOUT.pack(self.ofs, self.id, self.count, bytes(self.data))
        frame: bytes = self._pack(mav, self.crc_extra, content, force_mavlink1=force_mavlink1)
        return frame


def log_data_message(log_id: int, offset: int, data: bytes) -> LogDataMessage:
    """Return LOG_DATA with up to 90 bytes; without data, ``offset`` is the end of the log."""
    return LogDataMessage(log_id, offset, len(data), data.ljust(BLOCK, b"\x00"))

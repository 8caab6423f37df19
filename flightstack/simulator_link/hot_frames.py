"""The two messages of the lockstep exchange, encoded in place without a copy or an object per step.

Each message keeps its frame in one buffer with aligned payload doubles, so that the array passed to the kernels is the
payload itself. A test checks that the bytes equal pymavlink's.
"""

from __future__ import annotations

import struct
import sys

import numpy as np
from fastcrc import crc16

from flightstack.core.contract import MAX_ROTORS, STATE_SIZE, FloatArray
from flightstack.mavlink.dialect import LAYOUT_BY_NAME
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER, HEADER_V2, MAGIC_V2
from flightstack.simulator_link.frame_kernels import Shape

if sys.byteorder != "little":  # the payload is used in place
    raise ImportError("flightstack requires a little-endian machine")

_ALIGNMENT = 6  # puts the payload at offset 16 of the buffer
_TIME = struct.Struct("<Q")
_CRC = struct.Struct("<H")
_crc16 = crc16.mcrf4xx

VALID_FLAG = 1
GROUND_CONTACT_FLAG = 2  # FS_PLANT_STATE
ARMED_FLAG = 2  # FS_ACTUATORS
LOCKSTEP_FLAG = 4  # FS_ACTUATORS


class _HotFrame:
    """A message of fixed length: its last byte, the flags, is never zero, so that it is not truncated."""

    name = ""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        layout = LAYOUT_BY_NAME[self.name]
        self.payload_size = struct.calcsize(layout.format)
        self.size = HEADER_V2 + self.payload_size + CHECKSUM_SIZE
        self._extra = layout.crc_extra
        self.shape = Shape(self.payload_size, layout.crc_extra, *layout.message_id.to_bytes(3, "little"))
        """For compiled code."""
        self._extra_byte = bytes([layout.crc_extra])
        self._buffer = bytearray(_ALIGNMENT + self.size)
        self.frame = memoryview(self._buffer)[_ALIGNMENT:]
        HEADER.pack_into(
            self.frame, 0, MAGIC_V2, self.payload_size, 0, 0, 0, system_id, component_id,
            layout.message_id & 0xFFFF, layout.message_id >> 16,
        )  # fmt: skip
        # constant part of the header, time, flags, checksum
        self._unpack = struct.Struct(f"<3s4x3sQ{self.payload_size - 9}xBH").unpack_from
        self._magic, self._message = bytes(self.frame[:3]), bytes(self.frame[7:HEADER_V2])
        self.frame[4] = 255  # the sequence number before the first one
        self.time_us = 0
        """Time of the current message."""
        self.flags = VALID_FLAG
        """Flags of the current message."""
        self._crc_at = HEADER_V2 + self.payload_size
        self._checked = self.frame[1 : self._crc_at + 1]
        self._flags_at = self._crc_at - 1
        self.frame[self._flags_at] = VALID_FLAG

    def _doubles(self, offset: int, count: int) -> FloatArray:
        return np.frombuffer(self._buffer, "<f8", count, _ALIGNMENT + HEADER_V2 + offset)

    def seal(self, time_us: int, flags: int) -> memoryview:
        """Complete the frame around the payload in place; return its bytes, valid until the next call."""
        frame = self.frame
        self.time_us, self.flags = time_us, flags | VALID_FLAG
        frame[4] = (frame[4] + 1) & 255
        _TIME.pack_into(frame, HEADER_V2, time_us)
        frame[self._flags_at] = self.flags
        frame[self._crc_at] = self._extra  # the checksum covers one more byte, which is not sent
        _CRC.pack_into(frame, self._crc_at, _crc16(self._checked))
        return frame

    def open(self, data: bytes | bytearray | memoryview) -> bool:
        """Copy ``data`` if it is exactly one intact frame of this message; return False and change nothing if not.

        Signed and truncated frames are valid MAVLink too, and are left to the general codec.
        """
        if len(data) != self.size:
            return False
        magic, message, time_us, flags, crc = self._unpack(data)
        if magic != self._magic or message != self._message:
            return False
        if crc != _crc16(self._extra_byte, _crc16(data[1 : self._crc_at])):
            return False
        self.frame[:] = data
        self.time_us, self.flags = time_us, flags
        return True


class PlantStateFrame(_HotFrame):
    """FS_PLANT_STATE: ``state`` is the payload as array form of ``VehicleState``."""

    name = "FS_PLANT_STATE"

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        super().__init__(system_id, component_id)
        self.state = self._doubles(8, STATE_SIZE)
        offset = _ALIGNMENT + HEADER_V2 + 8 + 8 * STATE_SIZE
        self.rotor_speed_rad_s = np.frombuffer(self._buffer, "<f4", MAX_ROTORS, offset)

    def set_rotor_count(self, count: int) -> None:
        """Set the number of rotors."""
        self.frame[self._flags_at - 1] = count


class ActuatorsFrame(_HotFrame):
    """FS_ACTUATORS: ``rotor_speed_rad_s`` is the payload with the commands."""

    name = "FS_ACTUATORS"

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        super().__init__(system_id, component_id)
        self.rotor_speed_rad_s = self._doubles(8, MAX_ROTORS)

    @property
    def rotor_count(self) -> int:
        """Number of rotors."""
        return self.frame[self._flags_at - 1]

    def set_rotor_count(self, count: int) -> None:
        """Set the number of rotors."""
        self.frame[self._flags_at - 1] = count

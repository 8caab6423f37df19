"""The two messages of the lockstep exchange, encoded in place: no copy and no object per step.

Each keeps its frame in one buffer, laid out so that the doubles of the payload are aligned: the array handed
to the kernels *is* the payload. The bytes equal pymavlink's (a test holds them to it).
"""

from __future__ import annotations

import struct
import sys

import numpy as np
from fastcrc import crc16

from flightstack.core.contract import MAX_ROTORS, STATE_SIZE, FloatArray
from flightstack.mavlink.dialect import LAYOUT_BY_NAME
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER, HEADER_V2, MAGIC_V2

if sys.byteorder != "little":  # the payload is used in place
    raise ImportError("flightstack needs a little-endian machine")

_ALIGNMENT = 6  # the payload starts at 16 in the buffer
_TIME = struct.Struct("<Q")
_CRC = struct.Struct("<H")
_crc16 = crc16.mcrf4xx

VALID_FLAG = 1
GROUND_CONTACT_FLAG = 2  # FS_PLANT_STATE
ARMED_FLAG = 2  # FS_ACTUATORS
LOCKSTEP_FLAG = 4  # FS_ACTUATORS


class _HotFrame:
    """One message of fixed length. Its last byte, the flags, is never zero, so that nothing is truncated."""

    name = ""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        layout = LAYOUT_BY_NAME[self.name]
        self.payload_size = struct.calcsize(layout.format)
        self.size = HEADER_V2 + self.payload_size + CHECKSUM_SIZE
        self._extra = layout.crc_extra
        self._extra_byte = bytes([layout.crc_extra])
        self._buffer = bytearray(_ALIGNMENT + self.size)
        self.frame = memoryview(self._buffer)[_ALIGNMENT:]
        HEADER.pack_into(
            self.frame, 0, MAGIC_V2, self.payload_size, 0, 0, 0, system_id, component_id,
            layout.message_id & 0xFFFF, layout.message_id >> 16,
        )  # fmt: skip
        # what is the same in all frames of one message (see HEADER), time, flags, checksum
        self._unpack = struct.Struct(f"<3s4x3sQ{self.payload_size - 9}xBH").unpack_from
        self._magic, self._message = bytes(self.frame[:3]), bytes(self.frame[7:HEADER_V2])
        self._seq = 0
        self.time_us = 0
        """Time of the message held."""
        self.flags = VALID_FLAG
        """Flags of the message held."""
        self._crc_at = HEADER_V2 + self.payload_size
        self._checked = self.frame[1 : self._crc_at + 1]
        self._flags_at = self._crc_at - 1
        self.frame[self._flags_at] = VALID_FLAG

    def _doubles(self, offset: int, count: int) -> FloatArray:
        return np.frombuffer(self._buffer, "<f8", count, _ALIGNMENT + HEADER_V2 + offset)

    def seal(self, time_us: int, flags: int) -> memoryview:
        """Complete the frame around the payload in place and return its bytes, valid until the next call."""
        frame = self.frame
        self.time_us, self.flags = time_us, flags | VALID_FLAG
        frame[4] = self._seq
        self._seq = (self._seq + 1) & 255
        _TIME.pack_into(frame, HEADER_V2, time_us)
        frame[self._flags_at] = self.flags
        frame[self._crc_at] = self._extra  # the checksum covers one byte more, which is not sent
        _CRC.pack_into(frame, self._crc_at, _crc16(self._checked))
        return frame

    def open(self, data: bytes | bytearray | memoryview) -> bool:
        """Take over ``data`` if it is exactly one intact frame of this message; else leave all as it was.

        Signed or truncated frames are legal MAVLink too: those take the general codec's way.
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
    """FS_PLANT_STATE: ``state`` is the array form of ``VehicleState``, in the payload itself."""

    name = "FS_PLANT_STATE"

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        super().__init__(system_id, component_id)
        self.state = self._doubles(8, STATE_SIZE)
        offset = _ALIGNMENT + HEADER_V2 + 8 + 8 * STATE_SIZE
        self.rotor_speed_rad_s = np.frombuffer(self._buffer, "<f4", MAX_ROTORS, offset)

    def set_rotor_count(self, count: int) -> None:
        """Say how many rotors are in use."""
        self.frame[self._flags_at - 1] = count


class ActuatorsFrame(_HotFrame):
    """FS_ACTUATORS: ``rotor_speed_rad_s`` are the commands, in the payload itself."""

    name = "FS_ACTUATORS"

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        super().__init__(system_id, component_id)
        self.rotor_speed_rad_s = self._doubles(8, MAX_ROTORS)

    @property
    def rotor_count(self) -> int:
        """Rotors in use."""
        return self.frame[self._flags_at - 1]

    def set_rotor_count(self, count: int) -> None:
        """Say how many rotors are in use."""
        self.frame[self._flags_at - 1] = count

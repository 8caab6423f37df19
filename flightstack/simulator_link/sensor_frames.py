"""Fast codecs of the sensor messages that simulators send to PX4: HIL_SENSOR and HIL_GPS.

HIL_SENSOR goes out in every step and keeps its frame in one buffer, like the messages of ``hot_frames``. Units are
PX4's: m/s², rad/s, gauss, hPa, m, °C in body axes FRD; ``eph`` and ``epv`` of HIL_GPS are metres times 100.
Tests compare the bytes with pymavlink's.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

import numpy as np
from fastcrc import crc16

from flightstack.core.contract import SingleArray
from flightstack.core.portable_math import atan2, distance
from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import int16, int32, whole
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER, HEADER_V2, MAGIC_V2, checksum, pack_frame
from flightstack.mavlink.link import Message
from flightstack.simulator_link.frame_kernels import FIELDS_AT, Shape
from flightstack.simulator_link.gps_kernels import FixRow

HIL_SENSOR_ID: int = mavlink.MAVLINK_MSG_ID_HIL_SENSOR
HIL_GPS_ID: int = mavlink.MAVLINK_MSG_ID_HIL_GPS

ACCEL = mavlink.HIL_SENSOR_UPDATED_XACC | mavlink.HIL_SENSOR_UPDATED_YACC | mavlink.HIL_SENSOR_UPDATED_ZACC
GYRO = mavlink.HIL_SENSOR_UPDATED_XGYRO | mavlink.HIL_SENSOR_UPDATED_YGYRO | mavlink.HIL_SENSOR_UPDATED_ZGYRO
MAG = mavlink.HIL_SENSOR_UPDATED_XMAG | mavlink.HIL_SENSOR_UPDATED_YMAG | mavlink.HIL_SENSOR_UPDATED_ZMAG
BARO = (
    mavlink.HIL_SENSOR_UPDATED_ABS_PRESSURE
    | mavlink.HIL_SENSOR_UPDATED_PRESSURE_ALT
    | mavlink.HIL_SENSOR_UPDATED_TEMPERATURE
)
"""Bits of ``fields_updated`` that PX4 needs, all of a group, to take a sensor from the message."""

HIL_VALUES = np.dtype(
    [
        ("accel_m_s2", "<f4", 3),
        ("gyro_rad_s", "<f4", 3),
        ("mag_gauss", "<f4", 3),
        ("pressure_hpa", "<f4"),
        ("diff_pressure_hpa", "<f4"),
        ("altitude_m", "<f4"),
        ("temperature_c", "<f4"),
    ]
)
"""The measurements of HIL_SENSOR in the order of the message."""
VALUES = HIL_VALUES.itemsize // 4

_ALIGNMENT = 6  # puts the payload at offset 16 of the buffer
_PAYLOAD = struct.Struct("<Q13fIB")
_TIME, _FIELDS = struct.Struct("<Q"), struct.Struct("<IB")
assert _PAYLOAD.size - _FIELDS.size == FIELDS_AT
_CRC = struct.Struct("<H")
_HEAD = struct.Struct("<BBB4x3s")  # magic, size, incompatible flags, message
_SENSOR_EXTRA: int = mavlink.MAVLink_hil_sensor_message.crc_extra
SENSOR_SHAPE = Shape(_PAYLOAD.size, _SENSOR_EXTRA, *HIL_SENSOR_ID.to_bytes(3, "little"))
"""HIL_SENSOR for compiled code."""
_SENSOR_EXTRA_BYTE = bytes([_SENSOR_EXTRA])
_crc16 = crc16.mcrf4xx


class HilValues(NamedTuple):
    """The measurements of a HIL_SENSOR, in the order of the message."""

    accel_x_m_s2: float
    accel_y_m_s2: float
    accel_z_m_s2: float
    gyro_x_rad_s: float
    gyro_y_rad_s: float
    gyro_z_rad_s: float
    mag_x_gauss: float
    mag_y_gauss: float
    mag_z_gauss: float
    pressure_hpa: float
    diff_pressure_hpa: float
    altitude_m: float
    temperature_c: float

    @property
    def accel_m_s2(self) -> tuple[float, ...]:
        """Specific force along x, y, z."""
        return self[:3]

    @property
    def gyro_rad_s(self) -> tuple[float, ...]:
        """Rates about x, y, z."""
        return self[3:6]

    @property
    def mag_gauss(self) -> tuple[float, ...]:
        """Magnetic field along x, y, z."""
        return self[6:9]


class HilMeasurement(NamedTuple):
    """Content of HIL_SENSOR of the first inertial sensor, as in ``HilSensorFrame``."""

    values: SingleArray
    fields: int


class HilSensorFrame:
    """HIL_SENSOR; ``values`` are its 13 measurements in the order of the message."""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        self._buffer = bytearray(_ALIGNMENT + HEADER_V2 + _PAYLOAD.size + CHECKSUM_SIZE)
        self.frame = memoryview(self._buffer)[_ALIGNMENT:]
        """All bytes, those of a payload that is not truncated."""
        HEADER.pack_into(
            self.frame, 0, MAGIC_V2, _PAYLOAD.size, 0, 0, 0, system_id, component_id, HIL_SENSOR_ID, 0
        )
        self._message = bytes(self.frame[7:HEADER_V2])
        self._payload = self.frame[HEADER_V2 : HEADER_V2 + _PAYLOAD.size]
        self.values = np.frombuffer(self._buffer, "<f4", VALUES, _ALIGNMENT + HEADER_V2 + 8)
        """Measurements, float32, shape (13,)."""
        self.parts = self.values.view(HIL_VALUES)
        """The same as one record of ``HIL_VALUES``, shape (1,)."""
        self.time_us = 0
        self.fields = 0
        """Bits of ``fields_updated``."""
        self.number = 0
        """Number of the sensor, from 0."""
        self.frame[4] = 255  # the sequence number before the first one
        self._parts: dict[int, tuple[memoryview, memoryview]] = {}  # checked part and frame, by their end

    def seal(self, time_us: int, fields: int, number: int) -> memoryview:
        """Complete the frame around the values; return its bytes without trailing zeros, valid until the next call."""
        frame = self.frame
        self.time_us, self.fields, self.number = time_us, fields, number
        frame[4] = (frame[4] + 1) & 255
        _TIME.pack_into(frame, HEADER_V2, time_us)
        _FIELDS.pack_into(frame, HEADER_V2 + FIELDS_AT, fields, number)
        if not fields | number:  # the last values may be zero, and must not be overwritten by the checksum
            payload = bytes(frame[HEADER_V2 : HEADER_V2 + FIELDS_AT]).rstrip(b"\x00") or b"\x00"
            return memoryview(pack_frame(HIL_SENSOR_ID, payload, _SENSOR_EXTRA, *frame[4:7]))
        size = _PAYLOAD.size if number else FIELDS_AT + ((fields.bit_length() + 7) >> 3)
        end = HEADER_V2 + size
        frame[1] = size
        frame[end] = _SENSOR_EXTRA  # the checksum covers one more byte, which is not sent
        if end not in self._parts:
            self._parts[end] = frame[1 : end + 1], frame[: end + CHECKSUM_SIZE]
        checked, sealed = self._parts[end]
        _CRC.pack_into(frame, end, _crc16(checked))
        return sealed

    def open(self, data: bytes | bytearray | memoryview) -> bool:
        """Copy ``data`` if it is exactly one intact, unsigned HIL_SENSOR of MAVLink 2; else change nothing."""
        end = len(data) - CHECKSUM_SIZE
        size = end - HEADER_V2
        if not 0 < size <= _PAYLOAD.size or _HEAD.unpack_from(data) != (MAGIC_V2, size, 0, self._message):
            return False
        if _CRC.unpack_from(data, end)[0] != _crc16(_SENSOR_EXTRA_BYTE, _crc16(data[1:end])):
            return False
        payload = self._payload
        payload[:size] = data[HEADER_V2:end]
        if size < _PAYLOAD.size:
            payload[size:] = bytes(_PAYLOAD.size - size)
        (self.time_us,) = _TIME.unpack_from(payload)
        self.fields, self.number = _FIELDS.unpack_from(payload, FIELDS_AT)
        return True

    def set(self, time_us: int, measurement: HilMeasurement) -> None:
        """Copy the content of a frame that was not sealed."""
        self.values[:] = measurement.values
        self.time_us, self.fields, self.number = time_us, measurement.fields, 0

    def take(self, message: Message) -> None:
        """Copy a message of the general decoder: its frame may be signed, or of MAVLink 1."""
        self.values[:] = (
            message.xacc, message.yacc, message.zacc, message.xgyro, message.ygyro, message.zgyro,
            message.xmag, message.ymag, message.zmag,
            message.abs_pressure, message.diff_pressure, message.pressure_alt, message.temperature,
        )  # fmt: skip
        self.time_us, self.fields, self.number = message.time_usec, message.fields_updated, message.id


class HilGps(NamedTuple):
    """HIL_GPS in SI units and degrees. A speed or an accuracy that is not known is NaN."""

    time_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    eph_m: float
    epv_m: float
    velocity_ned_m_s: tuple[float, float, float]
    fix_type: int
    satellites: int
    number: int = 0


_GPS = struct.Struct("<QiiiHHHhhhHBBBH")
_GPS_EXTRA: int = mavlink.MAVLink_hil_gps_message.crc_extra
_GPS_MESSAGE = HIL_GPS_ID.to_bytes(3, "little")
GPS_SHAPE = Shape(_GPS.size, _GPS_EXTRA, *_GPS_MESSAGE)
"""HIL_GPS for compiled code."""
UNKNOWN = 0xFFFF


def gps_message(time_us: int, fix: FixRow) -> HilGps:
    """Return the message with a fix of the first receiver."""
    velocity_ned_m_s = fix.north_m_s, fix.east_m_s, fix.down_m_s
    return HilGps(time_us, *fix[:5], velocity_ned_m_s, int(fix.fix_type), int(fix.satellites))


def encode_gps(gps: HilGps, seq: int, system_id: int, component_id: int) -> bytes:
    """Return the frame of a fix; values beyond the fields are limited."""
    north, east, down = gps.velocity_ned_m_s
    course_deg = math.degrees(atan2(east, north)) % 360.0
    payload = (
        _GPS.pack(
            gps.time_us,
            int32(gps.latitude_deg * 1e7),
            int32(gps.longitude_deg * 1e7),
            int32(gps.altitude_m * 1e3),
            whole(gps.eph_m * 100.0, 0, UNKNOWN - 1),
            whole(gps.epv_m * 100.0, 0, UNKNOWN - 1),
            whole(distance(north, east) * 100.0, 0, UNKNOWN - 1),
            int16(north * 100.0),
            int16(east * 100.0),
            int16(down * 100.0),
            whole(course_deg * 100.0, 0, UNKNOWN - 1) % 36000,
            gps.fix_type,
            gps.satellites,
            gps.number,
            0,  # yaw is not available
        ).rstrip(b"\x00")
        or b"\x00"
    )
    return pack_frame(HIL_GPS_ID, payload, _GPS_EXTRA, seq, system_id, component_id)


def gps_buffer(system_id: int, component_id: int) -> bytearray:
    """Return a frame of HIL_GPS for compiled code, with the sequence number before the first one."""
    return bytearray(pack_frame(HIL_GPS_ID, bytes(_GPS.size), _GPS_EXTRA, 255, system_id, component_id))


def decode_gps(frame: bytes | memoryview) -> HilGps | None:
    """Return the fix in ``frame`` if it is exactly one intact, unsigned HIL_GPS of MAVLink 2, else None."""
    data = bytes(frame)
    end = len(data) - CHECKSUM_SIZE
    size = end - HEADER_V2
    if not 0 < size <= _GPS.size or data[0] != MAGIC_V2 or data[1] != size or data[2]:
        return None
    if data[7:HEADER_V2] != _GPS_MESSAGE or checksum(data[1:end], _GPS_EXTRA) != data[end:]:
        return None
    values = _GPS.unpack(data[HEADER_V2:end].ljust(_GPS.size, b"\x00"))
    return _gps(*values)


def gps_of(message: Message) -> HilGps:
    """Return the fix in a message of the general decoder."""
    m = message
    return _gps(
        m.time_usec, m.lat, m.lon, m.alt, m.eph, m.epv, m.vel, m.vn, m.ve, m.vd, m.cog,
        m.fix_type, m.satellites_visible, m.id, m.yaw,
    )  # fmt: skip


def _gps(
    time_us: int, lat: int, lon: int, alt: int, eph: int, epv: int, _vel: int, vn: int, ve: int, vd: int,
    _cog: int, fix_type: int, satellites: int, number: int, _yaw: int,
) -> HilGps:  # fmt: skip
    return HilGps(
        time_us,
        lat * 1e-7,
        lon * 1e-7,
        alt * 1e-3,
        _accuracy(eph),
        _accuracy(epv),
        (vn * 0.01, ve * 0.01, vd * 0.01),
        fix_type,
        satellites,
        number,
    )


def _accuracy(centimetres: int) -> float:
    return math.nan if centimetres == UNKNOWN else centimetres * 0.01

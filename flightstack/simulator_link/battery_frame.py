"""Fast codec of BATTERY_STATUS on the simulator link, sent twice per simulated second in the lockstep exchange.

pymavlink takes 15 µs to encode and decode one. Compiled code has ``battery_kernels``. A test checks that the bytes
equal pymavlink's.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.frames import CHECKSUM_SIZE, HEADER_V2, MAGIC_V2, checksum, pack_frame
from flightstack.mavlink.link import Message
from flightstack.simulator_link.battery_kernels import BATTERY_SIZE, EXTRA_PLACES, PLACES
from flightstack.simulator_link.frame_kernels import Shape

UNKNOWN_TEMPERATURE = 0x7FFF

_KIND = mavlink.MAVLink_battery_status_message
_WIRE = struct.Struct("<iih10HhBBBbiB4HBI")
_ID = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS.to_bytes(3, "little")
_TAIL = (0, mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED)  # time remaining
_MODE = (mavlink.MAV_BATTERY_MODE_UNKNOWN, 0)  # faults
assert _WIRE.size == BATTERY_SIZE
BATTERY_SHAPE = Shape(BATTERY_SIZE, _KIND.crc_extra, *_ID)
"""BATTERY_STATUS for compiled code."""


class BatteryReport(NamedTuple):
    """Fields of BATTERY_STATUS used on the simulator link, in MAVLink's units."""

    number: int  # battery id, 0 for the first
    cells_mv: tuple[int, ...]  # 10 entries of voltages, then 4 of voltages_ext
    current_ca: int  # 10 mA; -1 unknown
    consumed_mah: int
    energy_hj: int  # 100 J
    remaining_percent: int  # -1 unknown


_NO_REPORT = BatteryReport(0, (0,) * (PLACES + EXTRA_PLACES), 0, 0, 0, 0)


def encode_battery(report: BatteryReport, seq: int, system_id: int, component_id: int) -> bytes:
    """Return the frame of a lithium polymer battery for all consumers; values must be in range."""
    return _frame(_payload(report).rstrip(b"\x00"), seq, system_id, component_id)


def battery_buffer(system_id: int, component_id: int) -> bytearray:
    """Return a frame for compiled code, with the sequence number before the first one."""
    return bytearray(_frame(_payload(_NO_REPORT), 255, system_id, component_id))


def _payload(report: BatteryReport) -> bytes:
    cells = report.cells_mv
    return _WIRE.pack(
        report.consumed_mah, report.energy_hj, UNKNOWN_TEMPERATURE, *cells[:PLACES], report.current_ca,
        report.number, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO,
        report.remaining_percent, *_TAIL, *cells[PLACES:], *_MODE,
    )  # fmt: skip


def _frame(payload: bytes, seq: int, system_id: int, component_id: int) -> bytes:
    return pack_frame(
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, payload, _KIND.crc_extra, seq, system_id, component_id
    )


def decode_battery(frame: bytes | memoryview) -> BatteryReport | None:
    """Return the report in ``frame`` if it is exactly one intact, unsigned MAVLink 2 BATTERY_STATUS, else None."""
    data = bytes(frame)
    end = len(data) - CHECKSUM_SIZE
    if end <= HEADER_V2 or data[0] != MAGIC_V2 or data[1] != end - HEADER_V2 or data[2] or data[7:10] != _ID:
        return None
    if checksum(data[1:end], _KIND.crc_extra) != data[end:]:
        return None
    return report_in(data[HEADER_V2:end])


def report_in(payload: bytes) -> BatteryReport:
    """Return the report in a payload, with or without the zeros at its end."""
    values = _WIRE.unpack(payload.ljust(_WIRE.size, b"\x00")[: _WIRE.size])
    consumed, energy = values[:2]
    current, number, _function, _type, remaining = values[13:18]
    return BatteryReport(number, values[3:13] + values[20:24], current, consumed, energy, remaining)


def report_of(message: Message) -> BatteryReport:
    """Return the report in a message of the general decoder."""
    return BatteryReport(
        message.id,
        (*message.voltages, *message.voltages_ext),
        message.current_battery,
        message.current_consumed,
        message.energy_consumed,
        message.battery_remaining,
    )

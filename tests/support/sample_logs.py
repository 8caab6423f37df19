"""Small logs of a vehicle: a synthetic flight as ULog, and a telemetry log of a few seconds."""

from __future__ import annotations

import math

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Link
from gcs_cli.link.tlog import encode_record
from tests.support.synthetic_flight import synthetic_flight_bytes

EPOCH_US = 1_700_000_000_000_000
SECONDS = 4


def small_ulog() -> bytes:
    """Return a synthetic flight with few samples."""
    return synthetic_flight_bytes(inner_ms=50, outer_ms=100)


def small_tlog(autopilot: int = mavlink.MAV_AUTOPILOT_PX4) -> bytes:
    """Return 4 s of a vehicle at 10 Hz, with a ground station's heartbeats."""
    vehicle, station = Link(7, 1), Link(255, 190)
    records: list[bytes] = []

    def add(link: Link, time_us: int, message: object) -> None:
        records.append(encode_record(EPOCH_US + time_us, link.encode(message)))

    quad, mode = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    for tick in range(10 * SECONDS):
        time_us, time_ms = 100_000 * tick, 100 * tick
        if tick % 10 == 0:
            beat = mavlink.MAVLink_heartbeat_message(quad, autopilot, mode, 4 << 16 | 3 << 24, 3, 3)
            add(vehicle, time_us, beat)
            gcs = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
            add(station, time_us + 4, mavlink.MAVLink_heartbeat_message(*gcs, 0, 0, 4, 3))
        roll = 0.1 * math.sin(0.3 * tick)
        add(vehicle, time_us + 8, mavlink.MAVLink_attitude_message(time_ms, roll, 0.0, 1.0, 0.0, 0.0, 0.0))
        add(
            vehicle,
            time_us + 12,
            mavlink.MAVLink_local_position_ned_message(time_ms, 0.1 * tick, 0.0, -1.0, 1.0, 0.0, 0.0),
        )
        add(
            vehicle,
            time_us + 16,
            mavlink.MAVLink_global_position_int_message(
                time_ms, 473977420 + 9 * tick, 85455940, 489_000, 1000, 100, 0, 0, 5700
            ),
        )
    add(vehicle, 1_000_004, mavlink.MAVLink_statustext_message(4, b"Low battery"))
    value = mavlink.MAVLink_param_value_message(b"MPC_XY_CRUISE", 5.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)
    add(vehicle, 1_000_008, value)
    return b"".join(records)

"""What the ground station heard of a flight and its log does not hold: loop timing in lockstep, and the battery."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.mavlink.dialect import FS_LOOP_TIMING_ID
from flightstack.mavlink.link import Message
from gcs_cli.link.tlog import read_messages
from gcs_cli.report.flight_data import LoopTiming, Series, empty_series, loop_timing, series

_SYS_STATUS, _LOCAL_POSITION_NED = 1, 32
_MESSAGES = frozenset({_SYS_STATUS, _LOCAL_POSITION_NED, FS_LOOP_TIMING_ID})
_UNKNOWN_MV = 65535


class Telemetry(NamedTuple):
    """Loop timing, and the battery's remaining charge [%] and voltage [V]; NaN where unknown."""

    loop_timing: list[LoopTiming]
    battery: Series


def read_telemetry(tlog: Path, start_s: float = 0.0) -> Telemetry:
    """Return what a telemetry log holds; nothing if there is no such file. ``start_s``: start of the flight log.

    The first vehicle counts, until it reboots. SYS_STATUS carries no time: it has that of the last LOCAL_POSITION_NED.
    """
    timings: list[LoopTiming] = []
    battery: list[tuple[float, float, float]] = []
    time_s, vehicle = math.nan, None
    for record, message in read_messages(tlog, _MESSAGES) if tlog.exists() else ():
        source = (message.get_srcSystem(), message.get_srcComponent())
        if source != (vehicle or source):
            continue
        vehicle = source
        if record.message_id == _LOCAL_POSITION_NED:
            before_s, time_s = time_s, message.time_boot_ms * 1e-3 - start_s
            if time_s < before_s:  # a reboot: its flights have logs of their own
                break
        elif record.message_id == FS_LOOP_TIMING_ID:
            timings.append(_timing(message, start_s))
        elif math.isfinite(time_s):
            battery.append((time_s, *_battery(message)))
    table = np.array(battery).reshape(-1, 3)
    known = np.isfinite(table[:, 1:]).any()
    return Telemetry(timings, series(table[:, 0].copy(), table[:, 1:].copy()) if known else empty_series(2))


def _battery(message: Message) -> tuple[float, float]:
    remaining = float(message.battery_remaining) if 0 <= message.battery_remaining <= 100 else math.nan
    known = 0 < message.voltage_battery < _UNKNOWN_MV
    return remaining, message.voltage_battery * 1e-3 if known else math.nan


def _timing(message: Message, start_s: float) -> LoopTiming:
    return loop_timing(
        message.time_us * 1e-6 - start_s,
        message.inner_hz,
        (
            message.execution_mean_us,
            message.execution_p99_us,
            message.execution_max_us,
            message.lateness_mean_us,
            message.lateness_p99_us,
            message.lateness_max_us,
        ),
        message.clock,
    )

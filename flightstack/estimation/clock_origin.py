"""The origin of the filter's clock, which moves: single precision has no milliseconds after some hours.

A filter in single precision counts its time from an origin that moves every few minutes. ``move_clock_kernel`` makes
all times in the memory count from the new one, and ``ClockOrigin`` tells when. In double the origin stays.
"""

from __future__ import annotations

import math

from flightstack.core.compiled import compiled
from flightstack.estimation.kalman import OBSERVATIONS, Filter
from flightstack.estimation.memory import MemoryArray, MemoryRecord, filter_of, rings_of
from flightstack.estimation.rings import (
    BARO_ROWS,
    GNSS_ROWS,
    IMU_ROWS,
    MAG_ROWS,
    RANGE_ROWS,
    RINGS,
    Rings,
)
from flightstack.estimation.source_checks import ChecksRecord

SPAN_S = 512.0
"""The clock shows one to two spans, where single precision has steps of 61 µs. A power of 2: times stay exact."""
_EARLIEST_S = 1e-3
"""Of a time that is older than the origin; zero stands for never."""


class ClockOrigin:
    """The origin of a filter's clock [s]."""

    def __init__(self) -> None:
        self.at_s = 0.0

    def move(self, time_s: float) -> float:
        """Return by how much the origin moves before a sample at ``time_s`` [s], mostly 0, and move it."""
        spans = math.floor((time_s - self.at_s) / SPAN_S)
        if spans < 2:
            return 0.0
        by_s = SPAN_S * (spans - 1)
        self.at_s += by_s
        return by_s


@compiled
def _moved(time_s: float, by_s: float) -> float:
    """Return a time, from the new origin; zero stays."""
    if time_s == 0.0:
        return 0.0
    return max(time_s - by_s, _EARLIEST_S)


@compiled
def _move_rings(r: Rings, by_s: float) -> None:
    """Move the measurements that wait."""
    for i in range(GNSS_ROWS):
        r.gnss[i, 0] = _moved(r.gnss[i, 0], by_s)
    for i in range(MAG_ROWS):
        r.mag[i, 0] = _moved(r.mag[i, 0], by_s)
    for i in range(BARO_ROWS):
        r.baro[i, 0] = _moved(r.baro[i, 0], by_s)
    for i in range(RANGE_ROWS):
        r.range[i, 0] = _moved(r.range[i, 0], by_s)
    for i in range(IMU_ROWS):
        r.imu[i]["time_s"] = _moved(r.imu[i]["time_s"], by_s)
        r.track[i, 0] = _moved(r.track[i, 0], by_s)


@compiled
def _move_checks(c: ChecksRecord, by_s: float) -> None:
    """Move what the checks of the sensors remember."""
    c["accel_until_s"] = _moved(c["accel_until_s"], by_s)
    c["baro_until_s"] = _moved(c["baro_until_s"], by_s)
    c["equal_since_s"] = _moved(c["equal_since_s"], by_s)
    c["gnss_s"] = _moved(c["gnss_s"], by_s)
    c["gyro_s"] = _moved(c["gyro_s"], by_s)
    c["field_s"] = _moved(c["field_s"], by_s)
    c["altitude_s"] = _moved(c["altitude_s"], by_s)
    for i in range(2):
        onset_s = c["onset_s"][i]
        at_s = _moved(abs(onset_s), by_s)
        c["onset_s"][i] = -at_s if onset_s < 0.0 else at_s


@compiled
def _move_fusions(m: MemoryRecord, f: Filter, by_s: float) -> None:
    """Move the times of the filter and of its fusions."""
    f.clock[0] = _moved(f.clock[0], by_s)
    for i in range(OBSERVATIONS):
        f.observations[i]["fused_s"] = _moved(f.observations[i]["fused_s"], by_s)
    m["last_gnss_s"] = _moved(m["last_gnss_s"], by_s)
    m["hold"]["fused_s"] = _moved(m["hold"]["fused_s"], by_s)
    m["rest_s"], m["drag_s"] = _moved(m["rest_s"], by_s), _moved(m["drag_s"], by_s)
    m["yaw_fix"]["wrong_s"] = _moved(m["yaw_fix"]["wrong_s"], by_s)
    m["resets"]["position"]["time_s"] = _moved(m["resets"]["position"]["time_s"], by_s)
    m["resets"]["velocity"]["time_s"] = _moved(m["resets"]["velocity"]["time_s"], by_s)


@compiled
def move_clock_kernel(memory: MemoryArray, by_s: float) -> None:
    """Let all times in the memory count from an origin that is ``by_s`` later; samples from now on do so too."""
    m = memory[0]
    m["output"][0] = _moved(m["output"][0], by_s)
    m["pending"][0] = _moved(m["pending"][0], by_s)
    m["last_imu_s"] = _moved(m["last_imu_s"], by_s)
    for i in range(RINGS):
        mean = m["means"][i]
        mean["pushed_s"], mean["last_s"] = _moved(mean["pushed_s"], by_s), _moved(mean["last_s"], by_s)
        mean["first"][0] = _moved(mean["first"][0], by_s)
    _move_fusions(m, filter_of(m), by_s)
    _move_checks(m["checks"], by_s)
    _move_rings(rings_of(m), by_s)

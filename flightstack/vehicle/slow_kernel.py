"""New samples of magnetometer and barometer, and the log of the truth, in quiet ticks, as compiled code.

It calls the kernel that the estimator runs in any other tick, on the same arrays and in the same order.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.kernel_calls import call_kernel
from flightstack.core.record_types import dtype_of
from flightstack.estimation.rings import BARO_RING, MAG_RING
from flightstack.flight_log.sensor_rows import store_baro, store_mag, store_truth


class SlowMarks(NamedTuple):
    """What the kernel notes."""

    mag_us: int
    """Time of the newest sample, or 0; the next one too."""
    baro_us: int
    mag_rows: int
    """New rows of the log; the next two too."""
    baro_rows: int
    truth_rows: int
    truth_us: int
    """Time from which the log of the truth takes a row."""


SLOW_MARKS = dtype_of(SlowMarks)


@compiled
def _push(push: int, filters: Any, ring: int, values: FloatArray, row: FloatArray) -> None:
    """Give each filter the measurement ``values``; a filter may change its copy ``row``."""
    for k in range(len(filters)):
        for i in range(len(values)):
            row[i] = values[i]
        call_kernel(push, (filters[k], ring, row))


@compiled
def take_slow(push: int, slow: Any, time_us: int, filters: Any, following: Any) -> None:
    """Give new measurements at ``time_us``, the vehicle's time, to the filters and the log.

    Those that are not finite are none. ``push`` is the address of the kernel. ``following`` has delays and logs.
    """
    marks_array, news_array, parts, rows, _truth = slow
    marks, news, values = marks_array[0], news_array[0], parts[0]
    delays_s, mag_log, baro_log, _truth_log = following
    mag_sample, mag_copy, baro_sample, baro_copy = rows
    mag_delay_s, baro_delay_s = delays_s
    if news["has_mag"] != 0:
        field = values["mag_gauss"]
        x, y, z = float(field[0]), float(field[1]), float(field[2])
        if math.isfinite(x + y + z):
            mag_sample[0] = time_us * 1e-6 - mag_delay_s
            mag_sample[1], mag_sample[2], mag_sample[3] = x, y, z
            _push(push, filters, MAG_RING, mag_sample, mag_copy)
            store_mag(_log_row(mag_log, marks["mag_rows"], time_us), time_us, x, y, z)
            marks["mag_rows"] += 1
            marks["mag_us"] = time_us
    if news["has_baro"] != 0:
        altitude_m = float(values["altitude_m"])
        if math.isfinite(altitude_m):
            baro_sample[0], baro_sample[1] = time_us * 1e-6 - baro_delay_s, altitude_m
            _push(push, filters, BARO_RING, baro_sample, baro_copy)
            row = _log_row(baro_log, marks["baro_rows"], time_us)
            marks["baro_rows"] += 1
            pressure_hpa, temperature_c = float(values["pressure_hpa"]), float(values["temperature_c"])
            store_baro(row, time_us, pressure_hpa, altitude_m, temperature_c)
            marks["baro_us"] = time_us


@compiled
def _log_row(log: Any, count: int, time_us: int) -> Any:
    """Return the row of a log behind ``count`` new ones."""
    rows, times_us, begin = log
    at = begin + count
    times_us[at] = time_us
    return rows[at]


@compiled
def log_truth(slow: Any, time_us: int, following: Any) -> None:
    """Record the true state if it is due."""
    marks = slow[0][0]
    if time_us < marks["truth_us"]:
        return
    state, offset_m, interval_us = slow[4]
    marks["truth_us"] = (time_us // interval_us + 1) * interval_us
    store_truth(_log_row(following[3], marks["truth_rows"], time_us), state, offset_m)
    marks["truth_rows"] += 1

"""Magnetometer, barometer and the log of the truth in quiet ticks, each at a rate of its own, as compiled code.

It calls the kernels that simulator and estimator run in any other tick, on the same arrays and in the same order.
"""

from __future__ import annotations

import math
from typing import Any

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.kernel_calls import call_kernel, call_kernel_float
from flightstack.core.periods import take_due
from flightstack.flight_log.sensor_rows import store_baro, store_mag, store_truth

MEASURE_MAG, MEASURE_BARO, AIRSPEED, PUSH, SLOW_CALLS = range(5)
"""Kernels by their index in ``calls``."""
MAG, BARO = 0, 1
"""Sensors by the index of their times, cursors and new rows."""
MAG_US, BARO_US, IS_MAG_NEW, IS_BARO_NEW, MAG_ROWS, BARO_ROWS, TRUTH_ROWS, TRUTH_US, SLOW_MARKS = range(9)
"""Marks: times of the newest samples, or 0; 1 if the last tick measured; new rows of the logs; time from which the log
of the truth takes a row."""
_ALTITUDE, _TEMPERATURE = 2, 3
"""Values of the barometer in HIL_SENSOR; the first one is the pressure."""


@compiled
def _next_row(noise: FloatArray, cursor: Any) -> Any:
    """Return the next row of a stream of deviates."""
    at = cursor[0]
    cursor[0] = at + 1
    return noise[at]


@compiled
def measure_slow(
    calls: Any, slow: Any, time_us: int, memory: Any, state: FloatArray, rotor_speeds: Any
) -> None:
    """Measure with magnetometer and barometer if they are due at ``time_us``, the simulator's time.

    ``memory`` has the bytes of the plant.
    """
    due_us, period_us, marks, mag, baro, _row, _truth = slow
    marks[IS_MAG_NEW], marks[IS_BARO_NEW] = 0, 0
    if take_due(due_us, period_us, MAG, time_us):
        mags, out, noise, cursor, values, current_a = mag
        call_kernel(calls[MEASURE_MAG], (mags, state, current_a[0], _next_row(noise, cursor)))
        for i in range(3):
            values[i] = out[i]
        marks[IS_MAG_NEW] = 1
    if take_due(due_us, period_us, BARO, time_us):
        baros, out, noise, cursor, values = baro
        airspeed_m_s = call_kernel_float(calls[AIRSPEED], (memory,))
        call_kernel(
            calls[MEASURE_BARO], (baros, time_us, state, airspeed_m_s, rotor_speeds, _next_row(noise, cursor))
        )
        values[0], values[_ALTITUDE], values[_TEMPERATURE] = out[0], out[1], out[2]
        marks[IS_BARO_NEW] = 1


@compiled
def _push(calls: Any, filters: Any, ring: int, values: FloatArray, row: FloatArray) -> None:
    """Give each filter the measurement ``values``; a filter may change its copy ``row``."""
    for k in range(len(filters)):
        for i in range(len(values)):
            row[i] = values[i]
        call_kernel(calls[PUSH], (filters[k], ring, row))


@compiled
def take_slow(calls: Any, slow: Any, time_us: int, filters: Any, following: Any) -> None:
    """Give new measurements at ``time_us``, the vehicle's time, to the filters and the log.

    Those that are not finite are none. ``following`` has rings, delays and logs, and the simulator's time at the start
    of the vehicle's.
    """
    _due_us, _period_us, marks, mag, baro, rows, _truth = slow
    rings, delay_s, mag_log, baro_log, _truth_log, _boot_us = following
    mag_sample, mag_copy, baro_sample, baro_copy = rows
    if marks[IS_MAG_NEW] != 0:
        x, y, z = float(mag[4][0]), float(mag[4][1]), float(mag[4][2])
        if math.isfinite(x + y + z):
            mag_sample[0] = time_us * 1e-6 - delay_s[MAG]
            mag_sample[1], mag_sample[2], mag_sample[3] = x, y, z
            _push(calls, filters, rings[MAG], mag_sample, mag_copy)
            store_mag(_log_row(mag_log, marks, MAG_ROWS, time_us), time_us, x, y, z)
            marks[MAG_US] = time_us
    if marks[IS_BARO_NEW] != 0:
        altitude_m = float(baro[4][_ALTITUDE])
        if math.isfinite(altitude_m):
            baro_sample[0], baro_sample[1] = time_us * 1e-6 - delay_s[BARO], altitude_m
            _push(calls, filters, rings[BARO], baro_sample, baro_copy)
            row = _log_row(baro_log, marks, BARO_ROWS, time_us)
            store_baro(row, time_us, float(baro[4][0]), altitude_m, float(baro[4][_TEMPERATURE]))
            marks[BARO_US] = time_us


@compiled
def _log_row(log: Any, marks: Any, counter: int, time_us: int) -> Any:
    """Return the next row of a log."""
    rows, times_us, begin = log
    at = begin + marks[counter]
    times_us[at] = time_us
    marks[counter] += 1
    return rows[at]


@compiled
def log_truth(slow: Any, time_us: int, following: Any) -> None:
    """Record the true state if it is due."""
    marks = slow[2]
    if time_us < marks[TRUTH_US]:
        return
    state, offset_m, interval_us = slow[6]
    marks[TRUTH_US] = (time_us // interval_us + 1) * interval_us
    store_truth(_log_row(following[4], marks, TRUTH_ROWS, time_us), state, offset_m)

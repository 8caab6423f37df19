"""Sensors besides the inertial ones, health and log of the estimate, and the log of the truth in quiet ticks, compiled.

It calls the kernels that the estimator runs in any other tick, on the same arrays and in the same order.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import copy_all
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, relative
from flightstack.core.kernels.calls import call_kernel, call_kernel_int
from flightstack.core.record_types import dtype_of
from flightstack.estimation.rings import BARO_RING, GNSS_RING, MAG_RING
from flightstack.estimation.sensor_samples import GnssFix
from flightstack.flight_log.sensor_rows import (
    ESTIMATOR_INTERVAL_US,
    GLOBAL_INTERVAL_US,
    INVALID_INTERVAL_US,
    TRUTH_INTERVAL_US,
    store_baro,
    store_global,
    store_gnss,
    store_mag,
    store_truth,
)
from flightstack.simulator_link.gps_kernels import FIX_SIZE, FixRow, read_gps

_FIX_3D = float(GnssFix.FIX_3D)


class SlowMarks(NamedTuple):
    """What the kernel notes."""

    mag_us: int
    """Time of the newest sample, or 0; the next two too."""
    baro_us: int
    gnss_us: int
    field_gauss: Annotated[FloatArray, 3]
    """Magnetic field of that sample, FRD."""
    pressure_hpa: float
    """Of that sample, as pressure altitude and temperature."""
    altitude_m: float
    temperature_c: float
    fix: Annotated[FloatArray, FIX_SIZE]
    """The newest one, ``FixRow``, also if it came before; NaN without one."""
    mag_rows: int
    """New rows of the log; the next six too."""
    baro_rows: int
    gnss_rows: int
    truth_rows: int
    global_rows: int
    estimator_rows: int
    wind_rows: int
    health_us: int
    """Time from which the health of the estimate is updated."""
    conditions: int
    """Those of the newest health."""


SLOW_MARKS = dtype_of(SlowMarks)


@compiled
def _push(push: int, filters: Any, ring: int, values: FloatArray, row: FloatArray) -> None:
    """Give each filter the measurement ``values``; a filter may change its copy ``row``."""
    for k in range(len(filters)):
        for i in range(len(values)):
            row[i] = values[i]
        call_kernel(push, (filters[k], ring, row))


@compiled
def _is_repeated(new: FloatArray, last: FloatArray) -> bool:
    """Return True for an old measurement: see ``Estimator.gnss``."""
    velocity = new[5:8]
    if velocity[0] == 0.0 and velocity[1] == 0.0 and velocity[2] == 0.0:
        return False
    place_is_old = new[0] == last[0] and new[1] == last[1] and new[2] == last[2]
    return bool(place_is_old and velocity[0] == last[5] and velocity[1] == last[6] and velocity[2] == last[7])


@compiled
def take_fix(push: int, slow: Any, time_us: int, filters: Any, following: Any) -> None:
    """Give a new fix at ``time_us`` to the filters and the log; as in Python, before the inertial measurement."""
    marks, news = slow[0][0], slow[1][0]
    if news["has_gnss"] == 0:
        return
    payload, place, new, sample, copy = slow[6]
    delay_s, log = following[0][2], following[1][2]
    read_gps(payload, new)
    fix = FixRow(*as_tuple(new, FIX_SIZE))
    if fix.fix_type >= _FIX_3D and not _is_repeated(new, marks["fix"]):
        point = GeoPoint(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        origin, scales = GeoPoint(place[0], place[1], place[2]), (place[3], place[4])
        position = relative(origin, scales, point)
        store(sample, (
            time_us * 1e-6 - delay_s, position.x, position.y, position.z,
            fix.north_m_s, fix.east_m_s, fix.down_m_s, fix.eph_m, fix.epv_m, math.nan,
        ))  # fmt: skip
        _push(push, filters, GNSS_RING, sample, copy)
    copy_all(new, marks["fix"])
    marks["gnss_us"] = time_us
    store_gnss(log[0][_new_row(log, marks["gnss_rows"], time_us)], time_us, fix, math.nan)
    marks["gnss_rows"] += 1


@compiled
def take_slow(push: int, slow: Any, time_us: int, filters: Any, following: Any) -> None:
    """Give new measurements at ``time_us``, the vehicle's time, to the filters and the log.

    Those that are not finite are none. ``push`` is the address of the kernel. ``following`` has delays, logs, and what
    the health is given.
    """
    marks, news, values, rows = slow[0][0], slow[1][0], slow[2][0], slow[3]
    delays_s, logs, _conditions = following
    mag_log, baro_log = logs[0], logs[1]
    mag_sample, mag_copy, baro_sample, baro_copy = rows
    mag_delay_s, baro_delay_s, _gnss_delay_s = delays_s
    if news["has_mag"] != 0:
        field = values["mag_gauss"]
        x, y, z = float(field[0]), float(field[1]), float(field[2])
        if math.isfinite(x + y + z):
            mag_sample[0] = time_us * 1e-6 - mag_delay_s
            mag_sample[1], mag_sample[2], mag_sample[3] = x, y, z
            _push(push, filters, MAG_RING, mag_sample, mag_copy)
            store_mag(mag_log[0][_new_row(mag_log, marks["mag_rows"], time_us)], time_us, x, y, z)
            marks["mag_rows"] += 1
            marks["mag_us"] = time_us
            marks["field_gauss"][0], marks["field_gauss"][1], marks["field_gauss"][2] = x, y, z
    if news["has_baro"] != 0:
        altitude_m = float(values["altitude_m"])
        if math.isfinite(altitude_m):
            baro_sample[0], baro_sample[1] = time_us * 1e-6 - baro_delay_s, altitude_m
            _push(push, filters, BARO_RING, baro_sample, baro_copy)
            row = baro_log[0][_new_row(baro_log, marks["baro_rows"], time_us)]
            marks["baro_rows"] += 1
            pressure_hpa, temperature_c = float(values["pressure_hpa"]), float(values["temperature_c"])
            store_baro(row, time_us, pressure_hpa, altitude_m, temperature_c)
            marks["baro_us"], marks["pressure_hpa"] = time_us, pressure_hpa
            marks["altitude_m"], marks["temperature_c"] = altitude_m, temperature_c


@compiled
def _new_row(log: Any, count: int, time_us: int) -> int:
    """Give the row of a log behind ``count`` new ones its time, and return its index."""
    _rows, times_us, begin = log
    at: int = begin + count
    times_us[at] = time_us
    return at


@compiled
def log_truth(slow: Any, time_us: int, following: Any) -> None:
    """Record the true state, and with it its place on the earth, if they are due."""
    marks, due, logs = slow[0][0], slow[7][0], following[1]
    if time_us < due["truth_us"]:
        return
    state, offset_m, place = slow[4]
    due["truth_us"] = (time_us // TRUTH_INTERVAL_US + 1) * TRUTH_INTERVAL_US
    store_truth(logs[3][0][_new_row(logs[3], marks["truth_rows"], time_us)], state, offset_m)
    marks["truth_rows"] += 1
    if time_us >= due["global_us"]:
        due["global_us"] = (time_us // GLOBAL_INTERVAL_US + 1) * GLOBAL_INTERVAL_US
        store_global(logs[4][0][_new_row(logs[4], marks["global_rows"], time_us)], state, place)
        marks["global_rows"] += 1


@compiled
def log_estimate(calls: Any, slow: Any, time_us: int, lane: Any, following: Any) -> None:
    """Record the estimate in the columns of the rows of the outer loop, and in its own row, if they are due.

    ``lane`` has the memories of estimator and inertial sensor.
    """
    marks, due, columns, logs, has_origin = slow[0][0], slow[7][0], slow[8], following[1], following[2][1]
    if time_us >= due["local_us"]:
        arguments = lane[0], lane[1], has_origin, time_us * 1e-6, columns
        is_valid = call_kernel_int(calls["local_position"], arguments) != 0
        interval_us = ESTIMATOR_INTERVAL_US if is_valid else INVALID_INTERVAL_US
        due["local_us"] = (time_us // interval_us + 1) * interval_us
    if time_us >= due["estimator_us"]:
        due["estimator_us"] = (time_us // ESTIMATOR_INTERVAL_US + 1) * ESTIMATOR_INTERVAL_US
        row = logs[5][0][_new_row(logs[5], marks["estimator_rows"], time_us)]
        wind = logs[6][0][_new_row(logs[6], marks["wind_rows"], time_us)]
        marks["estimator_rows"] += 1
        marks["wind_rows"] += call_kernel_int(
            calls["estimator"], (lane[0], lane[1], time_us * 1e-6, row, wind)
        )


@compiled
def watch_health(watch: int, slow: Any, time_us: int, lane: Any, following: Any) -> bool:
    """Update the health if it is due; return False if its conditions have changed: the tick is then run in Python.

    ``watch`` is the address of the kernel; ``lane`` has the memories of estimator and inertial sensor.
    """
    marks, (memory, track) = slow[0][0], lane
    if time_us < marks["health_us"]:
        return True
    health, limits, interval_us = slow[5]
    conditions, has_origin, flying = following[2]
    marks["health_us"] = (time_us // interval_us + 1) * interval_us
    newest = health[0]["newest"]
    if marks["mag_us"] != 0:
        newest["mag_s"] = marks["mag_us"] * 1e-6
    if marks["baro_us"] != 0:
        newest["baro_s"], newest["pressure_hpa"] = marks["baro_us"] * 1e-6, marks["pressure_hpa"]
    if marks["gnss_us"] != 0:
        has_fix = FixRow(*as_tuple(marks["fix"], FIX_SIZE)).fix_type >= _FIX_3D
        newest["fix_s"] = marks["gnss_us"] * 1e-6 if has_fix else -math.inf
    found: int = call_kernel_int(watch, (memory, health, track, limits, has_origin, flying, time_us * 1e-6))
    marks["conditions"] = found
    return bool(found == conditions)

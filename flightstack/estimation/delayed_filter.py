"""Entry points of the filter: measurements wait until the delayed horizon reaches them, IMU samples move it."""

from __future__ import annotations

import math

from flightstack.core.array_items import as_tuple
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3
from flightstack.estimation.agenda import MOST_PARTS, take_field_at_rest, work
from flightstack.estimation.alignment import add_field, add_force, align
from flightstack.estimation.error_state import read_nominal, read_vector, scaled, write_vector
from flightstack.estimation.estimator_params import PARAMS_SIZE, EstimatorParams
from flightstack.estimation.imu_input import (
    add_sample,
    in_start_frame,
    note_clipping,
    note_gap,
    take_step,
    write_step,
)
from flightstack.estimation.imu_track import IMU_SIZE
from flightstack.estimation.kalman import Filter
from flightstack.estimation.memory import (
    MemoryArray,
    MemoryRecord,
    filter_of,
    rings_of,
)
from flightstack.estimation.output_predictor import read_motion, write_motion
from flightstack.estimation.prediction import less_bias, motion_of, moved
from flightstack.estimation.rate_filter import filtered_rates
from flightstack.estimation.rings import (
    BARO_RING,
    BARO_ROWS,
    GNSS_RING,
    GNSS_ROWS,
    IMU_RING,
    IMU_ROWS,
    MAG_RING,
    MAG_ROWS,
    RANGE_RING,
    RANGE_ROWS,
    Rings,
    count_of,
    newest_fix_time,
    oldest_slot,
    push,
    take_mean,
    write_row,
)

_BACKLOG_S = 0.03
"""Time by which the filter may be behind the horizon, so that a sample does one part of its work."""
_MEASURED = 7
"""Time, position and velocity of a GNSS measurement; other measurements are shorter."""
_GNSS_SPARE_ROWS, _WAIT_S = 2, 0.05
_LONGEST_GAP_S = 1.0
"""Longest time without samples that is bridged by the next one."""


@compiled
def push_kernel(memory: MemoryArray, ring: int, row: FloatArray) -> None:
    """Store a measurement of a ring (``GNSS_RING``, …) until the horizon reaches its time.

    A measurement that is not finite is dropped; only the accuracies of GNSS, behind its velocity, may be missing.
    ``row`` may change.
    """
    for i in range(row.size):
        if i < _MEASURED and not math.isfinite(row[i]):
            return
    m = memory[0]
    params = EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE))
    r, wait_s = rings_of(m), params.delay_s + _WAIT_S
    if ring == GNSS_RING:
        if row[0] - newest_fix_time(r) >= wait_s / (GNSS_ROWS - _GNSS_SPARE_ROWS):
            slot = push(r, GNSS_RING, GNSS_ROWS)
            write_row(r.gnss[slot], row)
        return
    if ring == MAG_RING and m["flags"]["aligned"] == 0:
        add_field(m["alignment"], read_vector(row, 1))
    if not take_mean(m["means"][ring], row, max(params.sensor_period_s, wait_s / (MAG_ROWS - 4))):
        return
    if ring == MAG_RING:
        slot = push(r, MAG_RING, MAG_ROWS)
        write_row(r.mag[slot], row)
    elif ring == BARO_RING:
        slot = push(r, BARO_RING, BARO_ROWS)
        write_row(r.baro[slot], row)
    else:
        slot = push(r, RANGE_RING, RANGE_ROWS)
        write_row(r.range[slot], row)


@compiled
def _work_up_to(m: MemoryRecord, f: Filter, r: Rings, horizon_s: float, params: EstimatorParams) -> None:
    """Do a part of the filter's work, and all of it while it is behind ``horizon_s``."""
    for _ in range(MOST_PARTS):
        has_worked = work(m, f, r, horizon_s, params)
        if not (has_worked and _is_behind(r, horizon_s)):
            break


@compiled
def imu_kernel(memory: MemoryArray, sample: FloatArray) -> None:
    """Take an IMU sample, shape (8,): move the output, and the filter when a step is complete.

    A sample that is not finite, or without a step in time, or not later than the last one, is dropped. Time without
    samples is bridged by the next sample.
    """
    for i in range(IMU_SIZE):
        if not math.isfinite(sample[i]):
            return
    m = memory[0]
    time_s, dt_s = sample[0], _real_step(m, sample[0], sample[1])
    if dt_s <= 0.0:
        return
    params = EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE))
    f, r, sums, output = filter_of(m), rings_of(m), m["sums"], m["output"]
    gyro, accel = read_vector(sample, 2), read_vector(sample, 5)
    add_sample(sums, gyro, accel, dt_s)
    note_clipping(sums, gyro, accel, params)
    if m["flags"]["aligned"] == 0:
        _collect(m, accel, time_s, dt_s, params)
        return
    gyro_bias = read_vector(f.nominal, 10)
    angle = less_bias(scaled(gyro, dt_s), gyro_bias, dt_s)
    delta_velocity = less_bias(scaled(accel, dt_s), read_vector(f.nominal, 13), dt_s)
    dv = in_start_frame(angle, delta_velocity)
    write_motion(output, time_s, moved(read_motion(output), angle, dv, dt_s, params.gravity_m_s2))
    if sums["elapsed_s"] >= params.period_s - 0.25 * dt_s:
        step = take_step(sums, time_s)
        for _ in range(MOST_PARTS):
            if count_of(r, IMU_RING) < IMU_ROWS:
                break
            work(m, f, r, time_s, params)  # move early, so that the filter integrates every step
        slot = push(r, IMU_RING, IMU_ROWS)
        write_step(r.imu[slot], step)
        write_row(r.track[slot], output)
    # between two samples, so that rounding does not matter
    _work_up_to(m, f, r, time_s - params.delay_s + 0.25 * dt_s, params)
    rates = filtered_rates(m["rate_filter"], gyro, dt_s, params.gyro_cutoff_hz)
    _write_state(m, less_bias(rates, gyro_bias, 1.0))


@compiled
def _is_behind(r: Rings, horizon_s: float) -> bool:
    """Return True if the filter is so far behind the horizon that a sample does more than a part of its work."""
    oldest_s: float = r.imu[oldest_slot(r, IMU_RING)]["time_s"]
    return count_of(r, IMU_RING) > 0 and oldest_s < horizon_s - _BACKLOG_S


@compiled
def _write_state(m: MemoryRecord, rates: Vector3) -> None:
    """Write the output in the order of ``VehicleState``."""
    output, state = m["output"], m["state"]
    for i in range(3):
        state[i], state[3 + i] = output[8 + i], output[5 + i]
    for i in range(4):
        state[6 + i] = output[1 + i]
    write_vector(state, 10, rates)


@compiled
def field_kernel(memory: MemoryArray) -> None:
    """Correct the filter with the Earth's field in ``earth``: on the ground at once, in flight in its next step."""
    m = memory[0]
    if m["flags"]["aligned"] == 0:  # the alignment uses the field as it is
        return
    m["flags"]["field_is_new"] = 1
    if m["flags"]["landed"] == 1:
        params = EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE))
        take_field_at_rest(m, filter_of(m), rings_of(m), params)


@compiled
def _real_step(m: MemoryRecord, time_s: float, dt_s: float) -> float:
    """Return the time that a sample has to cover: its own, or longer after a gap; zero for one that came too late."""
    last_s = m["last_imu_s"]
    if dt_s <= 0.0 or (last_s > 0.0 and time_s <= last_s):
        return 0.0
    m["last_imu_s"] = time_s
    elapsed_s = time_s - last_s
    if last_s == 0.0 or elapsed_s < 1.5 * dt_s:
        return dt_s
    m["gaps"]["number"] += 1.0
    m["gaps"]["total_s"] += elapsed_s - dt_s
    covered_s: float = min(elapsed_s, _LONGEST_GAP_S)
    note_gap(m["sums"], covered_s - dt_s)
    return covered_s


@compiled
def _collect(m: MemoryRecord, accel: Vector3, time_s: float, dt_s: float, params: EstimatorParams) -> None:
    """Add a sample to the alignment; align when it is long enough."""
    if not add_force(m["alignment"], accel, dt_s):
        return
    f, earth = filter_of(m), m["earth"]
    align(f, m["alignment"], read_vector(earth, 0), earth[3], params)
    f.clock[0] = time_s
    take_step(m["sums"], time_s)
    write_motion(m["output"], time_s, motion_of(read_nominal(f.nominal)))
    m["flags"]["aligned"] = 1
    for ring in range(MAG_RING, IMU_RING):
        m["cursors"][ring]["rows"] = 0  # older than the state; the fields are in its yaw
    if m["alignment"]["fields"] > 0.0:
        m["flags"]["has_mag"], m["flags"]["has_yaw"] = 1, 1
        for i in range(3):
            m["field"][i] = m["alignment"]["field"][i] / m["alignment"]["fields"]

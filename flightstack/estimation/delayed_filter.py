"""Entry points of the filter: measurements wait until the delayed horizon reaches them, IMU samples move it."""

from __future__ import annotations

import math

from flightstack.core.array_items import as_tuple
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geometry import rotation_over
from flightstack.estimation.alignment import ALIGNMENT_S, WAIT_FOR_MAG_S, align
from flightstack.estimation.error_state import (
    ATTITUDE,
    VELOCITY,
    read_nominal,
    read_vector,
    scaled,
    write_vector,
)
from flightstack.estimation.estimator_params import PARAMS_SIZE, EstimatorParams
from flightstack.estimation.fusion import fuse_drag, fuse_rest_rate, fuse_rest_velocity
from flightstack.estimation.height_sources import take_baro, take_range
from flightstack.estimation.imu_input import (
    add_sample,
    mean_force,
    mean_rate,
    read_step,
    take_step,
    write_step,
)
from flightstack.estimation.imu_track import IMU_SIZE
from flightstack.estimation.kalman import Filter
from flightstack.estimation.memory import (
    ALIGNED,
    GAP_PENDING_S,
    GAP_S,
    GAPS,
    HAS_MAG,
    HAS_YAW,
    LANDED,
    MemoryArray,
    MemoryRecord,
    filter_of,
    rings_of,
)
from flightstack.estimation.output_predictor import follow, read_motion, write_motion
from flightstack.estimation.position_sources import (
    hold_position,
    is_platform_at_rest,
    is_velocity_measured,
    take_gnss,
)
from flightstack.estimation.prediction import DeltaSample, less_bias, motion_of, moved, predict
from flightstack.estimation.rate_filter import filtered_rates
from flightstack.estimation.resets import count_of_resets
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
    count_of_measurements,
    is_due,
    newest_fix_time,
    pop,
    push,
    slot_of,
    take_mean,
    write_row,
)
from flightstack.estimation.source_checks import add_fault_noise
from flightstack.estimation.yaw_sources import predict_yaw, take_earth_field, take_field, take_velocity

_LATE_S = 0.3
"""Measurements that are older than the horizon by this much are dropped."""
_STEPS = 4
"""Most predictions in one sample."""
_MEASURED = 7
"""Time, position and velocity of a GNSS measurement; other measurements are shorter."""
_GNSS_SPARE_ROWS, _WAIT_S = 2, 0.05
_REST_PERIOD_S, _REST_MEAN_S, _DRAG_PERIOD_S = 0.1, 0.1, 0.05
_STILL_RATE_RAD_S, _STILL_FORCE_M_S2 = 0.08, 1.0
_LONGEST_GAP_S = 1.0
"""Longest time without samples that is bridged by the next one."""
_GAP_RATE_RAD_S, _GAP_FORCE_M_S2 = 0.3, 3.0
"""Deviation of the mean rate and specific force of a gap from those of the sample that bridges it."""


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
    if ring == MAG_RING and m["flags"][ALIGNED] == 0:
        for i in range(3):
            m["alignment"][3 + i] += row[1 + i]
        m["alignment"][7] += 1.0
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
    if m["flags"][ALIGNED] == 0:
        _collect(m, accel, time_s, dt_s, params)
        return
    n = read_nominal(f.nominal)
    angle = less_bias(scaled(gyro, dt_s), n.gyro_bias_rad_s, dt_s)
    delta_velocity = less_bias(scaled(accel, dt_s), n.accel_bias_m_s2, dt_s)
    start = read_motion(output)
    # the mean specific force acts in the attitude in the middle of the sample
    dv = _in_start_frame(angle, delta_velocity)
    write_motion(output, time_s, moved(start, angle, dv, dt_s, params.gravity_m_s2))
    if sums[0] >= params.period_s - 0.25 * dt_s:
        step = take_step(sums, time_s)
        if r.cursors[IMU_RING, 1] >= IMU_ROWS:  # move early, so that the filter integrates every step
            _advance(m, f, r, time_s, params)
        slot = push(r, IMU_RING, IMU_ROWS)
        write_step(r.imu[slot], step)
        write_row(r.track[slot], output)
        for _ in range(_STEPS):
            if not _advance(m, f, r, time_s - params.delay_s, params):
                break
    rates = filtered_rates(m["rate_filter"], gyro, dt_s, params.gyro_cutoff_hz)
    _write_state(m, less_bias(rates, n.gyro_bias_rad_s, 1.0))


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
    """Take the Earth's field in ``earth``."""
    m = memory[0]
    if m["flags"][ALIGNED] == 1:
        take_earth_field(m, filter_of(m), EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE)))


@compiled
def _real_step(m: MemoryRecord, time_s: float, dt_s: float) -> float:
    """Return the time that a sample has to cover: its own, or longer after a gap; zero for one that came too late."""
    last_s = m["last_imu_s"][0]
    if dt_s <= 0.0 or (last_s > 0.0 and time_s <= last_s):
        return 0.0
    m["last_imu_s"][0] = time_s
    elapsed_s = time_s - last_s
    if last_s == 0.0 or elapsed_s < 1.5 * dt_s:
        return dt_s
    m["imu_gap"][GAPS] += 1.0
    m["imu_gap"][GAP_S] += elapsed_s - dt_s
    m["imu_gap"][GAP_PENDING_S] += min(elapsed_s, _LONGEST_GAP_S) - dt_s
    covered_s: float = min(elapsed_s, _LONGEST_GAP_S)
    return covered_s


@compiled
def _in_start_frame(angle: Vector3, delta_velocity: Vector3) -> Vector3:
    q = rotation_over(angle, 0.5)
    x, y, z = 2.0 * q.x, 2.0 * q.y, 2.0 * q.z  # first order: half of the step's angle
    v = delta_velocity
    return Vector3(v.x + y * v.z - z * v.y, v.y + z * v.x - x * v.z, v.z + x * v.y - y * v.x)


@compiled
def _collect(m: MemoryRecord, accel: Vector3, time_s: float, dt_s: float, params: EstimatorParams) -> None:
    """Add a sample to the alignment; align when it is long enough."""
    sums = m["alignment"]
    sums[0] += accel.x
    sums[1] += accel.y
    sums[2] += accel.z
    sums[6] += 1.0
    sums[8] += dt_s
    if sums[8] < ALIGNMENT_S or (sums[7] == 0.0 and sums[8] < WAIT_FOR_MAG_S):
        return
    f, earth = filter_of(m), m["earth"]
    align(f, sums, read_vector(earth, 0), earth[3], params)
    f.clock[0] = time_s
    take_step(m["sums"], time_s)
    write_motion(m["output"], time_s, motion_of(read_nominal(f.nominal)))
    m["flags"][ALIGNED] = 1
    for ring in range(MAG_RING, IMU_RING):
        m["cursors"][ring, 1] = 0  # older than the state; the fields are in its yaw
    if sums[7] > 0.0:
        m["flags"][HAS_MAG], m["flags"][HAS_YAW] = 1, 1
        for i in range(3):
            m["field"][i] = sums[3 + i] / sums[7]


@compiled
def _advance(m: MemoryRecord, f: Filter, r: Rings, horizon_s: float, params: EstimatorParams) -> bool:
    """Move the filter by one step if it is older than the horizon; return True if it moved."""
    if r.cursors[IMU_RING, 1] == 0:
        return False
    slot = slot_of(r, IMU_RING, IMU_ROWS, 0)
    if r.imu[slot, 0] > horizon_s:
        return False
    step = read_step(r.imu[slot])
    predict_yaw(m, f, step)
    predict(f, step, params)
    _account_for_gap(m, f)
    add_fault_noise(m["checks"], f, step.dt_s)
    has_changed = _bound(m, f, step, params)
    is_fused = _fuse_waiting(m, f, r, params)
    if not is_fused:
        is_fused = _drag(m, f, step, params)
    has_changed = has_changed or is_fused
    share = 1.0 if params.output_s <= step.dt_s else step.dt_s / params.output_s
    if count_of_resets(m) != m["followed"][0]:  # also one between two steps, by the Earth's field
        share, m["followed"][0] = 1.0, count_of_resets(m)
        has_changed = True
    if has_changed or share < 1.0:  # else the output has moved as the filter has
        follow(r, m["output"], motion_of(read_nominal(f.nominal)), share, params.gravity_m_s2)
    pop(r, IMU_RING, IMU_ROWS)
    return True


@compiled
def _bound(m: MemoryRecord, f: Filter, step: DeltaSample, params: EstimatorParams) -> bool:
    """Fuse rest of a vehicle that stands, or the held position without GNSS; return True if it was."""
    if m["flags"][LANDED] == 1 and _stands(m, params):
        return _rest(m, f, step, params)
    return hold_position(m, f, params)


@compiled
def _account_for_gap(m: MemoryRecord, f: Filter) -> None:
    """Add the uncertainty of time without samples."""
    gap_s = m["imu_gap"][GAP_PENDING_S]
    if gap_s > 0.0:
        angle_rad, speed_m_s = _GAP_RATE_RAD_S * gap_s, _GAP_FORCE_M_S2 * gap_s
        for axis in range(3):
            f.covariance[ATTITUDE + axis, ATTITUDE + axis] += angle_rad * angle_rad
            f.covariance[VELOCITY + axis, VELOCITY + axis] += speed_m_s * speed_m_s
        m["imu_gap"][GAP_PENDING_S] = 0.0


@compiled
def _stands(m: MemoryRecord, params: EstimatorParams) -> bool:
    rate, force = mean_rate(m["sums"]), mean_force(m["sums"])
    bias = read_vector(m["nominal"], 10)
    off = math.sqrt(force.x * force.x + force.y * force.y + force.z * force.z) - params.gravity_m_s2
    largest = max(abs(rate.x - bias.x), abs(rate.y - bias.y), abs(rate.z - bias.z))
    return abs(off) < _STILL_FORCE_M_S2 and largest < _STILL_RATE_RAD_S


@compiled
def _rest(m: MemoryRecord, f: Filter, step: DeltaSample, params: EstimatorParams) -> bool:
    """Fuse rest ten times a second; return True if it was."""
    if f.clock[0] - m["rest_s"][0] < _REST_PERIOD_S:
        return False
    m["rest_s"][0] = f.clock[0]
    if is_platform_at_rest(m, f):
        fuse_rest_velocity(f, params)
    density = max(step.gyro_density.x, step.gyro_density.y, step.gyro_density.z)
    fuse_rest_rate(f, mean_rate(m["sums"]), density / _REST_MEAN_S, params)
    return True


@compiled
def _drag(m: MemoryRecord, f: Filter, step: DeltaSample, params: EstimatorParams) -> bool:
    """Fuse drag in flight while the velocity over ground is measured, twenty times a second; return True if it was."""
    is_due = f.clock[0] - m["drag_s"][0] >= _DRAG_PERIOD_S
    if params.drag_is_fused == 0.0 or m["flags"][LANDED] == 1 or not is_due or not is_velocity_measured(f):
        return False
    m["drag_s"][0] = f.clock[0]
    fuse_drag(f, scaled(step.velocity_m_s, 1.0 / step.dt_s), params)
    return True


@compiled
def _fuse_waiting(m: MemoryRecord, f: Filter, r: Rings, params: EstimatorParams) -> bool:
    """Fuse all measurements that are due; drop those that are too late. Return False if none was due."""
    now_s, waiting = f.clock[0], count_of_measurements(r)
    for _ in range(MAG_ROWS):
        field = r.mag[slot_of(r, MAG_RING, MAG_ROWS, 0)]
        if not is_due(r, MAG_RING, field[0], now_s):
            break
        if field[0] > now_s - _LATE_S:
            take_field(m, f, field, params)
        pop(r, MAG_RING, MAG_ROWS)
    for _ in range(BARO_ROWS):
        altitude = r.baro[slot_of(r, BARO_RING, BARO_ROWS, 0)]
        if not is_due(r, BARO_RING, altitude[0], now_s):
            break
        if altitude[0] > now_s - _LATE_S:
            take_baro(m, f, altitude, params)
        pop(r, BARO_RING, BARO_ROWS)
    for _ in range(RANGE_ROWS):
        distance = r.range[slot_of(r, RANGE_RING, RANGE_ROWS, 0)]
        if not is_due(r, RANGE_RING, distance[0], now_s):
            break
        if distance[0] > now_s - _LATE_S:
            take_range(m, f, distance, params)
        pop(r, RANGE_RING, RANGE_ROWS)
    for _ in range(GNSS_ROWS):
        fix = r.gnss[slot_of(r, GNSS_RING, GNSS_ROWS, 0)]
        if not is_due(r, GNSS_RING, fix[0], now_s):
            break
        if fix[0] > now_s - _LATE_S:
            take_gnss(m, f, fix, params)
            take_velocity(m, f, fix)
        pop(r, GNSS_RING, GNSS_ROWS)
    return count_of_measurements(r) != waiting

"""The estimator: samples of sensors in, attitude, velocity, position and their uncertainty out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.core.array_items import as_tuple
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Record, RecordArray, Vector3, VehicleState
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.geometry import rotation_over
from flightstack.core.portable_math import atan2
from flightstack.estimation.alignment import (
    ALIGNMENT_S,
    ALIGNMENT_SIZE,
    WAIT_FOR_MAG_S,
    align,
    align_yaw,
)
from flightstack.estimation.error_state import (
    BARO_BIAS,
    ERROR_STATES,
    GNSS_BIAS,
    NOMINAL_SIZE,
    POSITION,
    VELOCITY,
    read_nominal,
    read_vector,
    scaled,
    write_vector,
)
from flightstack.estimation.estimator_params import PARAMS_SIZE, EstimatorParams, GnssLimits
from flightstack.estimation.fusion import (
    GNSS_SIZE,
    fuse_baro,
    fuse_field,
    fuse_gnss,
    fuse_hold,
    fuse_range,
    fuse_rest,
)
from flightstack.estimation.imu_input import (
    SUMS_SIZE,
    add_sample,
    mean_force,
    mean_rate,
    read_step,
    take_step,
    write_step,
)
from flightstack.estimation.kalman import (
    FUSED_S,
    GNSS_POSITION,
    GNSS_VELOCITY,
    OBSERVATION_COLUMNS,
    OBSERVATIONS,
    Filter,
    deviation,
    reset_variance,
)
from flightstack.estimation.output_predictor import follow, read_motion, write_motion
from flightstack.estimation.prediction import less_bias, motion_of, moved, predict
from flightstack.estimation.rings import (
    BARO_RING,
    BARO_ROWS,
    GNSS_RING,
    GNSS_ROWS,
    IMU_COLUMNS,
    IMU_RING,
    IMU_ROWS,
    MAG_RING,
    MAG_ROWS,
    RANGE_RING,
    RANGE_ROWS,
    RINGS,
    TRACK_COLUMNS,
    Rings,
    is_due,
    pop,
    push,
    slot_of,
    write_row,
)
from flightstack.estimation.sensor_samples import (
    BaroSample,
    GnssFix,
    GnssSample,
    ImuSample,
    MagSample,
    RangeSample,
)

IMU_SIZE = 8
"""Array form of an IMU sample: time, step, rate (3), specific force (3)."""
ALIGNED, LANDED, HAS_BARO, HAS_GNSS, HAS_RANGE, FLAGS = 0, 1, 2, 3, 4, 5
POSITION_RESET, VELOCITY_RESET, YAW_RESET, RESETS = 0, 4, 8, 10
"""Counter of each kind of reset, with the last change behind it."""
_LATE_S = 0.3
"""Measurements that are older than the horizon by this much are dropped."""
_STEPS = 4
"""Most predictions in one sample."""
_GNSS_LOST_S = 1.0
_HOLD_PERIOD_S = 0.2
_STILL_RATE_RAD_S, _STILL_FORCE_M_S2 = 0.08, 0.4

MEMORY = np.dtype(
    [
        ("params", "f8", (PARAMS_SIZE,)),
        ("nominal", "f8", (NOMINAL_SIZE,)),
        ("covariance", "f8", (ERROR_STATES, ERROR_STATES)),
        ("observations", "f8", (OBSERVATIONS, OBSERVATION_COLUMNS)),
        ("h", "f8", (ERROR_STATES,)),
        ("ph", "f8", (ERROR_STATES,)),
        ("gain", "f8", (ERROR_STATES,)),
        ("clock", "f8", (2,)),
        ("gnss", "f8", (GNSS_ROWS, GNSS_SIZE)),
        ("mag", "f8", (MAG_ROWS, 4)),
        ("baro", "f8", (BARO_ROWS, 2)),
        ("range", "f8", (RANGE_ROWS, 2)),
        ("imu", "f8", (IMU_ROWS, IMU_COLUMNS)),
        ("track", "f8", (IMU_ROWS, TRACK_COLUMNS)),
        ("cursors", "i8", (RINGS, 2)),
        ("sums", "f8", (SUMS_SIZE,)),
        ("alignment", "f8", (ALIGNMENT_SIZE,)),
        ("output", "f8", (TRACK_COLUMNS + 3,)),
        ("earth", "f8", (4,)),  # field NED [gauss], declination [rad]
        ("last_gnss_s", "f8", (1,)),
        ("ground_m", "f8", (1,)),
        ("hold", "f8", (3,)),  # north, east [m], time of the last fusion
        ("flags", "i8", (FLAGS,)),
        ("resets", "f8", (RESETS,)),
    ]
)


@compiled
def filter_of(m: Record) -> Filter:
    """Return the filter's arrays of a record of ``MEMORY``."""
    return Filter(m["nominal"], m["covariance"], m["observations"], m["h"], m["ph"], m["gain"], m["clock"])


@compiled
def rings_of(m: Record) -> Rings:
    """Return the ring buffers of a record of ``MEMORY``."""
    return Rings(m["gnss"], m["mag"], m["baro"], m["range"], m["imu"], m["track"], m["cursors"])


@compiled
def push_kernel(memory: RecordArray, ring: int, row: FloatArray) -> None:
    """Store a measurement of a ring (``GNSS_RING``, …) until the horizon reaches its time."""
    m = memory[0]
    r = rings_of(m)
    if ring == GNSS_RING:
        write_row(r.gnss, push(r, GNSS_RING, GNSS_ROWS), row)
    elif ring == MAG_RING:
        write_row(r.mag, push(r, MAG_RING, MAG_ROWS), row)
        if m["flags"][ALIGNED] == 0:
            for i in range(3):
                m["alignment"][3 + i] += row[1 + i]
            m["alignment"][7] += 1.0
    elif ring == BARO_RING:
        write_row(r.baro, push(r, BARO_RING, BARO_ROWS), row)
    elif ring == RANGE_RING:
        write_row(r.range, push(r, RANGE_RING, RANGE_ROWS), row)


@compiled
def imu_kernel(memory: RecordArray, sample: FloatArray) -> None:
    """Take an IMU sample, shape (8,): move the output, and the filter when a step is complete."""
    m = memory[0]
    params = EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE))
    f, r, sums, output = filter_of(m), rings_of(m), m["sums"], m["output"]
    gyro, accel = read_vector(sample, 2), read_vector(sample, 5)
    time_s, dt_s = sample[0], sample[1]
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
    write_vector(output, TRACK_COLUMNS, less_bias(gyro, n.gyro_bias_rad_s, 1.0))
    if sums[0] >= params.period_s - 0.25 * dt_s:
        step = take_step(sums, time_s)
        slot = push(r, IMU_RING, IMU_ROWS)
        write_step(r.imu[slot], step)
        write_row(r.track, slot, output)
        for _ in range(_STEPS):
            if not _advance(m, f, r, time_s - params.delay_s, params):
                break


@compiled
def _in_start_frame(angle: Vector3, delta_velocity: Vector3) -> Vector3:
    q = rotation_over(angle, 0.5)
    x, y, z = 2.0 * q.x, 2.0 * q.y, 2.0 * q.z  # first order: half of the step's angle
    v = delta_velocity
    return Vector3(v.x + y * v.z - z * v.y, v.y + z * v.x - x * v.z, v.z + x * v.y - y * v.x)


@compiled
def _collect(m: Record, accel: Vector3, time_s: float, dt_s: float, params: EstimatorParams) -> None:
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


@compiled
def _advance(m: Record, f: Filter, r: Rings, horizon_s: float, params: EstimatorParams) -> bool:
    """Move the filter by one step if it is older than the horizon; return True if it moved."""
    if r.cursors[IMU_RING, 1] == 0:
        return False
    slot = slot_of(r, IMU_RING, IMU_ROWS, 0)
    if r.imu[slot, 0] > horizon_s:
        return False
    step = read_step(r.imu[slot])
    predict(f, step, params)
    if m["flags"][LANDED] == 1 and _stands(m, params):
        fuse_rest(f, step, params)
    else:
        _hold_position(m, f, params)
    before = m["resets"][POSITION_RESET] + m["resets"][VELOCITY_RESET] + m["resets"][YAW_RESET]
    _fuse_waiting(m, f, r, params)
    share = 1.0 if params.output_s <= step.dt_s else step.dt_s / params.output_s
    if m["resets"][POSITION_RESET] + m["resets"][VELOCITY_RESET] + m["resets"][YAW_RESET] != before:
        share = 1.0
    follow(r, m["output"], motion_of(read_nominal(f.nominal)), share, params.gravity_m_s2)
    pop(r, IMU_RING, IMU_ROWS)
    return True


@compiled
def _hold_position(m: Record, f: Filter, params: EstimatorParams) -> None:
    """Hold the horizontal position while the velocity is not measured."""
    hold, now_s = m["hold"], f.clock[0]
    is_known = now_s - f.observations[GNSS_VELOCITY, FUSED_S] < _GNSS_LOST_S
    if is_known or (m["flags"][HAS_GNSS] == 1 and deviation(f, VELOCITY, 2) < params.hold_velocity_m_s):
        hold[2] = 0.0
        return
    if hold[2] == 0.0:
        hold[0], hold[1] = f.nominal[7], f.nominal[8]
    if now_s - hold[2] >= _HOLD_PERIOD_S:
        fuse_hold(f, hold[0], hold[1], params)
        hold[2] = now_s


@compiled
def _stands(m: Record, params: EstimatorParams) -> bool:
    rate, force = mean_rate(m["sums"]), mean_force(m["sums"])
    bias = read_vector(m["nominal"], 10)
    off = math.sqrt(force.x * force.x + force.y * force.y + force.z * force.z) - params.gravity_m_s2
    largest = max(abs(rate.x - bias.x), abs(rate.y - bias.y), abs(rate.z - bias.z))
    return abs(off) < _STILL_FORCE_M_S2 and largest < _STILL_RATE_RAD_S


@compiled
def _fuse_waiting(m: Record, f: Filter, r: Rings, params: EstimatorParams) -> None:
    """Fuse all measurements that are due; drop those that are too late."""
    now_s = f.clock[0]
    for _ in range(MAG_ROWS):
        row = r.mag[slot_of(r, MAG_RING, MAG_ROWS, 0)]
        if not is_due(r, MAG_RING, row[0], now_s):
            break
        if row[0] > now_s - _LATE_S:
            fuse_field(f, read_vector(row, 1), params)
        pop(r, MAG_RING, MAG_ROWS)
    for _ in range(BARO_ROWS):
        row = r.baro[slot_of(r, BARO_RING, BARO_ROWS, 0)]
        if not is_due(r, BARO_RING, row[0], now_s):
            break
        if row[0] > now_s - _LATE_S:
            _take_baro(m, f, row, params)
        pop(r, BARO_RING, BARO_ROWS)
    for _ in range(RANGE_ROWS):
        row = r.range[slot_of(r, RANGE_RING, RANGE_ROWS, 0)]
        if not is_due(r, RANGE_RING, row[0], now_s):
            break
        if row[0] > now_s - _LATE_S:
            _take_range(m, f, row, params)
        pop(r, RANGE_RING, RANGE_ROWS)
    for _ in range(GNSS_ROWS):
        row = r.gnss[slot_of(r, GNSS_RING, GNSS_ROWS, 0)]
        if not is_due(r, GNSS_RING, row[0], now_s):
            break
        if row[0] > now_s - _LATE_S:
            _take_gnss(m, f, row, params)
        pop(r, GNSS_RING, GNSS_ROWS)


@compiled
def _take_baro(m: Record, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    if m["flags"][HAS_BARO] == 0:
        _start_baro(m, f, row[1], params)
    fuse_baro(f, row[1], f.clock[0] - row[0], params)


@compiled
def _take_range(m: Record, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    if m["flags"][HAS_RANGE] == 0:
        m["ground_m"][0], m["flags"][HAS_RANGE] = f.nominal[9] + row[1], 1
    fuse_range(f, row[1], m["ground_m"][0], f.clock[0] - row[0], params)


@compiled
def _start_baro(m: Record, f: Filter, altitude_m: float, params: EstimatorParams) -> None:
    """Set the barometer's bias so that the first altitude agrees with the height."""
    p = f.covariance
    f.nominal[24] = altitude_m + f.nominal[9]
    for j in range(ERROR_STATES):
        p[BARO_BIAS, j] = p[POSITION + 2, j]
    for j in range(ERROR_STATES):
        p[j, BARO_BIAS] = p[j, POSITION + 2]
    p[BARO_BIAS, BARO_BIAS] = p[POSITION + 2, POSITION + 2] + params.baro_noise_m * params.baro_noise_m
    m["flags"][HAS_BARO] = 1


@compiled
def _take_gnss(m: Record, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    """Fuse a GNSS measurement; reset to it after a long time without an accepted one."""
    now_s, o = f.clock[0], f.observations
    if m["flags"][HAS_GNSS] == 0:
        _start_gnss(m, f, row, params)
    elapsed_s = max(0.0, row[0] - m["last_gnss_s"][0])
    m["last_gnss_s"][0] = row[0]
    fuse_gnss(f, row, now_s - row[0], elapsed_s, params)
    if elapsed_s > 1.0:
        return
    refused = 0
    for axis in range(2):
        if now_s - o[GNSS_VELOCITY + axis, FUSED_S] > params.reset_s:
            refused = 1
        if now_s - o[GNSS_POSITION + axis, FUSED_S] > params.reset_s and refused == 0:
            refused = 2
    if refused > 0:
        _reset_to(m, f, row, refused == 1)
    elif now_s - o[GNSS_POSITION + 2, FUSED_S] > params.reset_s:
        _reset_height(m, f, row)


@compiled
def _start_gnss(m: Record, f: Filter, row: FloatArray, params: EstimatorParams) -> None:
    """Account for the errors of the first GNSS position, which becomes the origin, in the covariance."""
    p, share = f.covariance, params.gnss_bias_share
    for axis in range(3):
        accuracy_m = row[8] if axis == 2 else row[7]
        if not accuracy_m > 0.0:
            accuracy_m = 5.0
        variance = accuracy_m * accuracy_m
        at = POSITION + axis
        p[at, at] += variance
        if axis == 2:
            p[at, BARO_BIAS] += variance
            p[BARO_BIAS, at] += variance
            p[BARO_BIAS, BARO_BIAS] += variance
        reset_variance(p, GNSS_BIAS + axis, 1, share * share * variance)
    for row_number in range(6):
        f.observations[row_number, FUSED_S] = f.clock[0]
    m["last_gnss_s"][0] = row[0]
    m["flags"][HAS_GNSS] = 1


@compiled
def _reset_to(m: Record, f: Filter, row: FloatArray, with_velocity: bool) -> None:
    """Set horizontal position, and velocity if asked, to a GNSS measurement."""
    resets, accuracy_m = m["resets"], max(row[7], 0.5)
    resets[POSITION_RESET] += 1.0
    for axis in range(2):
        resets[POSITION_RESET + 1 + axis] = row[1 + axis] - f.nominal[7 + axis]
        f.nominal[7 + axis], f.nominal[25 + axis] = row[1 + axis], 0.0
        f.observations[GNSS_POSITION + axis, FUSED_S] = f.clock[0]
    resets[POSITION_RESET + 3] = 0.0
    reset_variance(f.covariance, POSITION, 2, accuracy_m * accuracy_m)
    reset_variance(f.covariance, GNSS_BIAS, 2, 1e-4)
    if with_velocity:
        resets[VELOCITY_RESET] += 1.0
        for axis in range(3):
            resets[VELOCITY_RESET + 1 + axis] = row[4 + axis] - f.nominal[4 + axis]
            f.nominal[4 + axis] = row[4 + axis]
            f.observations[GNSS_VELOCITY + axis, FUSED_S] = f.clock[0]
        reset_variance(f.covariance, VELOCITY, 3, max(row[9], 0.3) * max(row[9], 0.3))


@compiled
def _reset_height(m: Record, f: Filter, row: FloatArray) -> None:
    resets, accuracy_m = m["resets"], max(row[8], 0.5)
    resets[POSITION_RESET] += 1.0
    resets[POSITION_RESET + 1], resets[POSITION_RESET + 2] = 0.0, 0.0
    resets[POSITION_RESET + 3] = row[3] - f.nominal[9]
    f.nominal[9], f.nominal[27] = row[3], 0.0
    reset_variance(f.covariance, POSITION + 2, 1, accuracy_m * accuracy_m)
    reset_variance(f.covariance, GNSS_BIAS + 2, 1, 1e-4)
    f.observations[GNSS_POSITION + 2, FUSED_S] = f.clock[0]
    m["flags"][HAS_BARO] = 0


@compiled
def realign_kernel(memory: RecordArray) -> None:
    """Align the yaw again with the Earth's field now known."""
    m = memory[0]
    params = EstimatorParams(*as_tuple(m["params"], PARAMS_SIZE))
    f, sums, earth = filter_of(m), m["alignment"], m["earth"]
    if m["flags"][ALIGNED] == 1 and sums[7] > 0.0:
        field = Vector3(sums[3] / sums[7], sums[4] / sums[7], sums[5] / sums[7])
        m["resets"][YAW_RESET] += 1.0
        align_yaw(f, field, read_vector(earth, 0), earth[3], params)
    elif m["flags"][ALIGNED] == 1:
        write_vector(f.nominal, 16, read_vector(earth, 0))


class Estimator:
    """Estimates the state of one vehicle. Samples of each sensor must arrive in the order of their time."""

    def __init__(self, params: EstimatorParams | None = None, limits: GnssLimits | None = None) -> None:
        self.memory: RecordArray = np.zeros(1, MEMORY)
        self.params = params or EstimatorParams()
        self.limits = limits or GnssLimits()
        record: Any = self.memory[0]
        record["params"] = self.params
        record["sums"][1] = 1.0
        record["clock"][1] = self.params.imu_noise_share
        self.frame: LocalFrame | None = None
        self._record = record
        self._imu = np.zeros(IMU_SIZE)
        self._gnss = np.zeros(GNSS_SIZE)
        self._mag = np.zeros(4)
        self._pair = np.zeros(2)

    @property
    def aligned(self) -> bool:
        """True if the filter has an attitude."""
        return bool(self._record["flags"][ALIGNED])

    def set_landed(self, landed: bool) -> None:
        """Tell the filter whether the vehicle stands on the ground."""
        self._record["flags"][LANDED] = landed

    def set_declination(self, declination_rad: float) -> None:
        """Set the magnetic declination, which holds until the Earth's field is known."""
        self._record["earth"][3] = declination_rad

    def set_earth_field(self, field_ned_gauss: Vector3) -> None:
        """Set the Earth's magnetic field at the place of the vehicle, from the World Magnetic Model."""
        self._record["earth"][:3] = field_ned_gauss
        self._record["earth"][3] = atan2(field_ned_gauss.y, field_ned_gauss.x)
        realign_kernel(self.memory)

    def imu(self, sample: ImuSample) -> None:
        """Take a sample of the IMU."""
        x = self._imu
        x[0], x[1] = sample.time_s, sample.dt_s
        x[2:5], x[5:8] = sample.gyro_frd_rad_s, sample.accel_frd_m_s2
        imu_kernel(self.memory, x)

    def mag(self, sample: MagSample) -> None:
        """Take a sample of the magnetometer."""
        self._mag[0], self._mag[1:] = sample.time_s - self.params.mag_delay_s, sample.field_frd_gauss
        push_kernel(self.memory, MAG_RING, self._mag)

    def baro(self, sample: BaroSample) -> None:
        """Take a sample of the barometer."""
        self._pair[:] = sample.time_s - self.params.baro_delay_s, sample.pressure_altitude_m
        push_kernel(self.memory, BARO_RING, self._pair)

    def range(self, sample: RangeSample) -> None:
        """Take a sample of the range finder."""
        if sample.quality > 0.0:
            self._pair[:] = sample.time_s - self.params.range_delay_s, sample.distance_m
            push_kernel(self.memory, RANGE_RING, self._pair)

    def gnss(self, sample: GnssSample) -> None:
        """Take a sample of the GNSS receiver. The first three-dimensional fix becomes the origin."""
        if sample.fix_type < GnssFix.FIX_3D or (self.frame is None and not self._is_good(sample)):
            return
        point = GeoPoint(sample.latitude_deg, sample.longitude_deg, sample.altitude_msl_m)
        if self.frame is None:
            if not self.aligned:
                return
            n, e, d = self._record["nominal"][7:10]
            origin = LocalFrame(point).to_geo(Vector3(-float(n), -float(e), -float(d)))
            self.frame = LocalFrame(origin)
        x = self._gnss
        x[0], x[1:4], x[4:7] = (
            sample.time_s - self.params.gnss_delay_s,
            self.frame.to_ned(point),
            sample.velocity_ned_m_s,
        )
        x[7:10] = sample.eph_m, sample.epv_m, sample.speed_accuracy_m_s
        push_kernel(self.memory, GNSS_RING, x)

    def _is_good(self, sample: GnssSample) -> bool:
        """Return True if a fix is accurate enough to start from."""
        limits = self.limits
        return (
            sample.satellites >= limits.satellites
            and not sample.eph_m > limits.eph_m
            and not sample.epv_m > limits.epv_m
            and not sample.speed_accuracy_m_s > limits.speed_accuracy_m_s
        )

    def state(self) -> VehicleState:
        """Return the output at the time of the latest IMU sample."""
        x = self._record["output"].tolist()
        return VehicleState(Vector3(*x[8:11]), Vector3(*x[5:8]), Quaternion(*x[1:5]), Vector3(*x[11:14]))

    def deviations(self) -> FloatArray:
        """Return the standard deviation of each error state, shape (27,)."""
        return np.sqrt(np.diag(self._record["covariance"]))

"""Inertial sensors: true motion of the mounting, vibration of the rotors, and the errors of each sensor.

The measurement is the mean over the time since the last one, as that of a sensor with an integrator. With q0, q1 the
attitudes, and v0, v1 the velocities of the mounting r (v + R(ω × r)) at both ends:

    rates = log(q0* ⊗ q1) / dt            specific force = Rᵀ(q½) ((v1 − v0) / dt − g)

The sums of rates and of specific force over a flight are thus those of attitude and velocity, at any step.

A rotor of imbalance U [kg m] pushes the frame with U·Ω² along its turning imbalance. The means of force and of the
rates that its torque causes follow in closed form from the rotor's angle at both ends; both integrate to zero over a
turn. The motion of the frame itself is left out of the state: at 100 Hz it is 0.01 mm.

Errors of an axis, with white noise n and the wandering bias b, a Gauss-Markov process:

    out = M·true + b_on + b_T·ΔT + b + n / √dt,   ΔT = ΔT∞ (1 − exp(−t / T))
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.compiled import compiled, direct
from flightstack.core.contract import FloatArray, Quaternion, Record, RecordArray, SingleArray, Vector3
from flightstack.core.geometry import (
    blend,
    conjugate,
    cross,
    quaternion_product,
    rotate,
    rotation_vector,
    wrap_pi,
)
from flightstack.core.portable_math import sin_cos
from flightstack.params.vehicle import GRAVITY_M_S2, Vehicle
from sim_bridge.sensors.layout import IMU, IMU_NOISE, MOTION, write_numbers
from sim_bridge.sensors.noise import NormalStream, gauss_markov, limited, quantised, with_fault

_MATRIX_DEVIATES, _BIAS_DEVIATES = 18, 18
_ROWS = 512


class Motion(NamedTuple):
    """Mean rates and specific force of the mounting."""

    gyro_frd_rad_s: Vector3
    accel_frd_m_s2: Vector3


@compiled
def mounting_velocity(state: FloatArray, mounting: FloatArray) -> Vector3:
    """Return the velocity NED of the mounting."""
    q = Quaternion(state[6], state[7], state[8], state[9])
    arm = Vector3(mounting[0], mounting[1], mounting[2])
    swing = rotate(q, cross(Vector3(state[10], state[11], state[12]), arm))
    return Vector3(state[3] + swing.x, state[4] + swing.y, state[5] + swing.z)


@compiled
def vibration(m: Record, rotor_speed: SingleArray) -> Motion:
    """Turn the rotors; return the mean rates and specific force of their imbalance."""
    p, q, r, ax, ay = 0.0, 0.0, 0.0, 0.0, 0.0
    dt, inertia = m["dt_s"], m["inertia"]
    for i in range(m["rotor_count"]):
        speed, phase = 0.5 * (m["speed"][i] + rotor_speed[i]), m["phase"][i]
        m["speed"][i] = rotor_speed[i]
        turned = wrap_pi(phase + speed * dt)
        m["phase"][i] = turned
        s0, c0 = m["turn"][i, 0], m["turn"][i, 1]
        s1, c1 = sin_cos(turned)
        m["turn"][i, 0], m["turn"][i, 1] = s1, c1
        spin, at = m["spin"][i], m["rotor_position"][i]
        along, across = m["imbalance"] * (s1 - s0) / dt, m["imbalance"] * (c0 - c1) / dt
        ax += speed * along / m["mass"]
        ay += spin * speed * across / m["mass"]
        p += spin * at[2] * along / inertia[0]
        q += at[2] * across / inertia[1]
        r -= (spin * at[0] * along + at[1] * across) / inertia[2]
    return Motion(Vector3(p, q, r), Vector3(ax, ay, 0.0))


@compiled
def true_motion(m: Record, state: FloatArray) -> Motion:
    """Return the mean rates and specific force since the last call."""
    before = m["attitude"]
    q0 = Quaternion(before[0], before[1], before[2], before[3])
    q1 = Quaternion(state[6], state[7], state[8], state[9])
    v1, dt = mounting_velocity(state, m["mounting"]), m["dt_s"]
    v0 = m["velocity"]
    turn = rotation_vector(quaternion_product(conjugate(q0), q1))
    push = Vector3((v1.x - v0[0]) / dt, (v1.y - v0[1]) / dt, (v1.z - v0[2]) / dt - GRAVITY_M_S2)
    before[0], before[1], before[2], before[3] = q1.w, q1.x, q1.y, q1.z
    v0[0], v0[1], v0[2] = v1.x, v1.y, v1.z
    gyro = Vector3(turn.x / dt, turn.y / dt, turn.z / dt)
    return Motion(gyro, rotate(conjugate(blend(q0, q1, 0.5)), push))


@compiled
def _sense(
    imu: Record,
    part: int,
    true: Vector3,
    full_scale: float,
    step: float,
    noise: FloatArray,
    wire: SingleArray,
) -> None:
    """Write the output of the gyro (``part`` 0) or accelerometer (1)."""
    if imu["is_frozen"][part] != 0:
        for i in range(3 * part, 3 * part + 3):
            wire[(i + 3) % 6] = imu["out"][i]
        return
    matrix, white = imu["matrix"][part], with_fault(imu["white"][part], imu["fault_noise"][part])
    for axis in range(3):
        i = 3 * part + axis
        row = matrix[axis]
        value = row[0] * true.x + row[1] * true.y + row[2] * true.z
        value += imu["turn_on"][i] + imu["per_kelvin"][i] * imu["rise"] + imu["bias"][i]
        value += white * noise[i] + imu["fault_bias"][i]
        imu["out"][i] = quantised(limited(value, full_scale), step)
        wire[(i + 3) % 6] = imu["out"][i]


@compiled
def measure_imu(
    motion: RecordArray,
    imus: RecordArray,
    state: FloatArray,
    rotor_speed: SingleArray,
    deviates: FloatArray,
    wires: SingleArray,
) -> None:
    """Write the measurements of all inertial sensors to their ``out``, and to ``wires`` as in HIL_SENSOR.

    ``state`` is the array form of ``VehicleState``, ``rotor_speed`` rad/s, ``deviates`` standard normal deviates of
    shape (rows, sensors, 12), of which each call takes one row. ``wires`` has the shape (sensors, 6): specific force
    and rates.
    """
    m = motion[0]
    noise = deviates[m["row"]]
    m["row"] += 1
    true = true_motion(m, state)
    gyro, accel = true.gyro_frd_rad_s, true.accel_frd_m_s2
    if m["imbalance"] > 0.0:
        shake = vibration(m, rotor_speed)
        rates, force = shake.gyro_frd_rad_s, shake.accel_frd_m_s2
        gyro = Vector3(gyro.x + rates.x, gyro.y + rates.y, gyro.z + rates.z)
        accel = Vector3(accel.x + force.x, accel.y + force.y, accel.z + force.z)
    for k in range(len(imus)):
        imu = imus[k]
        imu["rise"] = imu["warm_up_k"] + imu["warming"] * (imu["rise"] - imu["warm_up_k"])
        for i in range(6):
            imu["bias"][i] = imu["decay"] * imu["bias"][i] + imu["wander"][i // 3] * noise[k, 6 + i]
        _sense(imu, 0, gyro, imu["gyro_range_rad_s"], imu["gyro_resolution_rad_s"], noise[k], wires[k])
        _sense(imu, 1, accel, imu["accel_range_m_s2"], imu["accel_resolution_m_s2"], noise[k], wires[k])


class ImuSet:
    """The inertial sensors of a vehicle, on one mounting."""

    def __init__(self, vehicle: Vehicle, seed: int, state: FloatArray) -> None:
        numbers = vehicle.sensors.numbers["imu"]
        count = vehicle.sensors.imu_count
        self.motion: RecordArray = np.zeros(1, MOTION)
        self.records: RecordArray = np.zeros(count, IMU)
        """One record for each sensor, dtype ``IMU``."""
        self._streams = [NormalStream(seed, "imu", index, IMU_NOISE) for index in range(count)]
        for record, stream in zip(self.records, self._streams, strict=True):
            write_numbers(record, numbers)
            _set_errors(record, stream)
        self._set_motion(vehicle, state)
        self.noise: FloatArray = np.zeros((2 * _ROWS, count, IMU_NOISE))
        """Deviates of the next measurements, for ``measure_imu``."""
        self._left = 0  # rows of noise
        self._call = measure_imu

    def _set_motion(self, vehicle: Vehicle, state: FloatArray) -> None:
        m, first = self.motion[0], self.records[0]
        m["mounting"] = first["position_frd_m"]
        m["imbalance"] = 1e-6 * first["rotor_imbalance_g_mm"]
        m["mass"], m["inertia"] = vehicle.mass_kg, vehicle.inertia_kg_m2
        m["rotor_count"] = len(vehicle.rotors)
        for index, rotor in enumerate(vehicle.rotors):
            m["rotor_position"][index], m["spin"][index] = rotor.position_frd_m, rotor.spin
            # rotors do not turn in step: an irrational share of a turn
            m["phase"][index] = wrap_pi(2.4 * index)
            m["turn"][index] = sin_cos(m["phase"][index])
        m["attitude"], m["velocity"] = state[6:10], mounting_velocity(state, m["mounting"])

    def set_step(self, dt_s: float) -> None:
        """Set the time between two measurements."""
        self.motion[0]["dt_s"] = dt_s
        for imu in self.records:
            imu["white"] = (
                imu["gyro_noise_rad_s_sqrt_hz"] / math.sqrt(dt_s),
                imu["accel_noise_m_s2_sqrt_hz"] / math.sqrt(dt_s),
            )
            imu["decay"], share = gauss_markov(dt_s, float(imu["bias_time_s"]))
            imu["warming"] = gauss_markov(dt_s, float(imu["warm_up_time_s"]))[0]
            imu["wander"] = (
                share * imu["gyro_bias_instability_rad_s"],
                share * imu["accel_bias_instability_m_s2"],
            )

    def measure(self, state: FloatArray, rotor_speed: SingleArray, wires: SingleArray) -> None:
        """Measure the motion since the last call; the arrays have the same types in each call."""
        if self._left == 0:
            self._refill(state, rotor_speed, wires)
        self._left -= 1
        self._call(self.motion, self.records, state, rotor_speed, self.noise, wires)

    def rows_left(self) -> int:
        """Return for how many of the next measurements there is noise, at least 512; draw more if for fewer."""
        if self._left < _ROWS:
            self._draw()
        return self._left

    def take_rows(self, count: int) -> None:
        """Count measurements that ``measure_imu`` made, at most ``rows_left``."""
        self._left -= count

    def _draw(self) -> None:
        """Move the rows that are left to the front, and draw more after them."""
        row, left = int(self.motion[0]["row"]), self._left
        self.noise[:left] = self.noise[row : row + left]
        for index, stream in enumerate(self._streams):
            self.noise[left : left + _ROWS, index] = stream.rows(_ROWS)
        self._left, self.motion[0]["row"] = left + _ROWS, 0

    def _refill(self, *arrays: Any) -> None:
        self._draw()
        if self._call is measure_imu:
            state, rotor_speed, wires = arrays
            self._call = direct(measure_imu, self.motion, self.records, state, rotor_speed, self.noise, wires)


def _set_errors(imu: Record, stream: NormalStream) -> None:
    """Draw the constant errors of a sensor and the start of its wandering bias."""
    deviates = stream.first(_MATRIX_DEVIATES).reshape(2, 3, 3)
    scale = (imu["gyro_scale_error"], imu["accel_scale_error"])
    for part in range(2):
        spread = np.full((3, 3), imu["misalignment_rad"])
        np.fill_diagonal(spread, scale[part])
        imu["matrix"][part] = np.eye(3) + spread * deviates[part]
    biases = stream.first(_BIAS_DEVIATES).reshape(3, 6)
    for row, key, gyro, accel in (
        (0, "turn_on", "gyro_turn_on_bias_rad_s", "accel_turn_on_bias_m_s2"),
        (1, "per_kelvin", "gyro_temperature_rad_s_k", "accel_temperature_m_s2_k"),
        (2, "bias", "gyro_bias_instability_rad_s", "accel_bias_instability_m_s2"),
    ):
        imu[key] = biases[row] * np.repeat([imu[gyro], imu[accel]], 3)

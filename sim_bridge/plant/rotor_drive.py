"""Compiled part of the multibody plant: aerodynamic forces, drives of the rotors, and integration around MuJoCo.

MuJoCo computes accelerations from forces. This module computes the forces in each stage of a classic Runge-Kutta step:
drag, wind and disturbances on the frame; thrust b·Ω|Ω| and drag torque d·Ω|Ω| of the air on each rotor; and the drive
torque between rotor and frame. Gyroscopic torques and the reactions to drive and spin-up result from the mechanics.

The speed loop of a drive makes the rotor speed relative to the frame follow its command with a first-order lag. Its
torque follows from the equations of motion (b: the frame's six degrees of freedom, h: the hinges):

    M_bb a_b + M_bh Ω̇ + c_b = f_b          M_hb a_b + M_hh Ω̇ + c_h = τ + f_h
    τ = (M_hh − M_hb M_bb⁻¹ M_bh) Ω̇ + M_hb M_bb⁻¹ (f_b − c_b) + c_h − f_h

Both matrices are constant in body axes, because rotors are axisymmetric. The hinge then has the acceleration of the
lag within rounding, and its speed is the exact solution of the lag, which is stable for any lag. A drive of limited
torque (``rotors.py``) has a smaller Ω̇.

State and memory are those of the rigid plant, NED and FRD. MuJoCo uses NWU and FLU.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.array_items import store
from flightstack.core.compiled import compiled
from flightstack.core.contract import MAX_ROTORS, FloatArray, Record, RecordArray, Vector3
from sim_bridge.plant.battery import discharge
from sim_bridge.plant.integrator import LARGEST_TURN_RAD, next_gust
from sim_bridge.plant.layout import CONTACT, DIVERGED
from sim_bridge.plant.near_ground import thrust_ratio, wind_share
from sim_bridge.plant.rigid import Rotation, after_step, rotation
from sim_bridge.plant.rotors import drive_acceleration, half_step, take_commands

_LARGEST = 1e9  # of the sum of the state: MuJoCo resets larger states
_NEAR_M = 0.05

FLYING, NEAR, LOST = 0, 1, 2
"""Results of ``begin_step`` and ``end_stage``: no contact possible, contact possible, state diverged."""

DRIVE = np.dtype(
    [
        ("inertia", "f8", (MAX_ROTORS, MAX_ROTORS)),  # M_hh − M_hb M_bb⁻¹ M_bh
        ("coupling", "f8", (MAX_ROTORS, 6)),  # M_hb M_bb⁻¹, columns: force and torque FRD
        ("spin", "f8", MAX_ROTORS),
        ("speed", "f8", (3, MAX_ROTORS)),  # at the start, the middle and the end of the step
        ("acceleration", "f8", (3, MAX_ROTORS)),  # accelerations at these times, rad/s²
        ("angle", "f8", MAX_ROTORS),
        ("sink", "f8"),  # m, rest depth: height offset of MuJoCo's state
    ],
    align=True,
)
"""Constants of the drives, and their speeds within one step."""


@compiled
def hold_commands(memory: RecordArray, command: FloatArray, flags: int) -> None:
    """Store new commands [rad/s]; ``flags`` are those of FS_ACTUATORS."""
    take_commands(memory[0], command, flags)


@compiled
def _store_speeds(m: Record, d: Record, when: int) -> None:
    """Store the present speeds and accelerations of the rotors."""
    rotor, held, speed = m["rotor"], m["command"], m["rotor_speed"]
    for i in range(m["rotor_count"]):
        d["speed"][when, i] = speed[i]
        rate = rotor[i]["lag_rate"]
        if rotor[i]["max_torque"] < math.inf:
            d["acceleration"][when, i] = drive_acceleration(m, i, speed[i])
        else:
            d["acceleration"][when, i] = (held[i] - speed[i]) * rate if rate < math.inf else 0.0


@compiled
def _write_pose(x: FloatArray, d: Record, when: int, rotors: int, qpos: FloatArray, qvel: FloatArray) -> None:
    """Write a state to MuJoCo."""
    qpos[0], qpos[1], qpos[2] = x[0], -x[1], -x[2] - d["sink"]
    qpos[3], qpos[4], qpos[5], qpos[6] = x[6], x[7], -x[8], -x[9]
    qvel[0], qvel[1], qvel[2] = x[3], -x[4], -x[5]
    qvel[3], qvel[4], qvel[5] = x[10], -x[11], -x[12]
    for i in range(rotors):
        qpos[7 + i] = d["angle"][i]
        qvel[6 + i] = d["speed"][when, i]


@compiled
def _proximity(x: FloatArray, m: Record) -> int:
    """Return FLYING, NEAR or LOST."""
    total = 0.0
    for i in range(len(x)):
        total += abs(x[i])
    if not total < _LARGEST:  # also for NaN
        return LOST
    room = m["ground_z"] - x[2] - m["reach"]
    return NEAR if m["ground"] != 0 and room < _NEAR_M + 2.0 * m["step_s"] * abs(x[5]) else FLYING


@compiled
def show_pose(memory: RecordArray, drive: RecordArray, qpos: FloatArray, qvel: FloatArray) -> int:
    """Write the present state to MuJoCo, as in the first stage of a step; return FLYING, NEAR or LOST."""
    m, d = memory[0], drive[0]
    proximity = _proximity(m["body"], m)
    if proximity != LOST:
        store(m["stage"], m["body"])
        _store_speeds(m, d, 0)
        _write_pose(m["body"], d, 0, m["rotor_count"], qpos, qvel)
    return proximity


@compiled
def begin_step(memory: RecordArray, drive: RecordArray, qpos: FloatArray, qvel: FloatArray) -> int:
    """Advance gusts and rotors, and write the first stage to MuJoCo; return FLYING, NEAR or LOST."""
    m, d = memory[0], drive[0]
    if m["gust_scale"][0] > 0.0 or m["torque_gust_scale"][0] > 0.0:
        next_gust(m)
    proximity = show_pose(memory, drive, qpos, qvel)
    half_step(m)
    _store_speeds(m, d, 1)
    half_step(m)
    _store_speeds(m, d, 2)
    return proximity


@compiled
def _write_drive_torques(
    m: Record, d: Record, when: int, force: Vector3, torque: Vector3, bias: FloatArray, applied: FloatArray
) -> None:
    """Write the drive torques to ``applied``; ``force`` and ``torque``, FRD, are f_b − c_b of the frame."""
    inertia, row, acceleration, speed = d["inertia"], d["coupling"], d["acceleration"], d["speed"]
    rotors = m["rotor_count"]
    for i in range(rotors):
        w2 = speed[when, i] * abs(speed[when, i])
        drive_torque = bias[6 + i] - d["spin"][i] * m["rotor"][i]["drag"] * w2
        drive_torque += row[i, 0] * force.x + row[i, 1] * force.y + row[i, 2] * force.z
        drive_torque += row[i, 3] * torque.x + row[i, 4] * torque.y + row[i, 5] * torque.z
        for j in range(rotors):
            drive_torque += inertia[i, j] * acceleration[when, j]
        applied[6 + i] = drive_torque


@compiled
def _force_on_frame(x: FloatArray, r: Rotation, m: Record, share: float) -> Vector3:
    """Return drag and external force NED [N], with this share of the mean wind."""
    n, e, d = r
    wind, gust, push, drag = m["wind"], m["gust"], m["force"], m["drag"]
    vn = x[3] - share * wind[0] - gust[0]
    ve = x[4] - share * wind[1] - gust[1]
    vd = x[5] - share * wind[2] - gust[2]
    fx = -drag[0] * (n.x * vn + e.x * ve + d.x * vd)
    fy = -drag[1] * (n.y * vn + e.y * ve + d.y * vd)
    fz = -drag[2] * (n.z * vn + e.z * ve + d.z * vd)
    return Vector3(
        n.x * fx + n.y * fy + n.z * fz + push[0],
        e.x * fx + e.y * fy + e.z * fz + push[1],
        d.x * fx + d.y * fy + d.z * fz + push[2],
    )


@compiled
def apply_forces(
    memory: RecordArray, drive: RecordArray, stage: int, bias: FloatArray, contact: FloatArray,
    applied: FloatArray, on_body: FloatArray,
) -> None:  # fmt: skip
    """Write the forces of a stage (0 to 3) to MuJoCo.

    ``bias`` and ``contact`` are qfrc_bias of this stage and qfrc_constraint of the one before; results are
    ``applied`` (qfrc_applied) and ``on_body`` (xfrc_applied, from the first rotor's row on).
    """
    m, d = memory[0], drive[0]
    x, rotors, when = m["stage"], m["rotor_count"], (stage + 1) // 2
    r, torque = rotation(x), m["torque"]
    n, e, z = r
    share, lift = 1.0, 1.0  # of the mean wind; thrust over that far from the ground
    if m["alters_air"] != 0:
        share, lift = wind_share(m, x[2]), thrust_ratio(m, x[2], z.z)
    north, east, down = _force_on_frame(x, r, m, share)
    applied[0], applied[1], applied[2] = north, -east, -down
    applied[3], applied[4], applied[5] = torque[0], -torque[1], -torque[2]
    tx, ty, tz = torque[0], torque[1], torque[2]
    rotor, speed = m["rotor"], d["speed"]
    for i in range(rotors):
        w2 = speed[when, i] * abs(speed[when, i])
        thrust, twist = lift * (rotor[i]["thrust"] * w2), rotor[i]["drag"] * w2
        on_body[i, 0], on_body[i, 1], on_body[i, 2] = -n.z * thrust, e.z * thrust, z.z * thrust
        on_body[i, 3], on_body[i, 4], on_body[i, 5] = n.z * twist, -e.z * twist, -z.z * twist
        tx, ty = tx + lift * (rotor[i]["roll"] * w2), ty + lift * (rotor[i]["pitch"] * w2)
        tz += twist
        north, east, down = north - n.z * thrust, east - e.z * thrust, down - z.z * thrust
    north += contact[0] - bias[0]
    east -= contact[1] - bias[1]
    down -= contact[2] - bias[2]
    tx, ty, tz = tx + contact[3] - bias[3], ty - contact[4] + bias[4], tz - contact[5] + bias[5]
    force = Vector3(
        n.x * north + e.x * east + z.x * down,
        n.y * north + e.y * east + z.y * down,
        n.z * north + e.z * east + z.z * down,
    )
    _write_drive_torques(m, d, when, force, Vector3(tx, ty, tz), bias, applied)


@compiled
def _store_slope(x: FloatArray, qacc: FloatArray, out: FloatArray) -> None:
    """Write the derivative of the state ``x`` with MuJoCo's accelerations."""
    out[0], out[1], out[2] = x[3], x[4], x[5]
    out[3], out[4], out[5] = qacc[0], -qacc[1], -qacc[2]
    p, q, r = x[10], x[11], x[12]
    out[6] = -0.5 * (x[7] * p + x[8] * q + x[9] * r)
    out[7] = 0.5 * (x[6] * p + x[8] * r - x[9] * q)
    out[8] = 0.5 * (x[6] * q + x[9] * p - x[7] * r)
    out[9] = 0.5 * (x[6] * r + x[7] * q - x[8] * p)
    out[10], out[11], out[12] = qacc[3], -qacc[4], -qacc[5]


@compiled
def _shaft_power(m: Record, d: Record, when: int) -> float:
    """Return the mechanical power of the rotors against the air: Σ d·|Ω|³."""
    power = 0.0
    for i in range(m["rotor_count"]):
        speed = d["speed"][when, i]
        power += abs(m["rotor"][i]["drag"] * (speed * speed * speed))
    return power


@compiled
def _finish(m: Record, d: Record, h: float) -> None:
    """Combine the slopes of a step, turn the rotors and discharge the battery."""
    x, slope, speed = m["body"], m["slope"], d["speed"]
    for i in range(len(x)):
        x[i] += h / 6.0 * (slope[0, i] + 2.0 * (slope[1, i] + slope[2, i]) + slope[3, i])
    after_step(x)
    for i in range(m["rotor_count"]):
        d["angle"][i] += h / 6.0 * (speed[0, i] + 4.0 * speed[1, i] + speed[2, i])
    if m["curve_count"] > 0:
        power = _shaft_power(m, d, 0) + 4.0 * _shaft_power(m, d, 1) + _shaft_power(m, d, 2)
        discharge(m, power / 6.0, h)


@compiled
def end_stage(
    memory: RecordArray, drive: RecordArray, stage: int, qacc: FloatArray, qpos: FloatArray, qvel: FloatArray
) -> int:
    """Read MuJoCo's accelerations in a stage (0 to 3), and write the next stage to MuJoCo or end the step.

    Returns FLYING, NEAR or LOST.
    """
    m, d = memory[0], drive[0]
    x, now, h = m["body"], m["stage"], m["step_s"]
    slope = m["slope"][stage]
    _store_slope(now, qacc, slope)
    if stage == 3:
        _finish(m, d, h)
        return _proximity(x, m)
    scale = h if stage == 2 else 0.5 * h
    for i in range(len(x)):
        now[i] = x[i] + scale * slope[i]
    after_step(now)
    proximity = _proximity(now, m)
    if proximity != LOST:
        _write_pose(now, d, (stage + 2) // 2, m["rotor_count"], qpos, qvel)
    return proximity


@compiled
def show_state(memory: RecordArray, output: RecordArray, touches: int) -> int:
    """Write state and rotor speeds to ``output``; return the bits CONTACT (if ``touches``) and DIVERGED."""
    m, o = memory[0], output[0]
    x = m["body"]
    for i in range(len(x)):
        o["state"][i] = x[i]
    for i in range(m["rotor_count"]):
        o["rotor_speed"][i] = m["rotor_speed"][i]
    turn = math.sqrt(x[10] * x[10] + x[11] * x[11] + x[12] * x[12]) * m["step_s"]
    result = CONTACT if touches != 0 else 0
    return result if turn <= LARGEST_TURN_RAD and _proximity(x, m) != LOST else result | DIVERGED

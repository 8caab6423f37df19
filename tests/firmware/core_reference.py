"""Python's laws over many samples: what the core in C is compared with."""

from __future__ import annotations

import numpy as np

from flightstack.control.attitude_backstepping import (
    BacksteppingMemory,
    BacksteppingParams,
    attitude_backstepping_step,
)
from flightstack.control.attitude_pid import PidMemory, PidParams, attitude_pid_step
from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.control_law import AttitudeInputs
from flightstack.control.mixer import WORK_ROWS, mix, relative_rotor_speed
from flightstack.control.position_pid import PositionMemory, PositionParams, position_pid_step
from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import position_setpoint, vehicle_state
from flightstack.core.compiled import compiled
from flightstack.core.contract import AttitudeReference, Quaternion, Vector3, Wrench
from flightstack.core.geometry import blend, conjugate, quaternion_product, rotation_over, rotation_vector


@compiled
def position(memory, states, setpoints, params, dt_s, saturation, targets):  # type: ignore[no-untyped-def]
    for i in range(dt_s.size):
        advanced, target = position_pid_step(
            PositionMemory(*as_tuple(memory[i], 3)),
            vehicle_state(states[i]),
            position_setpoint(setpoints[i]),
            PositionParams(*as_tuple(params[i], 12)),
            dt_s[i],
            saturation[i],
        )
        store(memory[i], advanced)
        store(targets[i], target.attitude)
        targets[i, 4] = target.thrust_n


@compiled
def _quaternion(x):  # type: ignore[no-untyped-def]
    return Quaternion(x[0], x[1], x[2], x[3])


@compiled
def _vector(x):  # type: ignore[no-untyped-def]
    return Vector3(x[0], x[1], x[2])


@compiled
def rotations(turned, rates, dt_s, vectors, made):  # type: ignore[no-untyped-def]
    for i in range(dt_s.size):
        store(vectors[i], rotation_vector(_quaternion(turned[i])))
        store(made[i], rotation_over(_vector(rates[i]), dt_s[i]))


@compiled
def reference(memory, start, end, fraction, params, dt_s, attitudes, references, errors):  # type: ignore[no-untyped-def]
    for i in range(dt_s.size):
        advanced, made = attitude_reference_step(
            ReferenceMemory(*as_tuple(memory[i], 7)),
            blend(_quaternion(start[i]), _quaternion(end[i]), fraction[i]),
            ReferenceParams(*as_tuple(params[i], 4)),
            dt_s[i],
        )
        attitude = _quaternion(attitudes[i])
        made = in_body_frame(made, attitude)
        store(memory[i], advanced)
        store(references[i], made.attitude)
        store(references[i, 4:], made.rates_frd_rad_s)
        store(references[i, 7:], made.acceleration_frd_rad_s2)
        store(errors[i], rotation_vector(quaternion_product(conjugate(attitude), made.attitude)))


@compiled
def _inputs(x):  # type: ignore[no-untyped-def]
    made = AttitudeReference(_quaternion(x[7:]), _vector(x[11:]), _vector(x[14:]))
    return AttitudeInputs(_quaternion(x), _vector(x[4:]), made, _vector(x[17:]), x[20], _vector(x[21:]))


@compiled
def pid(memory, inputs, params, dt_s, torques):  # type: ignore[no-untyped-def]
    for i in range(dt_s.size):
        advanced, torque = attitude_pid_step(
            PidMemory(*as_tuple(memory[i], 3)),
            _inputs(inputs[i]),
            PidParams(*as_tuple(params[i], 14)),
            dt_s[i],
        )
        store(memory[i], advanced)
        store(torques[i], torque)


@compiled
def backstepping(inputs, params, torques):  # type: ignore[no-untyped-def]
    for i in range(torques.shape[0]):
        _, torque = attitude_backstepping_step(
            BacksteppingMemory(0.0), _inputs(inputs[i]), BacksteppingParams(*as_tuple(params[i], 12)), 0.0
        )
        store(torques[i], torque)


@compiled
def mixer(wrenches, rotors, speeds, achieved, relative):  # type: ignore[no-untyped-def]
    spin = rotors.spin
    work = np.zeros((WORK_ROWS, spin.size))
    for i in range(wrenches.shape[0]):
        w = wrenches[i]
        made = mix(Wrench(w[0], Vector3(w[1], w[2], w[3])), rotors, speeds[i], work)
        achieved[i, 0] = made.thrust_n
        store(achieved[i, 1:], made.torque_frd_n_m)
        relative[i] = relative_rotor_speed(speeds[i], spin)

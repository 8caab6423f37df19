"""Kernels of the control loops: the outer one (guidance and position) and the inner one (attitude and mixer).

``specialise`` binds the laws of a controller to both. Each takes the values of the laws' types inside one function: the
cache of a function with such arguments would refer to types of a user's package, which may be gone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.control_law import AttitudeInputs, ControlLaw, NoMemory, NoParams
from flightstack.control.controller import ATTITUDE, GUIDANCE, MIXER, POSITION
from flightstack.control.controller_loading import fields_of
from flightstack.control.guidance_direct import direct_step
from flightstack.control.mixer import WORK_ROWS, Mixer, allocation_step, relative_rotor_speed
from flightstack.control.position_pid import (
    PositionMemory,
    PositionParams,
    position_pid_step,
)
from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import (
    achieved_wrench,
    all_finite,
    attitude_target,
    commanded_wrench,
    position_setpoint,
    store_attitude_target,
    store_status,
    store_wrenches,
    vehicle_state,
)
from flightstack.core.compiled import compiled
from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    AttitudeReference,
    FloatArray,
    LoopRow,
    LoopStatus,
    PositionSetpoint,
    RecordArray,
    Vector3,
    Wrench,
)
from flightstack.core.geometry import blend, conjugate, quaternion_product, rotation_vector
from flightstack.core.portable_math import LARGEST_ANGLE_RAD

REFERENCE_MEMORY_SIZE = 7
REFERENCE_PARAMS_SIZE = 4

REFERENCE_AT = LoopRow.REFERENCE_ATTITUDE.start
COMMAND_AT = LoopRow.ROTOR_COMMAND.start
SPEED_AT = LoopRow.ROTOR_SPEED.start
INPUT_NOT_FINITE = LoopStatus.INPUT_NOT_FINITE
OUTPUT_NOT_FINITE = LoopStatus.OUTPUT_NOT_FINITE

# bound by ``specialise`` to the laws of the controller
guidance_step: Any = direct_step
GuidanceMemory: Any = NoMemory
GuidanceParams: Any = NoParams
GUIDANCE_MEMORY_SIZE, GUIDANCE_PARAMS_SIZE = 1, 1
position_step: Any = position_pid_step
PositionLawMemory: Any = PositionMemory
PositionLawParams: Any = PositionParams
POSITION_MEMORY_SIZE, POSITION_PARAMS_SIZE = 3, 12
controller_step: Any = None
ControllerMemory: Any = None
ControllerParams: Any = None
CONTROLLER_MEMORY_SIZE = 0
CONTROLLER_PARAMS_SIZE = 0
mixer_step: Any = allocation_step
MixerMemory: Any = NoMemory
MixerParams: Any = NoParams
MIXER_MEMORY_SIZE, MIXER_PARAMS_SIZE = 1, 1
BOUND_NAMES = {
    GUIDANCE: ("guidance_step", "GuidanceMemory", "GuidanceParams", "GUIDANCE"),
    POSITION: ("position_step", "PositionLawMemory", "PositionLawParams", "POSITION"),
    ATTITUDE: ("controller_step", "ControllerMemory", "ControllerParams", "CONTROLLER"),
    MIXER: ("mixer_step", "MixerMemory", "MixerParams", "MIXER"),
}
"""Names of step, memory, parameters and sizes of each role."""


@compiled
def _is_sound(setpoint: PositionSetpoint) -> bool:
    """Return True if all numbers are finite, and the yaw is within ±10⁴ rad, the limit of ``sin_cos``."""
    p, v, a = setpoint.position_ned_m, setpoint.velocity_ned_m_s, setpoint.acceleration_ned_m_s2
    return (
        _is_finite(p)
        and _is_finite(v)
        and _is_finite(a)
        and abs(setpoint.yaw_rad) <= LARGEST_ANGLE_RAD
        and math.isfinite(setpoint.yaw_rate_rad_s)
    )


@compiled
def outer_kernel(
    state: FloatArray,
    setpoint: FloatArray,
    memory: FloatArray,
    params: FloatArray,
    last: FloatArray,
    dt_s: float,
    target: FloatArray,
) -> None:
    """Run guidance and the position loop: update ``memory`` and ``target`` (5,).

    ``memory`` and ``params`` hold those of the position law, then those of guidance. Nothing changes if a number is not
    finite, or if a yaw setpoint is beyond ±10⁴ rad. ``last`` (48,) is the inner loop's row of the previous tick, which
    shows saturation of the mixer. ``specialise`` binds other laws to this template, and to it alone.
    """
    vehicle, desired = vehicle_state(state), position_setpoint(setpoint)
    if not (all_finite(state) and _is_sound(desired)):
        return
    guided, desired = guidance_step(
        GuidanceMemory(*as_tuple(memory[POSITION_MEMORY_SIZE:], GUIDANCE_MEMORY_SIZE)),
        vehicle,
        desired,
        GuidanceParams(*as_tuple(params[POSITION_PARAMS_SIZE:], GUIDANCE_PARAMS_SIZE)),
        dt_s,
    )
    if not (_is_sound(desired) and all_finite(guided)):
        return
    advanced, new_target = position_step(
        PositionLawMemory(*as_tuple(memory, POSITION_MEMORY_SIZE)),
        vehicle,
        desired,
        PositionLawParams(*as_tuple(params, POSITION_PARAMS_SIZE)),
        dt_s,
        _saturation_direction(commanded_wrench(last).thrust_n, achieved_wrench(last).thrust_n, 1e-9),
    )
    if not (all_finite(new_target.attitude) and math.isfinite(new_target.thrust_n) and all_finite(advanced)):
        return
    store(memory, advanced)
    store(memory[POSITION_MEMORY_SIZE:], guided)
    store_attitude_target(target, new_target)


@compiled
def _saturation_direction(demanded: float, achieved: float, resolution: float) -> float:
    """Return the direction of saturation: −1, 0 or +1."""
    if demanded - achieved > resolution:
        return 1.0
    if achieved - demanded > resolution:
        return -1.0
    return 0.0


@compiled
def _store_reference(row: FloatArray, reference: AttitudeReference) -> None:
    store(row[REFERENCE_AT:], reference.attitude)
    store(row[REFERENCE_AT + 4 :], reference.rates_frd_rad_s)
    store(row[REFERENCE_AT + 7 :], reference.acceleration_frd_rad_s2)


@compiled
def _is_finite(v: Vector3) -> bool:
    return math.isfinite(v.x) and math.isfinite(v.y) and math.isfinite(v.z)


@compiled
def _saturation(row: FloatArray) -> Vector3:
    """Return the saturation of each axis in ``row``."""
    commanded, achieved = commanded_wrench(row).torque_frd_n_m, achieved_wrench(row).torque_frd_n_m
    return Vector3(
        _saturation_direction(commanded.x, achieved.x, 1e-9),
        _saturation_direction(commanded.y, achieved.y, 1e-9),
        _saturation_direction(commanded.z, achieved.z, 1e-9),
    )


@compiled
def _status(row: FloatArray) -> int:
    s = _saturation(row)
    thrust = _saturation_direction(commanded_wrench(row).thrust_n, achieved_wrench(row).thrust_n, 1e-9)
    return 2 * int(s.x != 0.0) + 4 * int(s.y != 0.0) + 8 * int(s.z != 0.0) + 16 * int(thrust != 0.0)


def inner_layout(rotors: int, attitude: ControlLaw, mixer: ControlLaw) -> np.dtype[np.void]:
    """Return the layout of the inner loop's memory: one record, because each array argument costs time.

    ``last`` is the row of the previous tick: it provides saturation and Ω_r, and is repeated with a status bit if an
    input or a result is not finite.
    """
    return np.dtype(
        [
            # state
            ("last_target", "f8", (ATTITUDE_TARGET_SIZE,)),
            ("target", "f8", (ATTITUDE_TARGET_SIZE,)),
            ("reference", "f8", (REFERENCE_MEMORY_SIZE,)),
            ("attitude", "f8", _memory_shape(attitude)),
            ("mixer", "f8", _memory_shape(mixer)),
            ("last", "f8", (LoopRow.SIZE,)),
            ("work", "f8", (WORK_ROWS, rotors)),
            # parameters
            ("dt_s", "f8"),
            ("reference_params", "f8", (REFERENCE_PARAMS_SIZE,)),
            ("attitude_params", "f8", _params_shape(attitude)),
            ("mixer_params", "f8", _params_shape(mixer)),
            ("allocation", "f8", (rotors, 4)),
            ("effectiveness", "f8", (4, rotors)),
            ("low", "f8", (rotors,)),
            ("high", "f8", (rotors,)),
            ("spin", "f8", (rotors,)),
            ("middle", "f8", (rotors,)),
            ("reach", "f8", (rotors,)),
            ("is_inverse", "f8"),
            ("is_even", "f8"),
        ]
    )


def _memory_shape(law: ControlLaw) -> tuple[int]:
    return (len(law.initial_memory),)


def _params_shape(law: ControlLaw) -> tuple[int]:
    return (len(fields_of(law.params_type)),)


@compiled
def _attitude_inputs(
    state: FloatArray,
    target: FloatArray,
    last_target: FloatArray,
    fraction: float,
    memory: FloatArray,
    params: FloatArray,
    dt_s: float,
    last: FloatArray,
    spin: FloatArray,
) -> tuple[ReferenceMemory, AttitudeInputs]:
    """Run the reference filter; return its next memory and the inputs of the attitude law.

    The target is interpolated from ``last_target`` (previous outer tick) to ``target``. Without interpolation, steps of
    the target would excite the rotors at the outer rate.
    """
    vehicle = vehicle_state(state)
    filtered, reference = attitude_reference_step(
        ReferenceMemory(*as_tuple(memory, REFERENCE_MEMORY_SIZE)),
        blend(attitude_target(last_target).attitude, attitude_target(target).attitude, fraction),
        ReferenceParams(*as_tuple(params, REFERENCE_PARAMS_SIZE)),
        dt_s,
    )
    reference = in_body_frame(reference, vehicle.attitude)
    return filtered, AttitudeInputs(
        vehicle.attitude,
        vehicle.rates_frd_rad_s,
        reference,
        rotation_vector(quaternion_product(conjugate(vehicle.attitude), reference.attitude)),
        relative_rotor_speed(last[COMMAND_AT:], spin),
        _saturation(last),
    )


@compiled
def _is_reference_finite(memory: ReferenceMemory, reference: AttitudeReference) -> bool:
    return (
        all_finite(memory)
        and all_finite(reference.attitude)
        and _is_finite(reference.rates_frd_rad_s)
        and _is_finite(reference.acceleration_frd_rad_s2)
    )


@compiled
def _repeat(row: FloatArray, last: FloatArray, status: int) -> None:
    store(row, last)
    store_status(row, status)


@compiled
def _store_row(
    row: FloatArray,
    state: FloatArray,
    reference: AttitudeReference,
    demanded: Wrench,
    achieved: Wrench,
    rotors: int,
    rotor_speed_rad_s: FloatArray,
) -> None:
    """Write a tick to ``row``, which has the commands of the rotors already."""
    store(row, state)
    _store_reference(row, reference)
    store_wrenches(row, demanded, achieved)
    row[COMMAND_AT + rotors : SPEED_AT] = 0.0
    store(row[SPEED_AT:], rotor_speed_rad_s)
    store_status(row, _status(row))


def inner_kernel(
    state: FloatArray, fraction: float, rotor_speed_rad_s: FloatArray, memory: RecordArray, row: FloatArray
) -> None:
    """Run reference filter, attitude law and mixer; write ``row`` (48,) and update ``memory`` of ``inner_layout``.

    ``fraction`` is the elapsed part of the outer period.
    """
    m = memory[0]
    target, last, work, dt_s = m["target"], m["last"], m["work"], m["dt_s"]
    if not (all_finite(state) and all_finite(target)):
        _repeat(row, last, INPUT_NOT_FINITE)
        return
    mixer = Mixer(
        m["allocation"], m["effectiveness"], m["low"], m["high"], m["spin"],
        m["middle"], m["reach"], m["is_inverse"], m["is_even"],
    )  # fmt: skip
    filtered, inputs = _attitude_inputs(
        state, target, m["last_target"], fraction, m["reference"], m["reference_params"], dt_s, last, mixer.spin
    )  # fmt: skip
    controller_memory = ControllerMemory(*as_tuple(m["attitude"], CONTROLLER_MEMORY_SIZE))
    controller_params = ControllerParams(*as_tuple(m["attitude_params"], CONTROLLER_PARAMS_SIZE))
    advanced, torque = controller_step(controller_memory, inputs, controller_params, dt_s)
    if not (_is_reference_finite(filtered, inputs.reference) and _is_finite(torque) and all_finite(advanced)):
        _repeat(row, last, OUTPUT_NOT_FINITE)
        return
    demanded, commands = Wrench(target[4], torque), row[COMMAND_AT:]
    mixer_memory = MixerMemory(*as_tuple(m["mixer"], MIXER_MEMORY_SIZE))
    mixer_params = MixerParams(*as_tuple(m["mixer_params"], MIXER_PARAMS_SIZE))
    mixed, achieved = mixer_step(mixer_memory, demanded, mixer, mixer_params, dt_s, commands, work)
    is_achieved = math.isfinite(achieved.thrust_n) and _is_finite(achieved.torque_frd_n_m)
    if not (
        is_achieved and all_finite(mixed) and all_finite(commands[: mixer.spin.size])
    ):  # a sum overflowed
        _repeat(row, last, OUTPUT_NOT_FINITE)
        return
    store(m["reference"], filtered)
    store(m["attitude"], advanced)
    store(m["mixer"], mixed)
    _store_row(row, state, inputs.reference, demanded, achieved, mixer.spin.size, rotor_speed_rad_s)
    store(last, row)

"""Expected output of each stage of the loops, from the inputs that a target reports for that stage.

A replay of the loops as a whole accumulates rounding: the attitude reference amplifies 1e-7 rad into 1e-3 rad/s², and
every later stage inherits it. Here each stage is computed in float64 from what the target itself reported: the attitude
law from the target's reference, the mixer from the target's wrench, the reference filter from the target's previous
reference. What remains is the rounding of one stage in one step. Only the integrators run on; they are not reported.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flightstack.control.attitude_controller import AttitudeController, AttitudeInputs
from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.loop_parameters import LoopParameters, loop_numbers
from flightstack.control.loops import (
    POSITION_MEMORY_SIZE,
    POSITION_PARAMS_SIZE,
    REFERENCE_MEMORY_SIZE,
    REFERENCE_PARAMS_SIZE,
    inner_layout,
    outer_kernel,
)
from flightstack.control.mixer import Mixer, mix, mixer_for, relative_rotor_speed
from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import (
    achieved_wrench,
    attitude_target,
    commanded_wrench,
    store_wrenches,
    vehicle_state,
)
from flightstack.core.compiled import compiled, specialise
from flightstack.core.contract import (
    STATE_SIZE,
    AttitudeReference,
    FloatArray,
    LoopFlags,
    LoopRow,
    LoopStatus,
    Quaternion,
    Record,
    RecordArray,
    Vector3,
    Wrench,
)
from flightstack.core.geometry import blend, conjugate, quaternion_product, rotate, rotation_vector
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE, SETPOINT_AT, TARGET_AT, LoopsSetup

REFERENCE_AT, THRUST_AT, ACHIEVED_AT, COMMAND_AT, STATUS_AT = 5, 15, 19, 23, 31
OUTER_DUE, SET_TARGET, RESET = LoopFlags.OUTER_DUE, LoopFlags.SET_TARGET, LoopFlags.RESET
NOT_FINITE = LoopStatus.INPUT_NOT_FINITE | LoopStatus.OUTPUT_NOT_FINITE
ROW_COMMAND = LoopRow.ROTOR_COMMAND.start
ROLL, PITCH, YAW, THRUST = (
    LoopStatus.ROLL_SATURATED, LoopStatus.PITCH_SATURATED, LoopStatus.YAW_SATURATED, LoopStatus.THRUST_SATURATED,
)  # fmt: skip
RESOLUTION = 1e-9
"""Difference of demanded and achieved wrench [N, N m] above which the mixer is saturated, as in the loops."""

# bound by ``specialise`` to the selected controller
controller_step: Any = None
ControllerMemory: Any = None
ControllerParams: Any = None
CONTROLLER_MEMORY_SIZE = 0
CONTROLLER_PARAMS_SIZE = 0


@compiled
def _reset(m: Record, inputs: FloatArray) -> None:
    """Start at rest at this state, as the loops do."""
    for index in range(POSITION_MEMORY_SIZE):
        m["position"][index] = 0.0
    for index in range(REFERENCE_MEMORY_SIZE):
        m["reference"][index] = 0.0
    for index in range(4):
        m["reference"][index] = inputs[6 + index]
        m["target"][index] = inputs[6 + index]
    m["target"][4] = 0.0
    for index in range(m["last"].size):
        m["last"][index] = 0.0
    store(m["controller"], m["controller_initial"])


@compiled
def _aim(m: Record, inputs: FloatArray, flags: int) -> None:
    """Update the attitude target as the flags require."""
    if flags & RESET:
        _reset(m, inputs)
    if flags & (SET_TARGET | OUTER_DUE | RESET):
        store(m["last_target"], m["target"])
        m["fraction"][0] = 0.0
    if flags & SET_TARGET:
        store(m["target"], inputs[TARGET_AT:INPUT_SIZE])
    if flags & OUTER_DUE:
        outer_kernel(
            inputs[:STATE_SIZE], inputs[SETPOINT_AT:TARGET_AT], m["position"], m["position_params"], m["last"],
            m["outer_dt_s"], m["target"],
        )  # fmt: skip
    m["fraction"][0] += m["fraction_step"]


@compiled
def _filter(m: Record, attitude: Quaternion, expected: FloatArray) -> None:
    """Write the expected attitude reference."""
    aim = blend(
        attitude_target(m["last_target"]).attitude, attitude_target(m["target"]).attitude, m["fraction"][0]
    )
    _, filtered = attitude_reference_step(
        ReferenceMemory(*as_tuple(m["reference"], REFERENCE_MEMORY_SIZE)),
        aim,
        ReferenceParams(*as_tuple(m["reference_params"], REFERENCE_PARAMS_SIZE)),
        m["dt_s"],
    )
    reference = in_body_frame(filtered, attitude)
    store(expected[REFERENCE_AT:], reference.attitude)
    store(expected[REFERENCE_AT + 4 :], reference.rates_frd_rad_s)
    store(expected[REFERENCE_AT + 7 :], reference.acceleration_frd_rad_s2)


@compiled
def _reported_reference(out: FloatArray) -> AttitudeReference:
    return AttitudeReference(
        Quaternion(out[5], out[6], out[7], out[8]),
        Vector3(out[9], out[10], out[11]),
        Vector3(out[12], out[13], out[14]),
    )


@compiled
def _mix(m: Record, out: FloatArray, expected: FloatArray) -> None:
    """Write the expected rotor commands, achieved wrench and status for the reported wrench."""
    mixer = _mixer(m)
    demanded = Wrench(out[THRUST_AT], Vector3(out[16], out[17], out[18]))
    achieved = mix(demanded, mixer, expected[COMMAND_AT:STATUS_AT], m["work"])
    expected[ACHIEVED_AT] = achieved.thrust_n
    store(expected[ACHIEVED_AT + 1 :], achieved.torque_frd_n_m)
    expected[COMMAND_AT + mixer.spin.size : STATUS_AT] = 0.0
    expected[STATUS_AT] = _status(demanded, achieved)


@compiled
def _mixer(m: Record) -> Mixer:
    return Mixer(
        m["allocation"], m["effectiveness"], m["low"], m["high"], m["spin"],
        m["middle"], m["reach"], m["is_inverse"], m["is_even"],
    )  # fmt: skip


@compiled
def _direction(lag: float) -> float:
    """Return the direction of saturation: −1, 0 or +1."""
    if lag > RESOLUTION:
        return 1.0
    return -1.0 if lag < -RESOLUTION else 0.0


@compiled
def _saturation(last: FloatArray) -> Vector3:
    """Return the saturation of each axis in the row of the previous step."""
    demanded, achieved = commanded_wrench(last).torque_frd_n_m, achieved_wrench(last).torque_frd_n_m
    return Vector3(
        _direction(demanded.x - achieved.x),
        _direction(demanded.y - achieved.y),
        _direction(demanded.z - achieved.z),
    )


@compiled
def _status(demanded: Wrench, achieved: Wrench) -> float:
    """Return the expected bits of ``LoopStatus``."""
    want, have = demanded.torque_frd_n_m, achieved.torque_frd_n_m
    status = ROLL * int(_direction(want.x - have.x) != 0.0)
    status += PITCH * int(_direction(want.y - have.y) != 0.0)
    status += YAW * int(_direction(want.z - have.z) != 0.0)
    status += THRUST * int(_direction(demanded.thrust_n - achieved.thrust_n) != 0.0)
    return float(status)


@compiled
def _adopt(m: Record, attitude: Quaternion, out: FloatArray) -> None:
    """Take the reported outputs as the state of the next step.

    The achieved wrench counts as the commanded one where the target reports no saturation: it may differ by rounding.
    """
    reference, status = _reported_reference(out), int(out[STATUS_AT])
    turn = quaternion_product(conjugate(attitude), reference.attitude)
    store(m["reference"], reference.attitude)
    store(m["reference"][4:], rotate(conjugate(turn), reference.rates_frd_rad_s))
    last = m["last"]
    store(last[ROW_COMMAND:], out[COMMAND_AT:STATUS_AT])
    demanded = Wrench(out[15], Vector3(out[16], out[17], out[18]))
    achieved = Wrench(
        out[19] if status & THRUST else out[15],
        Vector3(
            out[20] if status & ROLL else out[16],
            out[21] if status & PITCH else out[17],
            out[22] if status & YAW else out[18],
        ),
    )
    store_wrenches(last, demanded, achieved)


def stages_kernel(
    inputs: FloatArray, flags: np.ndarray[Any, np.dtype[np.int64]], outputs: FloatArray, memory: RecordArray,
    expected: FloatArray,
) -> None:  # fmt: skip
    """Write ``expected`` (n, 32) for ``inputs`` (n, 29), ``flags`` (n,) and the reported ``outputs`` (n, 32).

    A step with a status that is not finite repeats an earlier output, and is taken as it is. ``specialise`` binds the
    controller to this template.
    """
    m = memory[0]
    for step in range(len(flags)):
        given, out, wanted = inputs[step], outputs[step], expected[step]
        _aim(m, given, flags[step])
        store(wanted, m["target"])
        store(m["target"], out[:REFERENCE_AT])
        if int(out[STATUS_AT]) & NOT_FINITE:
            store(wanted, out)
            continue
        vehicle = vehicle_state(given[:STATE_SIZE])
        _filter(m, vehicle.attitude, wanted)
        reference = _reported_reference(out)
        law_inputs = AttitudeInputs(
            vehicle.attitude,
            vehicle.rates_frd_rad_s,
            reference,
            rotation_vector(quaternion_product(conjugate(vehicle.attitude), reference.attitude)),
            relative_rotor_speed(m["last"][ROW_COMMAND:], m["spin"]),
            _saturation(m["last"]),
        )
        advanced, torque = controller_step(
            ControllerMemory(*as_tuple(m["controller"], CONTROLLER_MEMORY_SIZE)),
            law_inputs,
            ControllerParams(*as_tuple(m["controller_params"], CONTROLLER_PARAMS_SIZE)),
            m["dt_s"],
        )
        for index in range(CONTROLLER_MEMORY_SIZE):
            m["controller"][index] = advanced[index]
        wanted[THRUST_AT] = m["target"][4]
        store(wanted[THRUST_AT + 1 :], torque)
        _mix(m, out, wanted)
        _adopt(m, vehicle.attitude, out)


class StageModel:
    """The stages of the loops of one configuration; the integrators continue from call to call."""

    def __init__(self, setup: LoopsSetup) -> None:
        """Start with the numbers of ``setup``; raise ConfigError."""
        vehicle, controller = setup.vehicle, setup.controller
        numbers = loop_numbers(vehicle, controller, setup.gains, setup.max_tilt_rad)
        inner = inner_layout(len(vehicle.rotors), len(controller.initial_memory), numbers.controller.size)
        self._memory: RecordArray = np.zeros(1, np.dtype([*inner.descr, *_more_fields(controller)]))
        record = self._memory[0]
        record["dt_s"], record["outer_dt_s"] = 1.0 / setup.inner_hz, setup.divisor / setup.inner_hz
        record["fraction_step"] = 1.0 / setup.divisor
        record["controller_initial"] = record["controller"] = controller.initial_memory
        for name in ("position", "reference", "controller"):
            record[f"{name}_params"] = getattr(numbers, name)
        for name, values in mixer_for(vehicle)._asdict().items():
            record[name] = values
        live = numbers._replace(
            position=record["position_params"],
            reference=record["reference_params"],
            controller=record["controller_params"],
        )
        self._parameters = LoopParameters(live, controller, record["controller"])
        self.parameters = frozenset(spec.name for spec in numbers.specs)
        """Names of the parameters that can be set."""
        self._kernel = specialise(
            stages_kernel,
            controller.key,
            controller_step=controller.step,
            ControllerMemory=controller.memory_type,
            ControllerParams=controller.params_type,
            CONTROLLER_MEMORY_SIZE=len(controller.initial_memory),
            CONTROLLER_PARAMS_SIZE=numbers.controller.size,
        )

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter from the next step on; raise KeyError if unknown."""
        self._parameters.set(name, value)

    def expected(
        self, inputs: FloatArray, flags: np.ndarray[Any, np.dtype[np.int64]], outputs: FloatArray
    ) -> FloatArray:
        """Return the expected outputs (n, 32) of the next steps; see ``stages_kernel``."""
        wanted = np.zeros((len(flags), OUTPUT_SIZE))
        self._kernel(inputs, flags, outputs, self._memory, wanted)
        return wanted


def _more_fields(controller: AttitudeController) -> list[tuple[Any, ...]]:
    return [
        ("position", "f8", (POSITION_MEMORY_SIZE,)),
        ("position_params", "f8", (POSITION_PARAMS_SIZE,)),
        ("controller_initial", "f8", (len(controller.initial_memory),)),
        ("outer_dt_s", "f8"),
        ("fraction", "f8", (1,)),
        ("fraction_step", "f8"),
    ]

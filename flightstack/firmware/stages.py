"""Expected output of each stage of the loops, from the inputs that a target reports for that stage.

A replay of the loops as a whole accumulates rounding: the attitude reference amplifies 1e-7 rad into 1e-3 rad/s², and
every later stage inherits it. Here each stage is computed in float64 from what the target itself reported: the attitude
law from the target's reference, the mixer from the target's wrench, the reference filter from the target's previous
reference. What remains is the rounding of one stage in one step. Only the integrators run on; they are not reported.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np

from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.control_law import AttitudeInputs, CStep, NoMemory, NoParams
from flightstack.control.controller import ATTITUDE, GUIDANCE, MIXER, POSITION, Controller, controller_of
from flightstack.control.controller_loading import check_python
from flightstack.control.loop_kernels import (
    REFERENCE_MEMORY_SIZE,
    REFERENCE_PARAMS_SIZE,
    inner_layout,
    outer_kernel,
)
from flightstack.control.loop_parameters import LoopNumbers, LoopParameters, loop_numbers
from flightstack.control.loops import bound_to, joined, outer_kernel_of
from flightstack.control.mixer import Mixer, allocation_step, mixer_for, relative_rotor_speed
from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import (
    achieved_wrench,
    attitude_target,
    commanded_wrench,
    store_wrenches,
    vehicle_state,
)
from flightstack.core.compiled import compiled
from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    MAX_ROTORS,
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
    VehicleState,
    Wrench,
)
from flightstack.core.geometry import blend, conjugate, quaternion_product, rotate, rotation_vector
from flightstack.core.record_types import dtype_of
from flightstack.firmware.c_loops import INPUT_SIZE, OUTPUT_SIZE, SETPOINT_AT, TARGET_AT, LoopsSetup

OUTER_DUE, SET_TARGET, RESET = LoopFlags.OUTER_DUE, LoopFlags.SET_TARGET, LoopFlags.RESET
NOT_FINITE = LoopStatus.INPUT_NOT_FINITE | LoopStatus.OUTPUT_NOT_FINITE
ROW_COMMAND = LoopRow.ROTOR_COMMAND.start
ROLL, PITCH, YAW, THRUST = (
    LoopStatus.ROLL_SATURATED, LoopStatus.PITCH_SATURATED, LoopStatus.YAW_SATURATED, LoopStatus.THRUST_SATURATED,
)  # fmt: skip
RESOLUTION = 1e-9
"""Difference of demanded and achieved wrench [N, N m] above which the mixer is saturated, as in the loops."""

_Flags: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]


class StageOutputs(NamedTuple):
    """Output of each stage in one step, as a target reports them."""

    target: Annotated[FloatArray, ATTITUDE_TARGET_SIZE]
    attitude: Annotated[FloatArray, 4]
    """Of the reference; its rates and accelerations too."""
    rates_frd_rad_s: Annotated[FloatArray, 3]
    acceleration_frd_rad_s2: Annotated[FloatArray, 3]
    thrust_n: float
    """Demanded of the mixer; the torque too."""
    torque_frd_n_m: Annotated[FloatArray, 3]
    achieved_thrust_n: float
    achieved_torque_frd_n_m: Annotated[FloatArray, 3]
    commands_rad_s: Annotated[FloatArray, MAX_ROTORS]
    status: float
    """Bits of ``LoopStatus``."""


STAGE_OUTPUTS = dtype_of(StageOutputs)
_Outputs: TypeAlias = Annotated[Record, StageOutputs]

# bound by ``specialise`` to the laws of the controller
controller_step: Any = None
ControllerMemory: Any = None
ControllerParams: Any = None
CONTROLLER_MEMORY_SIZE = 0
CONTROLLER_PARAMS_SIZE = 0
mixer_step: Any = allocation_step
MixerMemory: Any = NoMemory
MixerParams: Any = NoParams
MIXER_MEMORY_SIZE, MIXER_PARAMS_SIZE = 1, 1


@compiled
def _reset(m: Record, inputs: FloatArray) -> None:
    """Start at rest at this state, as the loops do."""
    store(m["outer"], m["outer_initial"])
    store(m["attitude"], m["attitude_initial"])
    store(m["mixer"], m["mixer_initial"])
    for index in range(REFERENCE_MEMORY_SIZE):
        m["reference"][index] = 0.0
    for index in range(4):
        m["reference"][index] = inputs[6 + index]
        m["target"][index] = inputs[6 + index]
    m["target"][4] = 0.0
    for index in range(m["last"].size):
        m["last"][index] = 0.0


@compiled
def _update_target(m: Record, inputs: FloatArray, flags: int) -> None:
    """Update the attitude target as the flags require, but for the outer loop."""
    if flags & RESET:
        _reset(m, inputs)
    if flags & (SET_TARGET | OUTER_DUE | RESET):
        store(m["last_target"], m["target"])
        m["fraction"][0] = 0.0
    if flags & SET_TARGET:
        store(m["target"], inputs[TARGET_AT:INPUT_SIZE])
    m["fraction"][0] += m["fraction_step"]


@compiled
def _filter(m: Record, attitude: Quaternion, expected: _Outputs) -> None:
    """Write the expected attitude reference."""
    target = blend(
        attitude_target(m["last_target"]).attitude, attitude_target(m["target"]).attitude, m["fraction"][0]
    )
    _, filtered = attitude_reference_step(
        ReferenceMemory(*as_tuple(m["reference"], REFERENCE_MEMORY_SIZE)),
        target,
        ReferenceParams(*as_tuple(m["reference_params"], REFERENCE_PARAMS_SIZE)),
        m["dt_s"],
    )
    reference = in_body_frame(filtered, attitude)
    store(expected["attitude"], reference.attitude)
    store(expected["rates_frd_rad_s"], reference.rates_frd_rad_s)
    store(expected["acceleration_frd_rad_s2"], reference.acceleration_frd_rad_s2)


@compiled
def _reported_reference(out: _Outputs) -> AttitudeReference:
    return AttitudeReference(
        Quaternion(*as_tuple(out["attitude"], 4)),
        Vector3(*as_tuple(out["rates_frd_rad_s"], 3)),
        Vector3(*as_tuple(out["acceleration_frd_rad_s2"], 3)),
    )


@compiled
def _law_inputs(
    vehicle: VehicleState, reference: AttitudeReference, last: FloatArray, spin: FloatArray
) -> AttitudeInputs:
    return AttitudeInputs(
        vehicle.attitude,
        vehicle.rates_frd_rad_s,
        reference,
        rotation_vector(quaternion_product(conjugate(vehicle.attitude), reference.attitude)),
        relative_rotor_speed(last[ROW_COMMAND:], spin),
        _saturation(last),
    )


@compiled
def _reported_wrench(out: _Outputs) -> Wrench:
    return Wrench(out["thrust_n"], Vector3(*as_tuple(out["torque_frd_n_m"], 3)))


@compiled
def _store_mixed(demanded: Wrench, achieved: Wrench, rotors: int, expected: _Outputs) -> None:
    """Write the expected achieved wrench and status."""
    expected["achieved_thrust_n"] = achieved.thrust_n
    store(expected["achieved_torque_frd_n_m"], achieved.torque_frd_n_m)
    expected["commands_rad_s"][rotors:] = 0.0
    expected["status"] = _status(demanded, achieved)


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
def _adopt(m: Record, attitude: Quaternion, out: _Outputs) -> None:
    """Take the reported outputs as the state of the next step.

    The achieved wrench counts as the commanded one where the target reports no saturation: it may differ by rounding.
    """
    reference, status = _reported_reference(out), int(out["status"])
    turn = quaternion_product(conjugate(attitude), reference.attitude)
    store(m["reference"], reference.attitude)
    store(m["reference"][4:], rotate(conjugate(turn), reference.rates_frd_rad_s))
    last = m["last"]
    store(last[ROW_COMMAND:], out["commands_rad_s"])
    demanded, reported = _reported_wrench(out), Vector3(*as_tuple(out["achieved_torque_frd_n_m"], 3))
    torque = demanded.torque_frd_n_m
    achieved = Wrench(
        out["achieved_thrust_n"] if status & THRUST else demanded.thrust_n,
        Vector3(
            reported.x if status & ROLL else torque.x,
            reported.y if status & PITCH else torque.y,
            reported.z if status & YAW else torque.z,
        ),
    )
    store_wrenches(last, demanded, achieved)


def stages_kernel(
    inputs: FloatArray, flags: _Flags, outputs: RecordArray, memory: RecordArray, expected: RecordArray
) -> None:
    """Write ``expected`` (n,) for ``inputs`` (n, 29), ``flags`` (n,) and the reported ``outputs`` (n,).

    A step whose status is not finite repeats an earlier output. ``specialise`` binds the controller to this template.
    """
    m, mixer = memory[0], _mixer(memory[0])
    for step in range(len(flags)):
        given, out, wanted = inputs[step], outputs[step], expected[step]
        _update_target(m, given, flags[step])
        if flags[step] & OUTER_DUE:
            outer_kernel(
                given[:STATE_SIZE], given[SETPOINT_AT:TARGET_AT], m["outer"], m["outer_params"], m["last"],
                m["outer_dt_s"], m["target"],
            )  # fmt: skip
        store(wanted["target"], m["target"])
        store(m["target"], out["target"])
        if int(out["status"]) & NOT_FINITE:
            expected[step] = outputs[step]
            continue
        vehicle = vehicle_state(given[:STATE_SIZE])
        _filter(m, vehicle.attitude, wanted)
        advanced, torque = controller_step(
            ControllerMemory(*as_tuple(m["attitude"], CONTROLLER_MEMORY_SIZE)),
            _law_inputs(vehicle, _reported_reference(out), m["last"], mixer.spin),
            ControllerParams(*as_tuple(m["attitude_params"], CONTROLLER_PARAMS_SIZE)), m["dt_s"],
        )  # fmt: skip
        store(m["attitude"], advanced)
        wanted["thrust_n"] = m["target"][4]
        store(wanted["torque_frd_n_m"], torque)
        demanded = _reported_wrench(out)
        mixed, achieved = mixer_step(
            MixerMemory(*as_tuple(m["mixer"], MIXER_MEMORY_SIZE)), demanded, mixer,
            MixerParams(*as_tuple(m["mixer_params"], MIXER_PARAMS_SIZE)), m["dt_s"],
            wanted["commands_rad_s"], m["work"],
        )  # fmt: skip
        store(m["mixer"], mixed)
        _store_mixed(demanded, achieved, mixer.spin.size, wanted)
        _adopt(m, vehicle.attitude, out)


class StageModel:
    """The stages of the loops of one configuration; the integrators continue from call to call."""

    def __init__(self, setup: LoopsSetup) -> None:
        """Start with the numbers of ``setup``; raise ConfigError."""
        vehicle, controller = setup.vehicle, controller_of(setup.controller)
        check_python(controller)
        laws = controller.laws
        numbers = loop_numbers(vehicle, controller, setup.gains, setup.max_tilt_rad, setup.given)
        self._memory = _memory_of(controller, len(vehicle.rotors), numbers)
        record = self._memory[0]
        record["dt_s"], record["outer_dt_s"] = 1.0 / setup.inner_hz, setup.divisor / setup.inner_hz
        record["fraction_step"] = 1.0 / setup.divisor
        for name, values in mixer_for(vehicle)._asdict().items():
            record[name] = values
        split = len(laws[POSITION].initial_memory), numbers.laws[POSITION].size
        live, memories = (
            {
                POSITION: record[f"outer{suffix}"][:at],
                GUIDANCE: record[f"outer{suffix}"][at:],
                ATTITUDE: record[f"attitude{suffix}"],
                MIXER: record[f"mixer{suffix}"],
            }
            for suffix, at in (("_params", split[1]), ("", split[0]))
        )
        live_numbers = numbers._replace(laws=live, reference=record["reference_params"])
        self._parameters = LoopParameters(live_numbers, controller, memories)
        self.parameters = frozenset(spec.name for spec in numbers.specs)
        """Names of the parameters that can be set."""
        self._kernel = bound_to(stages_kernel, laws, outer_kernel=outer_kernel_of(controller))

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter from the next step on; raise KeyError if unknown."""
        self._parameters.set(name, value)

    def expected(
        self, inputs: FloatArray, flags: np.ndarray[Any, np.dtype[np.int64]], outputs: FloatArray
    ) -> FloatArray:
        """Return the expected outputs (n, 32) of the next steps; see ``stages_kernel``."""
        wanted = np.zeros((len(flags), OUTPUT_SIZE))
        reported = np.ascontiguousarray(outputs).view(STAGE_OUTPUTS)
        self._kernel(inputs, flags, reported[:, 0], self._memory, wanted.view(STAGE_OUTPUTS)[:, 0])
        return wanted


def has_model(setup: LoopsSetup) -> bool:
    """Return True if all laws are Python; one that is written in C has nothing to compare with."""
    return not any(isinstance(law.step, CStep) for law in controller_of(setup.controller).laws.values())


def _memory_of(controller: Controller, rotors: int, numbers: LoopNumbers) -> RecordArray:
    """Return the memory of the kernel, with initial memories and parameters of the laws."""
    laws = controller.laws
    initial = {role: np.array(law.initial_memory, np.float64) for role, law in laws.items()}
    outer, outer_params = joined(initial)[0], joined(numbers.laws)[0]
    inner = inner_layout(rotors, laws[ATTITUDE], laws[MIXER])
    more = [
        ("outer", "f8", outer.shape),
        ("outer_params", "f8", outer_params.shape),
        ("outer_initial", "f8", outer.shape),
        ("attitude_initial", "f8", initial[ATTITUDE].shape),
        ("mixer_initial", "f8", initial[MIXER].shape),
        ("outer_dt_s", "f8"),
        ("fraction", "f8", (1,)),
        ("fraction_step", "f8"),
    ]
    memory = np.zeros(1, np.dtype([*inner.descr, *more]))
    values = {
        "outer_params": outer_params,
        "attitude_params": numbers.laws[ATTITUDE],
        "mixer_params": numbers.laws[MIXER],
        "reference_params": numbers.reference,
        "outer": outer, "outer_initial": outer,
        "attitude": initial[ATTITUDE], "attitude_initial": initial[ATTITUDE],
        "mixer": initial[MIXER], "mixer_initial": initial[MIXER],
    }  # fmt: skip
    for name, numbers_of in values.items():
        memory[0][name] = numbers_of
    return memory

"""Control loops in Python: outer kernel, inner kernel, and the backend that runs them."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from flightstack.control.attitude_controller import AttitudeController, AttitudeInputs
from flightstack.control.attitude_reference import (
    ReferenceMemory,
    ReferenceParams,
    attitude_reference_step,
    in_body_frame,
)
from flightstack.control.backend import IdleRow
from flightstack.control.controller_loading import compile_error
from flightstack.control.loop_parameters import LoopParameters, loop_numbers
from flightstack.control.mixer import WORK_ROWS, Mixer, mix, mixer_for, relative_rotor_speed
from flightstack.control.position_pid import (
    PositionMemory,
    PositionParams,
    position_pid_step,
)
from flightstack.core.array_items import as_tuple, store
from flightstack.core.arrays import (
    achieved_wrench,
    attitude_target,
    commanded_wrench,
    position_setpoint,
    store_attitude_target,
    store_status,
    store_wrenches,
    vehicle_state,
)
from flightstack.core.compiled import compiled, direct, specialise
from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    MAX_ROTORS,
    SETPOINT_SIZE,
    AttitudeReference,
    FloatArray,
    LoopRow,
    LoopStatus,
    RecordArray,
    Vector3,
    Wrench,
)
from flightstack.core.geometry import blend, conjugate, quaternion_product, rotation_vector
from flightstack.core.portable_math import LARGEST_ANGLE_RAD
from flightstack.params.toml_file import Table
from flightstack.params.vehicle import Vehicle

POSITION_MEMORY_SIZE = 3
POSITION_PARAMS_SIZE = 12
REFERENCE_MEMORY_SIZE = 7
REFERENCE_PARAMS_SIZE = 4

REFERENCE_AT = LoopRow.REFERENCE_ATTITUDE.start
COMMAND_AT = LoopRow.ROTOR_COMMAND.start
SPEED_AT = LoopRow.ROTOR_SPEED.start
INPUT_NOT_FINITE = LoopStatus.INPUT_NOT_FINITE
OUTPUT_NOT_FINITE = LoopStatus.OUTPUT_NOT_FINITE

# bound by ``specialise`` to the selected controller
controller_step: Any = None
ControllerMemory: Any = None
ControllerParams: Any = None
CONTROLLER_MEMORY_SIZE = 0
CONTROLLER_PARAMS_SIZE = 0


@compiled
def all_finite(values: FloatArray | tuple[float, ...]) -> bool:
    """Return True if all values of an array or a flat tuple are finite."""
    for value in values:  # noqa: SIM110  # compiled code has no generators
        if not math.isfinite(value):
            return False
    return True


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
    """Run the position loop: update ``memory`` (3,) and ``target`` (5,).

    Both are unchanged if a number is not finite, or if the yaw setpoint is beyond ±10⁴ rad, the limit of ``sin_cos``.
    ``last`` (48,) is the inner loop's row of the previous tick, which shows saturation of the mixer.
    """
    desired = position_setpoint(setpoint)
    if not (all_finite(state) and all_finite(setpoint) and abs(desired.yaw_rad) <= LARGEST_ANGLE_RAD):
        return
    advanced, new_target = position_pid_step(
        PositionMemory(*as_tuple(memory, POSITION_MEMORY_SIZE)),
        vehicle_state(state),
        desired,
        PositionParams(*as_tuple(params, POSITION_PARAMS_SIZE)),
        dt_s,
        _saturation_direction(commanded_wrench(last).thrust_n, achieved_wrench(last).thrust_n, 1e-9),
    )
    if not (all_finite(new_target.attitude) and math.isfinite(new_target.thrust_n)):
        return
    store(memory, advanced)
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


def inner_layout(rotors: int, controller_memory: int, controller_params: int) -> np.dtype[np.void]:
    """Return the layout of the inner loop's memory: one record, because each array argument costs time."""
    return np.dtype(
        [
            # state
            ("last_target", "f8", (ATTITUDE_TARGET_SIZE,)),
            ("target", "f8", (ATTITUDE_TARGET_SIZE,)),
            ("reference", "f8", (REFERENCE_MEMORY_SIZE,)),
            ("controller", "f8", (controller_memory,)),
            ("last", "f8", (LoopRow.SIZE,)),
            ("work", "f8", (WORK_ROWS, rotors)),
            # parameters
            ("dt_s", "f8"),
            ("reference_params", "f8", (REFERENCE_PARAMS_SIZE,)),
            ("controller_params", "f8", (controller_params,)),
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


def inner_kernel(
    state: FloatArray,
    fraction: float,
    rotor_speed_rad_s: FloatArray,
    memory: RecordArray,
    row: FloatArray,
) -> None:
    """Run reference filter, attitude controller and mixer; write ``row`` (48,) and update ``memory`` (1,).

    ``memory`` has the layout of ``inner_layout``. Its ``last`` is the row of the previous tick: it provides saturation
    and Ω_r, and is repeated with a status bit if an input or a result is not finite. The target is interpolated from
    ``last_target`` (previous outer tick) to ``target``; ``fraction`` is the elapsed part of the outer period. Without
    interpolation, steps of the target would excite the rotors at the outer rate.

    ``specialise`` binds the controller to this template, and to it alone. It is one long function because the values of
    the controller's types stay inside: the cache of a function that takes them would refer to types that may go.
    """
    m = memory[0]
    target, last, dt_s = m["target"], m["last"], m["dt_s"]
    if not (all_finite(state) and all_finite(target)):
        store(row, last)
        store_status(row, INPUT_NOT_FINITE)
        return
    mixer = Mixer(
        m["allocation"], m["effectiveness"], m["low"], m["high"], m["spin"],
        m["middle"], m["reach"], m["is_inverse"], m["is_even"],
    )  # fmt: skip
    n = mixer.spin.size
    vehicle, desired = vehicle_state(state), attitude_target(target)
    filtered, reference = attitude_reference_step(
        ReferenceMemory(*as_tuple(m["reference"], REFERENCE_MEMORY_SIZE)),
        blend(attitude_target(m["last_target"]).attitude, desired.attitude, fraction),
        ReferenceParams(*as_tuple(m["reference_params"], REFERENCE_PARAMS_SIZE)),
        dt_s,
    )
    reference = in_body_frame(reference, vehicle.attitude)
    inputs = AttitudeInputs(
        vehicle.attitude,
        vehicle.rates_frd_rad_s,
        reference,
        rotation_vector(quaternion_product(conjugate(vehicle.attitude), reference.attitude)),
        relative_rotor_speed(last[COMMAND_AT:], mixer.spin),
        _saturation(last),
    )
    advanced, torque = controller_step(
        ControllerMemory(*as_tuple(m["controller"], CONTROLLER_MEMORY_SIZE)),
        inputs,
        ControllerParams(*as_tuple(m["controller_params"], CONTROLLER_PARAMS_SIZE)),
        dt_s,
    )
    is_valid = _is_finite(torque)
    for value in advanced:
        is_valid = is_valid and math.isfinite(value)
    if not is_valid:
        store(row, last)
        store_status(row, OUTPUT_NOT_FINITE)
        return
    demanded = Wrench(desired.thrust_n, torque)
    achieved = mix(demanded, mixer, row[COMMAND_AT:], m["work"])
    is_valid = math.isfinite(achieved.thrust_n) and _is_finite(achieved.torque_frd_n_m)
    if not (is_valid and all_finite(row[COMMAND_AT : COMMAND_AT + n])):  # a sum overflowed
        store(row, last)
        store_status(row, OUTPUT_NOT_FINITE)
        return
    store(m["reference"], filtered)
    for index in range(CONTROLLER_MEMORY_SIZE):
        m["controller"][index] = advanced[index]
    store(row, state)
    _store_reference(row, reference)
    store_wrenches(row, demanded, achieved)
    row[COMMAND_AT + n : SPEED_AT] = 0.0
    store(row[SPEED_AT:], rotor_speed_rad_s)
    store_status(row, _status(row))
    store(last, row)


class PythonLoops:
    """Control loops as compiled Python; implements ``ControlBackend``."""

    name = "python"
    version = f"Python, Numba {numba.__version__}"

    def __init__(
        self,
        vehicle: Vehicle,
        controller: AttitudeController,
        gains: Table,
        inner_hz: float,
        outer_hz: float,
        max_tilt_rad: float,
    ) -> None:
        self._outer_dt_s = 1.0 / outer_hz
        self._fraction_step, self._fraction = outer_hz / inner_hz, 0.0
        numbers = loop_numbers(vehicle, controller, gains, max_tilt_rad)
        self._position_params = numbers.position
        self._initial_memory = np.array(controller.initial_memory, dtype=np.float64)
        layout = inner_layout(len(vehicle.rotors), self._initial_memory.size, numbers.controller.size)
        self._memory: RecordArray = np.zeros(1, layout)
        record = self._memory[0]
        record["dt_s"] = 1.0 / inner_hz
        record["reference_params"], record["controller_params"] = numbers.reference, numbers.controller
        for name, values in mixer_for(vehicle)._asdict().items():
            record[name] = values
        self.attitude_target: FloatArray = record["target"]
        self._last_target: FloatArray = record["last_target"]
        self._reference_memory: FloatArray = record["reference"]
        self._controller_memory: FloatArray = record["controller"]
        live = numbers._replace(reference=record["reference_params"], controller=record["controller_params"])
        self._parameters = LoopParameters(live, controller, self._controller_memory)
        self.parameter_specs = numbers.specs
        self._last: FloatArray = record["last"]
        self._position_memory = np.zeros(POSITION_MEMORY_SIZE)
        self._idle = IdleRow(vehicle)
        self._kernel = specialise(
            inner_kernel,
            controller.key,
            controller_step=controller.step,
            ControllerMemory=controller.memory_type,
            ControllerParams=controller.params_type,
            CONTROLLER_MEMORY_SIZE=len(controller.initial_memory),
            CONTROLLER_PARAMS_SIZE=numbers.controller.size,
        )
        self._last_arrays: tuple[FloatArray, FloatArray] | None = None
        self._bound: tuple[FloatArray, FloatArray] | None = None
        self._inner, self._outer = self._kernel, outer_kernel
        self._compile(controller.name)

    def _compile(self, name: str) -> None:
        """Compile the kernels, or load them from the cache; raise ConfigError."""
        state = np.array([0.0] * 6 + [1.0] + [0.0] * 6)
        self.reset(state)
        try:
            self.warm_up(state, np.zeros(SETPOINT_SIZE), np.zeros(MAX_ROTORS, np.float32))
        except Exception as error:  # a user's controller may fail in any way
            raise compile_error(name, error) from error

    def get_parameter(self, name: str) -> float:
        """Return the parameter's value in the loops; raise KeyError if unknown."""
        return self._parameters.get(name)

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter from the next tick on; raise KeyError if unknown."""
        self._parameters.set(name, value)

    def warm_up(self, state: FloatArray, setpoint: FloatArray, rotor_speed_rad_s: FloatArray) -> None:
        """Compile the kernels for these arrays, or load them from the cache."""
        row = np.zeros(LoopRow.SIZE)
        for _ in range(2):  # the second step binds the kernels to the arrays
            self.step(state, setpoint, rotor_speed_rad_s, True, row)
        self.reset(state)

    def reset(self, state: FloatArray) -> None:
        """Reset the integrators to zero and the reference to the present attitude, at rest."""
        self._position_memory[:] = 0.0
        self._controller_memory[:] = self._initial_memory
        self._reference_memory[:4] = state[6:10]
        self._reference_memory[4:] = 0.0
        self.attitude_target[:4] = state[6:10]
        self.attitude_target[4] = 0.0
        self._last_target[:] = self.attitude_target
        self._fraction = 0.0
        self._last[:] = 0.0

    def set_attitude_target(self, target: FloatArray) -> None:
        """Use ``target``, shape (5,), instead of the outer loop's target. Call once per outer period."""
        self._last_target[:] = self.attitude_target
        self._fraction = 0.0
        self.attitude_target[:] = target

    def step(
        self,
        state: FloatArray,
        setpoint: FloatArray,
        rotor_speed_rad_s: FloatArray,
        outer_due: bool,
        row: FloatArray,
    ) -> None:
        """Run the outer loop if it is due, then the inner loop; write ``row`` with the rotor commands."""
        bound = self._bound
        if bound is None or state is not bound[0] or rotor_speed_rad_s is not bound[1]:
            self._bind(state, rotor_speed_rad_s, setpoint, row)
        if outer_due:
            self._last_target[:] = self.attitude_target
            self._fraction = 0.0
            self._outer(
                state,
                setpoint,
                self._position_memory,
                self._position_params,
                self._last,
                self._outer_dt_s,
                self.attitude_target,
            )
        self._fraction += self._fraction_step
        self._inner(state, self._fraction, rotor_speed_rad_s, self._memory, row)

    def _bind(self, state: FloatArray, speeds: FloatArray, setpoint: FloatArray, row: FloatArray) -> None:
        """Select the generic kernels for new arrays, or bind direct calls when the same arrays come a second time."""
        self._inner, self._outer = self._kernel, outer_kernel
        self._bound = None
        if self._last_arrays is not None and state is self._last_arrays[0] and speeds is self._last_arrays[1]:
            self._inner = direct(self._kernel, state, 1.0, speeds, self._memory, row)
            self._outer = direct(
                outer_kernel, state, setpoint, self._position_memory, self._position_params, self._last,
                self._outer_dt_s, self.attitude_target,
            )  # fmt: skip
            self._bound = state, speeds
        self._last_arrays = state, speeds

    def idle(self, state: FloatArray, rotor_speed_rad_s: FloatArray, armed: bool, row: FloatArray) -> None:
        """Write ``row`` for a vehicle that must not fly: rotors at idle speed when armed, else stopped."""
        self._idle.write(state, rotor_speed_rad_s, armed, row)

    def close(self) -> None:
        """Do nothing: there are no resources to release."""

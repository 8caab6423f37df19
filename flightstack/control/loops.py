"""Control loops in Python: the backend that runs the kernels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from flightstack.control.backend import IdleRow
from flightstack.control.control_law import ControlLaw
from flightstack.control.controller import (
    ATTITUDE,
    GUIDANCE,
    MIXER,
    POSITION,
    AnyController,
    Controller,
    controller_of,
    is_built_in,
)
from flightstack.control.controller_loading import check_python, compile_error, fields_of
from flightstack.control.loop_kernels import BOUND_NAMES, inner_kernel, inner_layout, outer_kernel
from flightstack.control.loop_parameters import LoopNumbers, LoopParameters, loop_numbers
from flightstack.control.mixer import mixer_for
from flightstack.core.compiled import compiler_version, direct, specialise
from flightstack.core.contract import MAX_ROTORS, SETPOINT_SIZE, FloatArray, LoopRow, RecordArray
from flightstack.params.toml_file import Table
from flightstack.params.vehicle import Vehicle


def bound_to(
    template: Callable[..., Any], laws: Mapping[str, ControlLaw], **names: Any
) -> Callable[..., Any]:
    """Return a kernel compiled with these laws, and with ``names`` that depend on the laws alone."""
    for role, law in laws.items():
        step, memory, params, size = BOUND_NAMES[role]
        names |= {step: law.step, memory: law.memory_type, params: law.params_type}
        names |= {f"{size}_MEMORY_SIZE": len(law.initial_memory)}
        names |= {f"{size}_PARAMS_SIZE": len(fields_of(law.params_type))}
    chosen = [law.key for role, law in laws.items() if role == ATTITUDE or not is_built_in(role, law)]
    return specialise(template, "_".join(chosen), **names)


def outer_kernel_of(controller: Controller) -> Callable[..., Any]:
    """Return the outer kernel with the controller's laws; the shared one for the built-in laws."""
    outer = (GUIDANCE, POSITION)
    if not controller.own_laws.keys() & set(outer):
        return outer_kernel
    template = getattr(outer_kernel, "py_func", outer_kernel)
    return bound_to(template, {role: controller.laws[role] for role in outer})


def joined(values: Mapping[str, FloatArray]) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the values of the position law and of guidance in one array, and a view of each."""
    whole, split = np.concatenate([values[POSITION], values[GUIDANCE]]), values[POSITION].size
    return whole, {POSITION: whole[:split], GUIDANCE: whole[split:]}


def _inner_memory(
    vehicle: Vehicle, controller: Controller, numbers: LoopNumbers, inner_hz: float
) -> RecordArray:
    """Return the record of the inner loop with its parameters, state at zero."""
    memory: RecordArray = np.zeros(
        1, inner_layout(len(vehicle.rotors), controller.attitude, controller.mixer)
    )
    record = memory[0]
    for name, values in mixer_for(vehicle)._asdict().items():
        record[name] = values
    record["dt_s"], record["reference_params"] = 1.0 / inner_hz, numbers.reference
    record["attitude_params"], record["mixer_params"] = numbers.laws[ATTITUDE], numbers.laws[MIXER]
    return memory


class PythonLoops:
    """Control loops as compiled Python; implements ``ControlBackend``."""

    name = "python"

    def __init__(
        self,
        vehicle: Vehicle,
        controller: AnyController,
        gains: Table,
        inner_hz: float,
        outer_hz: float,
        max_tilt_rad: float,
    ) -> None:
        self.version = f"Python, Numba {compiler_version()}"
        self._outer_dt_s, self.fraction_step = 1.0 / outer_hz, outer_hz / inner_hz
        self.fraction = 0.0
        """Share of the way from the last attitude target to the present one."""
        controller = controller_of(controller)
        check_python(controller)
        numbers, laws = loop_numbers(vehicle, controller, gains, max_tilt_rad), controller.laws
        self.memory = _inner_memory(vehicle, controller, numbers, inner_hz)
        """State and parameters of the inner loop."""
        record = self.memory[0]
        self._initial = {role: np.array(law.initial_memory, np.float64) for role, law in laws.items()}
        self.outer_memory, outer = joined(self._initial)
        """Integrals of the outer loop's laws."""
        self.memories = {**outer, ATTITUDE: record["attitude"], MIXER: record["mixer"]}
        """Memory of each law, by role."""
        self._outer_params, outer = joined(numbers.laws)
        live = {**outer, ATTITUDE: record["attitude_params"], MIXER: record["mixer_params"]}
        numbers = numbers._replace(laws=live, reference=record["reference_params"])
        self._parameters = LoopParameters(numbers, controller, self.memories)
        self.parameter_specs = numbers.specs
        self.attitude_target: FloatArray = record["target"]
        self._last_target: FloatArray = record["last_target"]
        self._reference_memory: FloatArray = record["reference"]
        self._last: FloatArray = record["last"]
        self._idle = IdleRow(vehicle)
        self.kernel = bound_to(inner_kernel, {role: laws[role] for role in (ATTITUDE, MIXER)})
        self._outer_kernel = outer_kernel_of(controller)
        self._last_arrays: tuple[FloatArray, FloatArray] | None = None
        self._bound: tuple[FloatArray, FloatArray] | None = None
        self._inner, self._outer = self.kernel, self._outer_kernel
        self._compile(controller)

    def _compile(self, controller: Controller) -> None:
        """Compile the kernels, or load them from the cache; raise ConfigError."""
        state = np.array([0.0] * 6 + [1.0] + [0.0] * 6)
        self.reset(state)
        try:
            self.warm_up(state, np.zeros(SETPOINT_SIZE), np.zeros(MAX_ROTORS, np.float32))
        except Exception as error:  # a user's controller may fail in any way
            raise compile_error(controller, error) from error

    @property
    def outer_kernel(self) -> Callable[..., Any]:
        """Kernel of the outer loop."""
        return self._outer_kernel

    @property
    def outer_arrays(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float]:
        """Attitude target, last target, memory, parameters and last error of the outer loop, and its step [s]."""
        return (
            self.attitude_target, self._last_target, self.outer_memory, self._outer_params, self._last,
            self._outer_dt_s,
        )  # fmt: skip

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
        for role, values in self._initial.items():
            self.memories[role][:] = values
        self._reference_memory[:4] = state[6:10]
        self._reference_memory[4:] = 0.0
        self.attitude_target[:4] = state[6:10]
        self.attitude_target[4] = 0.0
        self._last_target[:] = self.attitude_target
        self.fraction = 0.0
        self._last[:] = 0.0

    def set_attitude_target(self, target: FloatArray) -> None:
        """Use ``target``, shape (5,), instead of the outer loop's target. Call once per outer period."""
        self._last_target[:] = self.attitude_target
        self.fraction = 0.0
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
            self.fraction = 0.0
            self._outer(
                state,
                setpoint,
                self.outer_memory,
                self._outer_params,
                self._last,
                self._outer_dt_s,
                self.attitude_target,
            )
        self.fraction += self.fraction_step
        self._inner(state, self.fraction, rotor_speed_rad_s, self.memory, row)

    def _bind(self, state: FloatArray, speeds: FloatArray, setpoint: FloatArray, row: FloatArray) -> None:
        """Select the generic kernels for new arrays, or bind direct calls when the same arrays come a second time."""
        self._inner, self._outer = self.kernel, self._outer_kernel
        self._bound = None
        if self._last_arrays is not None and state is self._last_arrays[0] and speeds is self._last_arrays[1]:
            self._inner = direct(self.kernel, state, 1.0, speeds, self.memory, row)
            self._outer = direct(
                self._outer_kernel, state, setpoint, self.outer_memory, self._outer_params, self._last,
                self._outer_dt_s, self.attitude_target,
            )  # fmt: skip
            self._bound = state, speeds
        self._last_arrays = state, speeds

    def idle(self, state: FloatArray, rotor_speed_rad_s: FloatArray, armed: bool, row: FloatArray) -> None:
        """Write ``row`` for a vehicle that must not fly: rotors at idle speed when armed, else stopped."""
        self._idle.write(state, rotor_speed_rad_s, armed, row)

    def hold(self) -> None:
        """Do nothing: there is no target."""

    def close(self) -> None:
        """Do nothing: there are no resources to release."""

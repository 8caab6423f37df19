"""The loops in C as a ``ControlBackend``, run in this process or on a target."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from flightstack.control.backend import IdleRow
from flightstack.control.controller import AnyController
from flightstack.control.loop_parameters import NOT_GIVEN, LawValues, loop_numbers
from flightstack.core.contract import (
    ATTITUDE_TARGET_SIZE,
    STATE_SIZE,
    FloatArray,
    LoopFlags,
    LoopRow,
    LoopStatus,
)
from flightstack.firmware.numbers import FIRST_NUMBERS, target_numbers
from flightstack.firmware.sources import source_hash
from flightstack.params.spec import ParamSpec
from flightstack.params.toml_file import Table
from flightstack.params.vehicle import Vehicle

INPUT_SIZE, OUTPUT_SIZE = 29, 32
SETPOINT_AT, TARGET_AT = 13, 24
"""Offsets of setpoint and attitude target in the input; the state is first."""
STAGES = slice(LoopRow.REFERENCE_ATTITUDE.start, LoopRow.ROTOR_SPEED.start)
"""Reference, wrenches and rotor commands: contiguous in the row and in the output."""
NOT_FINITE = LoopStatus.INPUT_NOT_FINITE | LoopStatus.OUTPUT_NOT_FINITE


class LoopExecutor(Protocol):
    """Runs single ticks of the loops."""

    input: FloatArray
    """State (13), setpoint (11), attitude target (5); shape (29,), written by the caller before a step."""
    output: FloatArray
    """Attitude target (5), reference (10), wrench (4), wrench achieved (4), rotor commands (8), status."""
    version: str
    """Description for the log."""

    def set(self, name: str, value: float) -> None:
        """Set a number from the next step on."""

    def get(self, name: str) -> float:
        """Return the current value of a number."""

    def step(self, flags: int) -> None:
        """Run a tick from ``input`` to ``output``; ``flags`` are ``LoopFlags``."""

    def run(self, flags: Sequence[int], inputs: FloatArray) -> FloatArray:
        """Run ticks on ``inputs`` (n, 29), one after another; return the outputs (n, 32)."""

    def rest(self) -> None:
        """Note a tick on the ground, in which the loops do not run."""

    def hold(self) -> None:
        """Keep a target running in a tick without a step in flight; raise TargetError."""

    def close(self) -> None:
        """Release resources; no step may follow."""


class LoopsSetup(NamedTuple):
    """Configuration of the loops."""

    vehicle: Vehicle
    controller: AnyController
    gains: Table
    max_tilt_rad: float
    inner_hz: float
    outer_hz: float
    divisor: int
    given: LawValues = NOT_GIVEN
    """Parameters of laws that replace those of the gains file."""

    def numbers(self) -> dict[str, float]:
        """Return the numbers for C by name; raise ConfigError for an unsupported configuration."""
        values = target_numbers(
            self.vehicle,
            self.controller,
            self.gains,
            self.max_tilt_rad,
            self.inner_hz,
            self.divisor,
            self.given,
        )
        return {
            name: value + 0.0 for name, value in values.items()
        }  # + 0.0 turns -0 into 0: not every target's FPU supports -0


class CLoops:
    """The loops in C; implements ``ControlBackend``.

    A reset takes effect in the next step, because a target receives it with the step.
    """

    def __init__(self, name: str, executor: LoopExecutor, setup: LoopsSetup) -> None:
        """Use ``executor``, which has the numbers of ``setup``; raise ConfigError."""
        self.name = name
        self.version = executor.version
        self.executor = executor
        numbers = loop_numbers(setup.vehicle, setup.controller, setup.gains, setup.max_tilt_rad, setup.given)
        self.parameter_specs: Sequence[ParamSpec] = numbers.specs
        self._names = frozenset(spec.name for spec in numbers.specs)
        self.attitude_target: FloatArray = np.array([1.0, 0.0, 0.0, 0.0, 0.0])
        self._idle = IdleRow(setup.vehicle)
        self._last: FloatArray = np.zeros(LoopRow.SIZE)
        self._pending = LoopFlags.RESET
        self._output = executor.output
        self._state: FloatArray = executor.input[:STATE_SIZE]
        self._setpoint: FloatArray = executor.input[SETPOINT_AT:TARGET_AT]
        self._target: FloatArray = executor.input[TARGET_AT:INPUT_SIZE]

    def get_parameter(self, name: str) -> float:
        """Return a parameter as the loops use it; raise KeyError if unknown."""
        if name not in self._names:
            raise KeyError(name)
        return self.executor.get(name)

    def set_parameter(self, name: str, value: float) -> None:
        """Change a parameter from the next tick on; raise KeyError if unknown."""
        if name not in self._names:
            raise KeyError(name)
        self.executor.set(name, value)

    def warm_up(self, state: FloatArray, setpoint: FloatArray, rotor_speed_rad_s: FloatArray) -> None:
        """Reset at ``state``; the C code is compiled already, and a target must not count extra steps."""
        self.reset(state)

    def reset(self, state: FloatArray) -> None:
        """Reset integrators to zero and the reference to the current attitude at rest."""
        self._pending = LoopFlags.RESET
        self.attitude_target[:4] = state[6:10]
        self.attitude_target[4] = 0.0
        self._last[:] = 0.0

    def set_attitude_target(self, target: FloatArray) -> None:
        """Use ``target``, shape (5,), instead of the outer loop's; call once per outer period."""
        self._pending |= LoopFlags.SET_TARGET
        self._target[:] = target
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
        self._state[:] = state
        self._setpoint[:] = setpoint
        flags = self._pending | LoopFlags.OUTER_DUE if outer_due else self._pending
        self._pending = 0
        self.executor.step(flags)
        output = self._output
        self.attitude_target[:] = output[:ATTITUDE_TARGET_SIZE]
        status = output[-1]
        if int(status) & NOT_FINITE:  # repeat the last valid row
            row[:] = self._last
        else:
            row[:STATE_SIZE] = state
            row[STAGES] = output[ATTITUDE_TARGET_SIZE:-1]
            row[LoopRow.ROTOR_SPEED] = rotor_speed_rad_s
            self._last[:] = row
        row[LoopRow.STATUS] = status

    def idle(self, state: FloatArray, rotor_speed_rad_s: FloatArray, armed: bool, row: FloatArray) -> None:
        """Write ``row`` for a vehicle on the ground: rotors at idle speed if armed, else stopped."""
        self.executor.rest()
        self._idle.write(state, rotor_speed_rad_s, armed, row)

    def hold(self) -> None:
        """Keep a target running in a tick in which the last rotor commands are held."""
        self.executor.hold()

    def close(self) -> None:
        """Release the executor."""
        self.executor.close()


_DOUBLES = ctypes.POINTER(ctypes.c_double)


class HostLoops:
    """Loops in this process through ``firmware/ports/host/fs_sil.h``; implements ``LoopExecutor``."""

    def __init__(self, library: Path, numbers: Mapping[str, float]) -> None:
        """Load a library of ``build.host_library`` and set its numbers."""
        self._functions = functions = ctypes.CDLL(str(library))
        functions.fs_sil_size.restype = ctypes.c_uint32
        functions.fs_sil_get.restype = ctypes.c_double
        functions.fs_sil_get.argtypes = [ctypes.c_void_p, ctypes.c_char_p]
        functions.fs_sil_set.restype = ctypes.c_uint32
        functions.fs_sil_set.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_double]
        functions.fs_sil_init.restype = functions.fs_sil_step.restype = None
        functions.fs_sil_init.argtypes = [ctypes.c_void_p]
        functions.fs_sil_step.argtypes = [ctypes.c_void_p, _DOUBLES, ctypes.c_uint32, _DOUBLES]
        self._memory = (ctypes.c_double * (functions.fs_sil_size() // 8 + 1))()  # doubles for alignment
        self._loops = ctypes.cast(self._memory, ctypes.c_void_p)
        self.input: FloatArray = np.zeros(INPUT_SIZE)
        self.output: FloatArray = np.zeros(OUTPUT_SIZE)
        self._step = functions.fs_sil_step
        self._in = self.input.ctypes.data_as(_DOUBLES)
        self._out = self.output.ctypes.data_as(_DOUBLES)
        functions.fs_sil_real_size.restype = ctypes.c_uint32
        self.real = "double" if functions.fs_sil_real_size() == 8 else "float"
        """Arithmetic of the loops: ``float`` or ``double``."""
        self.version = f"C, {self.real}, sources {source_hash().hex()}"
        functions.fs_sil_init(self._loops)
        for name, value in (*FIRST_NUMBERS.items(), *numbers.items()):
            self.set(name, value)

    def step(self, flags: int) -> None:
        """Run one tick on ``input`` and write ``output``; ``flags`` as in FS_PIL_STEP."""
        self._step(self._loops, self._in, flags, self._out)

    def run(self, flags: Sequence[int], inputs: FloatArray) -> FloatArray:
        """Run ticks on ``inputs`` (n, 29), one after another; return the outputs (n, 32)."""
        outputs = np.empty((len(inputs), OUTPUT_SIZE))
        for at, flag in enumerate(flags):
            self.input[:] = inputs[at]
            self.step(flag)
            outputs[at] = self.output
        return outputs

    def set(self, name: str, value: float) -> None:
        """Set a number; raise KeyError if unknown, ValueError if out of range."""
        result = self._functions.fs_sil_set(self._loops, name.encode(), value)
        if result == 2:
            raise KeyError(name)
        if result:
            raise ValueError(f"{name}={value:g} is out of range")

    def get(self, name: str) -> float:
        """Return a number; 0 if unknown."""
        return float(self._functions.fs_sil_get(self._loops, name.encode()))

    def rest(self) -> None:
        """Do nothing."""

    def hold(self) -> None:
        """Do nothing: there is no target."""

    def close(self) -> None:
        """Do nothing: memory is freed with the object."""

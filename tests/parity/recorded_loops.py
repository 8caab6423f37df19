"""Fly a mission in one process and keep what went into the loops, and what Python's made of it."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flightstack.control.backend import ControlBackend
from flightstack.control.controller_loading import load_controller
from flightstack.control.loops import PythonLoops
from flightstack.core.contract import FloatArray, LoopRow
from flightstack.firmware.numbers import target_numbers
from flightstack.params.gains_file import open_gains
from flightstack.testing.engine import Engine
from tests.support.truth import World

OUTER_DUE, SET_TARGET, RESET = 1, 2, 4


class Recording(NamedTuple):
    """The inputs of each tick in the form of the core in C, and the outputs as its driver writes them."""

    numbers: dict[str, float]
    states: np.ndarray
    setpoints: np.ndarray
    targets: np.ndarray
    flags: np.ndarray
    outputs: np.ndarray
    """Attitude target, reference, wrench, wrench achieved, rotor command; shape (ticks, 31)."""
    status: np.ndarray


class RecordingLoops:
    """Loops that note each call before they pass it on."""

    def __init__(self, loops: ControlBackend) -> None:
        assert isinstance(loops, PythonLoops)
        self.loops = loops
        self.rows: list[tuple[np.ndarray, ...]] = []
        self.flags: list[int] = []
        self._pending, self._target = 0, np.array([1.0, 0.0, 0.0, 0.0, 0.0])
        self._reset_at: np.ndarray | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.loops, name)

    def reset(self, state: FloatArray) -> None:
        self._pending, self._reset_at = RESET, state.copy()
        self.loops.reset(state)

    def set_attitude_target(self, target: FloatArray) -> None:
        self._pending |= SET_TARGET
        self._target = target.copy()
        self.loops.set_attitude_target(target)

    def step(
        self,
        state: FloatArray,
        setpoint: FloatArray,
        rotor_speed: FloatArray,
        outer_due: bool,
        row: FloatArray,
    ) -> None:
        if self._pending & RESET:
            assert self._reset_at is not None
            assert np.array_equal(self._reset_at, state)  # C resets at the state of the step
        self.loops.step(state, setpoint, rotor_speed, outer_due, row)
        output = np.concatenate([self.loops.attitude_target, row[13 : LoopRow.ROTOR_SPEED.start]])
        self.rows.append(
            (state.copy(), setpoint.copy(), self._target, output, row[LoopRow.STATUS : LoopRow.SIZE].copy())
        )
        self.flags.append(self._pending | (OUTER_DUE if outer_due else 0))
        self._pending = 0

    def recording(self, numbers: dict[str, float]) -> Recording:
        """Return all that was noted."""
        states, setpoints, targets, outputs, status = (
            np.array(column) for column in zip(*self.rows, strict=True)
        )
        flags = np.array(self.flags, np.uint16)
        return Recording(numbers, states, setpoints, targets, flags, outputs, status[:, 0].astype(int))


def record(plan: str, **config: Any) -> Recording:
    """Fly a plan of ``missions/`` to its end with Python's loops."""
    world = World(make_engine=partial(Engine, wrap_loops=RecordingLoops), **config)
    stack = world.engine.stack
    recorder = stack.loops
    assert isinstance(recorder, RecordingLoops)
    world.upload(plan)
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    numbers = target_numbers(
        stack.vehicle,
        load_controller(world.engine.config.controller),
        open_gains(world.engine.config.gains),
        np.radians(world.engine.config.behaviour.max_tilt_deg),
        stack.rates.inner_hz,
        stack.rates.divisor,
    )
    return recorder.recording(numbers)

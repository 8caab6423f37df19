"""Streams of FS_PIL_STEP and PARAM_SET frames: random ones, and those of a whole flight. Float32, as on the wire."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from fastcrc import crc16

from flightstack.core.contract import ATTITUDE_TARGET_SIZE, SETPOINT_SIZE, STATE_SIZE, FloatArray
from flightstack.mavlink.dialect import mavlink
from flightstack.testing.engine import Engine
from tests.support.truth import World

OUTER_DUE, SET_TARGET, RESET = 1, 2, 4
OUTER_DIVISOR = 5
_STEP, _SET = mavlink.MAVLink_fs_pil_step_message, mavlink.MAVLink_param_set_message


def frame(message_id: int, crc_extra: int, sequence: int, payload: bytes) -> bytes:
    """Frame a payload by MAVLink 2, as pymavlink does, in a fifth of its time."""
    cut = payload.rstrip(b"\0") or b"\0"
    header = struct.pack("<6BHB", len(cut), 0, 0, sequence & 255, 255, 190, message_id & 0xFFFF, 0)
    return b"\xfd" + header + cut + struct.pack("<H", crc16.mcrf4xx(header + cut + bytes([crc_extra])))


def step_frame(step: int, flags: int, state: FloatArray, setpoint: FloatArray) -> bytes:
    """Frame one step; ``setpoint`` may be an attitude target."""
    numbers = np.zeros(STATE_SIZE + SETPOINT_SIZE, "<f4")
    numbers[:STATE_SIZE], numbers[STATE_SIZE : STATE_SIZE + setpoint.size] = state, setpoint
    return frame(_STEP.id, _STEP.crc_extra, step, struct.pack("<II", step, flags) + numbers.tobytes())


def parameter_frame(name: str, value: float) -> bytes:
    """Frame a PARAM_SET."""
    return frame(_SET.id, _SET.crc_extra, 0, struct.pack("<fBB16sB", value, 1, 1, name.encode(), 9))


def random_steps(count: int, seed: int, one_broken_in: int = 100) -> list[bytes]:
    """Return steps that have nothing to do with each other, near and far from flight, both controllers in turn.

    One in so many has a number that is not finite, or so large that results are not; 0: none.
    """
    rng = np.random.default_rng(seed)
    spread = 10.0 ** rng.uniform(-3.0, 1.5, (count, 1))
    states, setpoints = rng.normal(size=(count, STATE_SIZE)), rng.normal(size=(count, SETPOINT_SIZE))
    states[:, :6] *= spread
    states[:, 6] += 1.0
    states[:, 6:10] /= np.linalg.norm(states[:, 6:10], axis=1)[:, None]
    states[:, 10:] *= np.minimum(spread, 3.0)
    setpoints *= spread
    broken = (rng.integers(one_broken_in, size=count) == 0) if one_broken_in else np.zeros(count, np.bool_)
    states[broken, rng.integers(STATE_SIZE, size=broken.sum())] = rng.choice(
        [np.nan, np.inf, -np.inf, 3e38, 1e-42], broken.sum()
    )
    stream = []
    for index, (state, setpoint) in enumerate(zip(states, setpoints, strict=True)):
        flags = RESET if index % 1000 == 0 else 0
        if index % 1000 in (0, 500):
            stream.append(parameter_frame("FS_CTRL", float(index % 1000 == 500)))
        if index % 50 == 7:
            target = np.concatenate((states[index - 1][6:10], [abs(setpoint[0]) * 10.0]))
            stream.append(step_frame(index, flags | SET_TARGET, state, target))
        else:
            due = OUTER_DUE if index % OUTER_DIVISOR == 0 else 0
            stream.append(step_frame(index, flags | due, state, setpoint))
    return stream


class Recorder:
    """Stands between an autopilot and its loops, and keeps what the loops are given as frames."""

    def __init__(self, loops: Any) -> None:
        self._loops = loops
        self._flags, self._target = RESET, np.zeros(ATTITUDE_TARGET_SIZE)
        self.frames: list[bytes] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loops, name)

    def reset(self, state: FloatArray) -> None:
        self._flags = RESET
        self._loops.reset(state)

    def set_attitude_target(self, target: FloatArray) -> None:
        self._flags |= SET_TARGET
        self._target = target.copy()
        self._loops.set_attitude_target(target)

    def step(
        self, state: FloatArray, setpoint: FloatArray, speed: Any, outer_due: bool, row: FloatArray
    ) -> None:
        given = self._target if self._flags & SET_TARGET else setpoint
        flags, self._flags = self._flags | (OUTER_DUE if outer_due else 0), 0
        self.frames.append(step_frame(len(self.frames), flags, state, given))
        self._loops.step(state, setpoint, speed, outer_due, row)


GUSTY: dict[str, Any] = {"wind": (4.0, 2.0, 0.0), "gust": 2.0, "drag": True}


def flown_steps(plan: str = "hop.plan", air: Mapping[str, Any] = GUSTY) -> list[bytes]:
    """Fly a mission and return the steps of its loops."""
    flight = World(make_engine=partial(Engine, wrap_loops=Recorder), **air)
    recorder = flight.engine.stack.loops
    flight.upload(plan)
    flight.arm()
    flight.start_mission()
    flight.run_until("not armed")
    return recorder.frames

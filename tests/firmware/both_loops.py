"""The same loops in Python and in C, and how to step Python's through a sequence."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.control.controller_loading import load_controller
from flightstack.control.loops import PythonLoops
from flightstack.core.contract import LoopRow
from flightstack.firmware.numbers import target_numbers
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import Vehicle, load_vehicle
from tests.firmware.core_samples import Sequence
from tests.firmware.core_support import (
    OUTER_DUE,
    RESET,
    SET_TARGET,
    Core,
    Loops,
)
from tests.support.rotor_sets import ring

INNER_HZ, DIVISOR, TILT_RAD = 500.0, 5, math.radians(35.0)
FLOWN: dict[str, tuple[str, Any]] = {
    "four": ("pid", lambda: load_vehicle("x_quad")),
    "four ideal": ("backstepping", lambda: load_vehicle("paper_quad").with_ideal_rotors()),
    "six": ("backstepping", lambda: ring(6)),
    "eight": ("pid", lambda: ring(8, first_deg=22.5)),
}


def both(controller: str, vehicle: Vehicle, real: str = "double") -> tuple[PythonLoops, Loops]:
    """Return the same loops in Python and in C."""
    law = load_controller(controller)
    outer_hz = INNER_HZ / DIVISOR
    loops = PythonLoops(vehicle, law, open_gains("tuned"), INNER_HZ, outer_hz, TILT_RAD)
    numbers = target_numbers(vehicle, law, open_gains("tuned"), TILT_RAD, INNER_HZ, DIVISOR)
    return loops, Loops(Core(real), numbers)


def run_python(loops: PythonLoops, inputs: Sequence) -> tuple[np.ndarray, np.ndarray]:
    """Step Python's loops through the sequence, as C's driver does."""
    rows, status = [], []
    row, speeds = np.zeros(LoopRow.SIZE), np.zeros(8, np.float32)
    for state, setpoint, target, flags in zip(*inputs, strict=True):
        if flags & RESET:
            loops.reset(state)
        if flags & SET_TARGET:
            loops.set_attitude_target(target)
        loops.step(state, setpoint, speeds, bool(flags & OUTER_DUE), row)
        rows.append(np.concatenate([loops.attitude_target, row[13:39]]))
        status.append(int(row[LoopRow.STATUS]))
    return np.array(rows), np.array(status)

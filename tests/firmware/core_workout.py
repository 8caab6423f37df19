"""Run everything that the core has, and write what came out: the same from every compiler and under every sanitizer.

``python -m tests.firmware.core_workout REAL LIBRARY OUT.npz``
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

import numpy as np

from flightstack.core.contract import LoopStatus
from tests.firmware.core_samples import Samples, sequence
from tests.firmware.core_support import OUTER_DUE, RESET, SET_TARGET, Core, Loops

EXTREMES = [0.0, -0.0, 1e-42, 1e-30, 1e-9, 1.0, 10000.0, 10001.0, 1e10, 1e20, 3e38, np.inf, np.nan]
STATE, SETPOINT, TARGET = 13, 11, 5
NAMES = [
    *((b"", b""), (b"A", b"A"), (b"SIXTEEN_LETTERS_", b"SIXTEEN_LETTERS_AND_MORE")),
    *((b"A", b"AB"), (b"AB", b"A"), (b"SIXTEEN_LETTERS_", b"SIXTEEN_LETTERSX")),
]
"""Pairs, the first three of them equal as far as they count."""


def mathematics(core: Core) -> dict[str, np.ndarray]:
    """Sine, cosine and arc tangent of all sorts of numbers."""
    s = Samples(20_000, 11)
    signed = np.array(EXTREMES + [-value for value in EXTREMES])
    y = np.concatenate([np.repeat(signed, signed.size), s.normal(1, 1.0)])
    x = np.concatenate([np.tile(signed, signed.size), s.normal(1, 100.0)])
    out = [np.zeros(x.size, core.dtype) for _ in range(3)]
    core.call("drive_math", x.size, core.array(y), core.array(x), *out)
    return dict(zip(("sine", "cosine", "angle"), out, strict=True))


def ring_numbers(rotors: int, ideal: bool) -> dict[str, float]:
    """Numbers of a vehicle with its rotors evenly on a circle of 0.25 m, their spins alternating."""
    angle = 2.0 * np.pi * (np.arange(rotors) + 0.5) / rotors
    spin = np.where(np.arange(rotors) % 2 == 0, 1.0, -1.0)
    b, arm = 1e-5, 0.25
    effectiveness = b * np.array([np.ones(rotors), -arm * np.sin(angle), arm * np.cos(angle), -0.02 * spin])
    allocation = np.linalg.pinv(effectiveness)
    values = {"FS_ROTORS": float(rotors), "FS_MASS": 1.0, "POS_THR_MAX": 18.0}
    for rotor in range(rotors):
        for axis in range(4):
            values[f"FS_ALLOC_{rotor}{axis}"] = float(allocation[rotor, axis])
            values[f"FS_EFF_{axis}{rotor}"] = float(effectiveness[axis, rotor])
        values[f"FS_LOW_{rotor}"] = -1e12 if ideal else 2500.0
        values[f"FS_HIGH_{rotor}"] = 1e12 if ideal else 2.0 * 9.81 / (rotors * b)
        values[f"FS_SPIN_{rotor}"] = float(spin[rotor])
    return values


CASES = {
    f"{law} {rotors}{' ideal' if ideal else ''}": (law, rotors, ideal)
    for law in (0, 1)
    for rotors, ideal in ((4, False), (4, True), (6, False), (8, False))
}


def shaken(core: Core) -> dict[str, np.ndarray]:
    """Both laws and all rotor sets, shaken about; unsound numbers, resets and targets among the inputs."""
    made = {}
    for number, (name, (law, rotors, ideal)) in enumerate(CASES.items()):
        loops = Loops(
            core, {**ring_numbers(rotors, ideal), "FS_CTRL": law, "ATT_REF_BW": 60.0 if rotors != 6 else 0.0}
        )
        if name == "0 8":  # one rotor that makes no thrust by itself
            assert loops.set("FS_ALLOC_00", 0.0) == 0
        if name == "1 6":  # a rotor whose drag is not what the allocation takes it for
            assert loops.set("FS_EFF_30", 2.0 * loops.get("FS_EFF_30")) == 0
        if name == "1 8":  # a rotor that is weaker than the others
            assert loops.set("FS_HIGH_0", 0.9 * loops.get("FS_HIGH_0")) == 0
        rows, status = loops.run(*sequence(3000, 20 + number, 10.0))
        made |= {name: rows, f"{name} status": status}
    return made


def spoiled(core: Core) -> dict[str, np.ndarray]:
    """Each single input not finite, for inner and outer loop, then a sound tick."""
    level = np.zeros(STATE + SETPOINT + TARGET)
    level[[6, STATE + SETPOINT]] = 1.0
    level[-1] = 5.0
    rows = []
    for place in range(level.size):
        for value in (np.nan, np.inf, -np.inf):
            bad = level.copy()
            bad[place] = value
            rows += [level, bad, level]
    inputs = np.array(rows)
    parts = inputs[:, :STATE], inputs[:, STATE : STATE + SETPOINT], inputs[:, STATE + SETPOINT :]
    made = {}
    for name, second in (("outer", OUTER_DUE), ("target", SET_TARGET), ("both", OUTER_DUE | SET_TARGET)):
        flags = np.tile([RESET | OUTER_DUE, second, 0], inputs.shape[0] // 3)
        outputs, status = Loops(core, {}).run(*parts, flags)
        made |= {f"spoiled {name}": outputs, f"spoiled {name} status": status}
    return made


def extreme(core: Core) -> dict[str, np.ndarray]:
    """Finite numbers of any size in every place: whatever comes of it is finite."""
    s = Samples(20_000, 31)

    def anything(width: int) -> np.ndarray:
        least, most = (-44.0, 38.0) if core.real == "float" else (-323.0, 308.0)
        exponent = s.random.uniform(least, most, (s.count, width)) * (s.random.random((s.count, width)) < 0.3)
        return s.random.choice([-1.0, 1.0], (s.count, width)) * 10.0**exponent

    flags = s.random.choice([0, OUTER_DUE, SET_TARGET, RESET, RESET | OUTER_DUE], s.count)
    made = {}
    for law in (0, 1):
        loops = Loops(core, {"FS_CTRL": law})
        rows, status = loops.run(anything(STATE), anything(SETPOINT), anything(TARGET), flags)
        made |= {f"extreme {law}": rows, f"extreme {law} status": status}
    return made


def spun(core: Core) -> dict[str, np.ndarray]:
    """Yaw rates whose torque is a number while the rotors' squared speeds for it are none, between sound ticks."""
    rates = np.finfo(core.dtype).max / 10.0 ** np.arange(2, 10)
    count = 2 * rates.size + 1
    state, setpoint, target = (np.zeros((count, width)) for width in (STATE, SETPOINT, TARGET))
    state[:, 6] = target[:, 0] = 1.0
    target[:, 4] = 5.0
    state[1::2, 12] = rates
    flags = np.array([RESET | SET_TARGET] + [0] * (count - 1))
    made = {}
    for name, drag in (("as allocated", 1.0), ("otherwise", 2.0)):
        numbers = ring_numbers(4, ideal=False)
        numbers["FS_EFF_30"] *= drag
        rows, status = Loops(core, numbers).run(state, setpoint, target, flags)
        assert status[1] == LoopStatus.OUTPUT_NOT_FINITE
        assert not (status[::2] & LoopStatus.OUTPUT_NOT_FINITE).any()
        made |= {f"spun {name}": rows, f"spun {name} status": status}
    return made


def large(core: Core) -> dict[str, np.ndarray]:
    """Numbers that are finite while their sum is not, in each part of the input: they are flown, or the last again."""
    most = float(np.finfo(core.dtype).max)
    state, setpoint, target = (np.zeros((4, width)) for width in (STATE, SETPOINT, TARGET))
    state[:, 6] = target[:, 0] = 1.0
    target[:, 4] = 5.0
    state[1, :2] = setpoint[2, :2] = target[3, :2] = most
    flags = np.array([RESET | SET_TARGET, 0, OUTER_DUE, SET_TARGET])
    rows, status = Loops(core, {}).run(state, setpoint, target, flags)
    assert not (status & LoopStatus.INPUT_NOT_FINITE).any()
    return {"large": rows, "large status": status}


def parameters(core: Core) -> dict[str, np.ndarray]:
    """Every parameter at both ends, beyond them, half a unit off, and not finite; and indices beyond the table."""
    loops, library = Loops(core, {}), core.library
    values, results = [], []
    count = library.fs_param_count()
    for index in range(count):
        name = library.fs_param_name(index)
        assert library.fs_param_find(name) == index
        for value in (-2e15, -1.0, 0.0, 0.5, 1.0, 4.0, 4.5, 5.0, 9.0, 1e4, 2e15, np.nan, np.inf, -np.inf):
            results.append(loops.set(name.decode(), value))
            values.append(loops.get(name.decode()))
    pointer = loops.memory.ctypes.data_as(ctypes.c_void_p)
    assert library.fs_param_name(count) == b""
    assert library.drive_set(pointer, count, core.c_real(1.0)) == 1
    assert library.drive_get(pointer, count) == 0.0
    assert library.fs_param_find(b"NO_SUCH_NAME") == -1
    for integral in (1.0, float(np.finfo(core.dtype).max)):
        results.append(loops.set("PID_ROLL_I", 100.0))
        core.call("drive_set_integral", loops.memory, core.c_real(integral))
        for gain in (1e-3, 0.0):
            results.append(loops.set("PID_ROLL_I", gain))
            results.append(loops.set("PID_ROLL_I", gain))  # said again
            values += loops.integrals
    same = library.fs_param_same_name
    assert [same(*pair) & 1 for pair in NAMES] == [1, 1, 1, 0, 0, 0]
    return {"values": np.array(values), "results": np.array(results)}


def rate_groups(core: Core) -> dict[str, np.ndarray]:
    """Ticks in which the outer loop is due."""
    made = {}
    for divisor in (0, 1, 5, 65535):
        due = np.zeros(70_000, np.uint16)
        core.call("drive_rate_groups", divisor, due.size, due)
        made[f"due {divisor}"] = due
    return made


def clock(core: Core) -> dict[str, np.ndarray]:
    """Costs by a clock that wraps around."""
    state, setpoint, target = np.zeros((6, STATE)), np.zeros((6, SETPOINT)), np.zeros((6, TARGET))
    state[:, 6] = target[:, 0] = 1.0
    state[5, 0] = np.nan
    flags = np.array([RESET | OUTER_DUE, 0, SET_TARGET, OUTER_DUE, 0, OUTER_DUE], np.uint16)
    costs, loops = np.zeros((6, 5), np.uint32), Loops(core, {})
    rows, status = np.zeros((6, 31), core.dtype), np.zeros(6, np.uint16)
    inputs = [core.array(part) for part in (state, setpoint, target)]
    core.call("drive_loops", loops.memory, 6, *inputs, flags, rows, status, costs, 2**32 - 95)
    return {"costs": costs, "costs status": status}


def workout(core: Core) -> dict[str, np.ndarray]:
    """Run all of it."""
    made: dict[str, np.ndarray] = {}
    for part in (mathematics, shaken, spoiled, extreme, spun, large, parameters, rate_groups, clock):
        made |= part(core)
    return made


if __name__ == "__main__":
    real, library, out = sys.argv[1:]
    np.savez(out, **workout(Core(real, Path(library))))

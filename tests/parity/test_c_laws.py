"""Each law of the core in C against Python's, on random inputs.

With double the operations and their order are Python's: every number has the same bits. With float the difference is
counted in units of the last place of the largest value that the quantity has among the samples (its full scale, as of
an instrument); the same inputs go to both, because all of them fit in float32. The number measured stands beside each
bound.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

from tests.firmware import core_reference as python
from tests.firmware.core_samples import Samples
from tests.firmware.core_support import Compared, Core
from tests.support.tools import NIGHTLY

COUNT = 1_000_000 if NIGHTLY else 200_000
DT_S = (0.0005, 0.02)


@functools.cache
def core(real: str) -> Core:
    return Core(real)


# ------------------------------------------------------------------ position


def position(real: str) -> dict[str, Compared]:
    s = Samples(COUNT, 1)
    attitude = s.attitudes()
    states = np.hstack([s.normal(3, 20.0), s.normal(3, 5.0), attitude, s.normal(3, 1.0)])
    setpoints = np.hstack(
        [s.narrow(states[:, :3] + s.normal(3, 0.5)), s.normal(3, 3.0), s.normal(3, 1.0), s.normal(2, 2.0)]
    )
    gain, integral = (0.0, 15.0), (0.0, 5.0)
    params = s.uniform(
        *(gain, integral, gain, gain, integral, gain, (0.3, 3.0), (9.7, 9.9)),
        *((0.2, 2.0), (10.0, 60.0), (0.1, 1.2), (0.0, 5.0)),
    )
    memory, dt_s, saturation = s.normal(3, 1.0), s.uniform(DT_S), s.choice(1, [-1.0, 0.0, 1.0])
    c = core(real)
    c_memory, c_target = c.array(memory), c.unwritten(COUNT, 5)
    c.call(
        "drive_position", COUNT, c_memory, c.array(states), c.array(setpoints), c.array(params), c.array(dt_s),
        c.array(saturation), c_target,
    )  # fmt: skip
    py_memory, py_target = memory.copy(), np.zeros((COUNT, 5))
    python.position(py_memory, states, setpoints, params, dt_s, saturation, py_target)
    c_target, c_memory = c_target.astype(np.float64), c_memory.astype(np.float64)
    return {
        "attitude": Compared(c_target[:, :4], py_target[:, :4]),
        "thrust": Compared(c_target[:, 4:], py_target[:, 4:]),
        "integral": Compared(c_memory, py_memory),
    }


def test_position_loop_in_double_has_pythons_bits() -> None:
    for name, compared in position("double").items():
        assert compared.has_same_bits(), name


def test_position_loop_in_float_is_near() -> None:
    made = position("float")
    assert made["attitude"].full_scale_ulps().max() < 16  # measured 8.5
    assert made["thrust"].full_scale_ulps().max() < 20  # measured 9.9
    # an integral goes on or rests; where that hangs by a rounding the two may decide otherwise
    integral = made["integral"].full_scale_ulps()
    assert np.count_nonzero(integral > 2) < 10  # measured 0.6, and none decided otherwise


# ------------------------------------------------------------------ attitude reference


def reference(real: str, rate: float = 2.0, most: float = 10.0) -> dict[str, Compared]:
    """``rate``: standard deviation of what is turned with, ``most``: the largest limit of it [rad/s]."""
    s = Samples(COUNT, 2)
    attitude = s.attitudes()
    start = s.near(attitude, 0.1)
    end = s.near(start, 0.05)
    memory = np.hstack([s.near(start, 0.05), s.normal(3, rate)])
    params = s.uniform((0.0, 120.0), (0.5, 1.5), (1.0, most), (20.0, 300.0))
    params[s.random.random(COUNT) < 0.05, 0] = 0.0  # no filter
    fraction, dt_s = s.uniform((0.0, 1.2)), s.uniform(DT_S)
    c = core(real)
    c_memory, c_reference, c_error = c.array(memory), c.unwritten(COUNT, 10), c.unwritten(COUNT, 3)
    c.call(
        "drive_reference", COUNT, c_memory, c.array(start), c.array(end), c.array(fraction), c.array(params),
        c.array(dt_s), c.array(attitude), c_reference, c_error,
    )  # fmt: skip
    py_memory, py_reference, py_error = memory.copy(), np.zeros((COUNT, 10)), np.zeros((COUNT, 3))
    python.reference(py_memory, start, end, fraction, params, dt_s, attitude, py_reference, py_error)
    c_reference, c_memory = c_reference.astype(np.float64), c_memory.astype(np.float64)
    return {
        "attitude": Compared(c_reference[:, :4], py_reference[:, :4]),
        "rates": Compared(c_reference[:, 4:7], py_reference[:, 4:7]),
        "acceleration": Compared(c_reference[:, 7:], py_reference[:, 7:]),
        "kept attitude": Compared(c_memory[:, :4], py_memory[:, :4]),
        "kept rates": Compared(c_memory[:, 4:], py_memory[:, 4:]),
        "error": Compared(c_error.astype(np.float64), py_error),
    }


REFERENCE_FLOAT_ULPS = {
    "attitude": 10,  # measured 4.6
    "rates": 64,  # 32.5: the stiffest filter multiplies the error by 14400 before it is limited
    "acceleration": 6,  # 2.3
    "kept attitude": 10,
    "kept rates": 64,
    "error": 10,  # 4.6
}


def test_attitude_reference_in_double_has_pythons_bits() -> None:
    for name, compared in reference("double").items():
        assert compared.has_same_bits(), name


def test_attitude_reference_turns_far_in_a_step_as_in_python() -> None:
    """Half a radian and more, beyond what is summed up without a norm."""
    for name, compared in reference("double", rate=30.0, most=60.0).items():
        assert compared.has_same_bits(), name
    for name, compared in reference("float", rate=30.0, most=60.0).items():
        assert compared.full_scale_ulps().max() < REFERENCE_FLOAT_ULPS[name], name


def test_attitude_reference_in_float_is_near() -> None:
    for name, compared in reference("float").items():
        assert compared.full_scale_ulps().max() < REFERENCE_FLOAT_ULPS[name], name


# ------------------------------------------------------------------ attitude laws


def attitude_inputs(s: Samples) -> np.ndarray:
    """Rows of ``AttitudeInputs``, shape (n, 24)."""
    attitude = s.attitudes()
    return np.hstack(
        [
            *(attitude, s.normal(3, 2.0), s.near(attitude, 0.1), s.normal(3, 2.0), s.normal(3, 30.0)),
            *(s.normal(3, 0.1), s.normal(1, 50.0)[:, None], s.choice(3, [-1.0, 0.0, 1.0])),
        ]
    )


INERTIAS = ((1e-3, 0.1), (1e-3, 0.1), (1e-3, 0.1))


def pid(real: str) -> dict[str, Compared]:
    s = Samples(COUNT, 3)
    inputs, memory, dt_s = attitude_inputs(s), s.normal(3, 0.2), s.uniform(DT_S)
    params = s.uniform(
        *[(0.0, 400.0)] * 3, *[(0.0, 300.0)] * 3, *[(0.0, 40.0)] * 3, *[(0.0, 1.0)] * 2, *INERTIAS
    )
    c = core(real)
    c_memory, c_torque = c.array(memory), c.unwritten(COUNT, 3)
    c.call("drive_pid", COUNT, c_memory, c.array(inputs), c.array(params), c.array(dt_s), c_torque)
    py_memory, py_torque = memory.copy(), np.zeros((COUNT, 3))
    python.pid(py_memory, inputs, params, dt_s, py_torque)
    return {
        "torque": Compared(c_torque.astype(np.float64), py_torque),
        "integral": Compared(c_memory.astype(np.float64), py_memory),
    }


def backstepping(real: str) -> dict[str, Compared]:
    s = Samples(COUNT, 4)
    inputs = attitude_inputs(s)
    params = s.uniform(*[(0.0, 40.0)] * 6, *[(0.0, 1.0)] * 2, *INERTIAS, (0.0, 1e-4))
    c = core(real)
    c_torque, py_torque = c.unwritten(COUNT, 3), np.zeros((COUNT, 3))
    c.call("drive_backstepping", COUNT, c.array(inputs), c.array(params), c_torque)
    python.backstepping(inputs, params, py_torque)
    return {"torque": Compared(c_torque.astype(np.float64), py_torque)}


@pytest.mark.parametrize("law", [pid, backstepping])
def test_attitude_laws_in_double_have_pythons_bits(law) -> None:  # type: ignore[no-untyped-def]
    for name, compared in law("double").items():
        assert compared.has_same_bits(), name


@pytest.mark.parametrize("law", [pid, backstepping])
def test_attitude_laws_in_float_are_near(law) -> None:  # type: ignore[no-untyped-def]
    for name, compared in law("float").items():
        assert compared.full_scale_ulps().max() < 4, name  # measured 1.3

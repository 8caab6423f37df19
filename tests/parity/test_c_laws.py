"""Each law of the core in C against Python's, on random inputs.

With double the operations and their order are Python's: every number has the same bits. With float the difference is
counted in units of the last place of the largest value that the quantity has among the samples (its full scale, as of
an instrument); the same inputs go to both, because all of them fit in float32. The number measured stands beside each
bound.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from flightstack.core.portable_math import tan
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


class Case(NamedTuple):
    """Inputs of a law, and what Python makes of them; computed once, since both precisions are compared with it."""

    inputs: tuple[np.ndarray, ...]
    outputs: tuple[np.ndarray, ...]


@functools.cache
def position_in_python() -> Case:
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
    advanced, target = memory.copy(), np.zeros((COUNT, 5))
    python.position(advanced, states, setpoints, params, dt_s, saturation, target)
    return Case((memory, states, setpoints, params, dt_s, saturation), (advanced, target))


def position(real: str) -> dict[str, Compared]:
    case, c = position_in_python(), core(real)
    memory, *inputs = map(c.array, case.inputs)
    target = c.unwritten(COUNT, 5)
    c.call("drive_position", COUNT, memory, *inputs, target)
    py_memory, py_target = case.outputs
    target = target.astype(np.float64)
    return {
        "attitude": Compared(target[:, :4], py_target[:, :4]),
        "thrust": Compared(target[:, 4:], py_target[:, 4:]),
        "integral": Compared(memory.astype(np.float64), py_memory),
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


def test_position_loop_integrates_at_exactly_the_limit_of_the_tilt() -> None:
    """Where the horizontal demand is the largest that the tilt allows, and stops one rounding beyond."""
    c, tilt_rad, gravity_m_s2 = core("double"), 0.5, 9.81
    limit = tan(tilt_rad) * gravity_m_s2
    states, setpoints, target = np.zeros((3, 13)), np.zeros((3, 11)), np.zeros((3, 5))
    states[:, 6] = 1.0
    setpoints[:, 0] = [np.nextafter(limit, 0.0), limit, np.nextafter(limit, np.inf)]
    params = np.tile([1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 1.0, gravity_m_s2, 0.0, 100.0, tilt_rad, 5.0], (3, 1))
    memory, dt_s, saturation = np.zeros((3, 3)), np.full(3, 0.01), np.zeros(3)
    advanced, py_target = memory.copy(), target.copy()
    python.position(advanced, states, setpoints, params, dt_s, saturation, py_target)
    c.call("drive_position", 3, memory, states, setpoints, params, dt_s, saturation, target)
    assert (memory[:, 0] > 0.0).tolist() == [True, True, False]
    assert np.array_equal(memory, advanced)
    assert np.array_equal(target, py_target)


@pytest.mark.parametrize(("limits_n", "down_m"), [((0.0, 9.81), -1.0), ((9.81, 20.0), 1.0)])
def test_position_loop_holds_the_vertical_integral_at_exactly_a_limit(
    limits_n: tuple[float, float], down_m: float
) -> None:
    """Of the thrust, which is the weight: no gain asks for more."""
    states, setpoints, target = np.zeros((1, 13)), np.zeros((1, 11)), np.zeros((1, 5))
    states[:, 6], setpoints[:, 2] = 1.0, down_m
    params = np.array([[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 9.81, *limits_n, 0.5, 5.0]])
    memory, dt_s, saturation = np.zeros((1, 3)), np.full(1, 0.01), np.zeros(1)
    advanced, py_target = memory.copy(), target.copy()
    python.position(advanced, states, setpoints, params, dt_s, saturation, py_target)
    core("double").call("drive_position", 1, memory, states, setpoints, params, dt_s, saturation, target)
    assert memory.tolist() == advanced.tolist() == [[0.0, 0.0, 0.0]]


# ------------------------------------------------------------------ attitude reference


@functools.cache
def reference_in_python(rate: float, most: float) -> Case:
    s = Samples(COUNT, 2)
    attitude = s.attitudes()
    start = s.near(attitude, 0.1)
    end = s.near(start, 0.05)
    start[0] = end[0] = 0.0  # no attitude: the identity is in its place
    memory = np.hstack([s.near(start, 0.05), s.normal(3, rate)])
    params = s.uniform((0.0, 120.0), (0.5, 1.5), (1.0, most), (20.0, 300.0))
    params[s.random.random(COUNT) < 0.05, 0] = 0.0  # no filter
    inputs = (start, end, s.uniform((0.0, 1.2)), params, s.uniform(DT_S), attitude)
    advanced, made, error = memory.copy(), np.zeros((COUNT, 10)), np.zeros((COUNT, 3))
    python.reference(advanced, *inputs, made, error)
    return Case((memory, *inputs), (advanced, made, error))


def reference(real: str, rate: float = 2.0, most: float = 10.0) -> dict[str, Compared]:
    """``rate``: standard deviation of what is turned with, ``most``: the largest limit of it [rad/s]."""
    case, c = reference_in_python(rate, most), core(real)
    memory, *inputs = map(c.array, case.inputs)
    made, error = c.unwritten(COUNT, 10), c.unwritten(COUNT, 3)
    c.call("drive_reference", COUNT, memory, *inputs, made, error)
    py_memory, py_made, py_error = case.outputs
    made, memory = made.astype(np.float64), memory.astype(np.float64)
    return {
        "attitude": Compared(made[:, :4], py_made[:, :4]),
        "rates": Compared(made[:, 4:7], py_made[:, 4:7]),
        "acceleration": Compared(made[:, 7:], py_made[:, 7:]),
        "kept attitude": Compared(memory[:, :4], py_memory[:, :4]),
        "kept rates": Compared(memory[:, 4:], py_memory[:, 4:]),
        "error": Compared(error.astype(np.float64), py_error),
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


@functools.cache
def pid_in_python() -> Case:
    s = Samples(COUNT, 3)
    inputs, memory, dt_s = attitude_inputs(s), s.normal(3, 0.2), s.uniform(DT_S)
    params = s.uniform(
        *[(0.0, 400.0)] * 3, *[(0.0, 300.0)] * 3, *[(0.0, 40.0)] * 3, *[(0.0, 1.0)] * 2, *INERTIAS
    )
    advanced, torque = memory.copy(), np.zeros((COUNT, 3))
    python.pid(advanced, inputs, params, dt_s, torque)
    return Case((memory, inputs, params, dt_s), (advanced, torque))


def pid(real: str) -> dict[str, Compared]:
    case, c = pid_in_python(), core(real)
    memory, *inputs = map(c.array, case.inputs)
    torque = c.unwritten(COUNT, 3)
    c.call("drive_pid", COUNT, memory, *inputs, torque)
    py_memory, py_torque = case.outputs
    return {
        "torque": Compared(torque.astype(np.float64), py_torque),
        "integral": Compared(memory.astype(np.float64), py_memory),
    }


@functools.cache
def backstepping_in_python() -> Case:
    s = Samples(COUNT, 4)
    inputs = attitude_inputs(s)
    params = s.uniform(*[(0.0, 40.0)] * 6, *[(0.0, 1.0)] * 2, *INERTIAS, (0.0, 1e-4))
    torque = np.zeros((COUNT, 3))
    python.backstepping(inputs, params, torque)
    return Case((inputs, params), (torque,))


def backstepping(real: str) -> dict[str, Compared]:
    case, c = backstepping_in_python(), core(real)
    torque = c.unwritten(COUNT, 3)
    c.call("drive_backstepping", COUNT, *map(c.array, case.inputs), torque)
    return {"torque": Compared(torque.astype(np.float64), case.outputs[0])}


@pytest.mark.parametrize("law", [pid, backstepping])
def test_attitude_laws_in_double_have_pythons_bits(law) -> None:  # type: ignore[no-untyped-def]
    for name, compared in law("double").items():
        assert compared.has_same_bits(), name


@pytest.mark.parametrize("law", [pid, backstepping])
def test_attitude_laws_in_float_are_near(law) -> None:  # type: ignore[no-untyped-def]
    for name, compared in law("float").items():
        assert compared.full_scale_ulps().max() < 4, name  # measured 1.3


@pytest.fixture(scope="module", autouse=True)
def _forget() -> Iterator[None]:
    """Samples of all laws and numbers take hundreds of megabytes."""
    yield
    for samples in (position_in_python, reference_in_python, pid_in_python, backstepping_in_python):
        samples.cache_clear()

"""The mixer of the core in C against Python's, on random inputs, as in test_c_laws.py."""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from flightstack.control.mixer import Mixer, derived, mixer_for
from flightstack.params.vehicle import Vehicle, load_vehicle
from tests.firmware import core_reference as python
from tests.firmware.core_mixer import mixer_of_c
from tests.firmware.core_samples import Samples
from tests.firmware.core_support import Compared, Core, same_bits
from tests.support.rotor_sets import multirotor, ring
from tests.support.tools import NIGHTLY

COUNT = 1_000_000 if NIGHTLY else 200_000
DT_S = (0.0005, 0.02)


@functools.cache
def core(real: str) -> Core:
    return Core(real)


# ------------------------------------------------------------------ mixer


def askew() -> Vehicle:
    """Return six rotors at uneven places: allocations of many sizes."""
    places = [(0.3, 0.02), (0.14, 0.24), (-0.1, 0.27), (-0.29, -0.01), (-0.13, -0.22), (0.16, -0.26)]
    return multirotor(places, [1, -1, 1, -1, 1, -1])


def with_other_rotor(vehicle: Vehicle, index: int, **factors: float) -> Vehicle:
    """Return a vehicle one of whose rotors has some of its numbers multiplied."""
    rotors = list(vehicle.rotors)
    changed = {name: factor * getattr(rotors[index], name) for name, factor in factors.items()}
    rotors[index] = dataclasses.replace(rotors[index], **changed)
    return dataclasses.replace(vehicle, rotors=tuple(rotors))


def unwilling() -> Vehicle:
    """Return four rotors of which one has to pull downwards in a hover: its share of the thrust is negative."""
    return multirotor([(0.3, 0.0), (0.1, 0.0), (-0.35, 0.2), (-0.35, -0.2)], [1, 1, -1, -1])


VEHICLES = {
    "plus": lambda: load_vehicle("paper_quad"),
    "cross": lambda: load_vehicle("x_quad"),
    "ideal": lambda: load_vehicle("x_quad").with_ideal_rotors(),
    "askew": askew,
    "octo": lambda: ring(8, first_deg=22.5),
    "weak": lambda: with_other_rotor(ring(8, first_deg=22.5), 1, max_speed_rad_s=0.9),
    "eager": lambda: with_other_rotor(load_vehicle("x_quad"), 3, min_speed_rad_s=2.0),
    "unwilling": unwilling,
}
LIFTING = [name for name in VEHICLES if name != "unwilling"]


MIXER_FLOAT_ULPS = {"squares": 16, "thrust": 6, "torque": 8, "relative speed": 32}
"""Measured, the largest of all vehicles: 9.1, 2.9, 4.6 and 15.7."""


class Mixed(NamedTuple):
    """What both sides made of the same wrenches."""

    quantities: dict[str, Compared]
    saturation: np.ndarray
    python_saturation: np.ndarray
    wrenches: np.ndarray
    beyond: np.ndarray
    """Speeds that C wrote beyond the vehicle's rotors."""
    ways: int
    """Short ways that the mixer took itself to be fit for: 1 effectiveness undoes allocation, 2 rotors are alike."""


class Case(NamedTuple):
    """Wrenches for a mixer, and what Python makes of them."""

    rotors: Mixer
    wrenches: np.ndarray
    speeds: np.ndarray
    achieved: np.ndarray
    relative: np.ndarray


@functools.cache
def mixed_in_python(name: str, count: int) -> Case:
    """Mix wrenches from easy to far beyond what the rotors can do."""
    vehicle = VEHICLES[name]()
    s = Samples(count, 5)
    weight, n = vehicle.weight_n, len(vehicle.rotors)
    wrenches = np.hstack(
        [
            s.normal(1, weight)[:, None] + weight,
            s.normal(2, 0.2 * weight),
            s.normal(1, 0.02 * weight)[:, None],
        ]
    )
    made = Case(
        mixer_for(vehicle), s.narrow(wrenches), np.zeros((count, n)), np.zeros((count, 4)), np.zeros(count)
    )
    python.mixer(made.wrenches, made.rotors, made.speeds, made.achieved, made.relative)
    return made


def mixed(real: str, name: str, count: int = COUNT // 5) -> Mixed:
    case, c = mixed_in_python(name, count), core(real)
    # not narrowed: with float the rounding of these numbers is part of the difference
    flat, n = mixer_of_c(c, case.rotors), case.rotors.spin.size
    speeds, achieved, saturation = c.unwritten(count, 8), c.unwritten(count, 4), c.unwritten(count, 4)
    relative = c.unwritten(count)
    c.call("drive_mixer", count, c.array(case.wrenches), flat, n, speeds, achieved, saturation, relative)
    ways = int(c.library.drive_mixer_ways(flat.ctypes.data_as(ctypes.c_void_p)))
    lag = case.wrenches - case.achieved
    quantities = {
        "speeds": Compared(speeds[:, :n].astype(np.float64), case.speeds),
        "squares": Compared(speeds[:, :n].astype(np.float64) ** 2, case.speeds**2),
        "thrust": Compared(achieved[:, :1].astype(np.float64), case.achieved[:, :1]),
        "torque": Compared(achieved[:, 1:].astype(np.float64), case.achieved[:, 1:]),
        "relative speed": Compared(relative[:, None].astype(np.float64), case.relative[:, None]),
    }
    return Mixed(
        quantities,
        np.sign(saturation),
        np.sign(lag) * (np.abs(lag) > 1e-9),
        case.wrenches,
        speeds[:, n:],
        ways,
    )


@pytest.mark.parametrize("name", VEHICLES)
def test_mixer_in_double_has_pythons_bits(name: str) -> None:
    """From easy wrenches to some far beyond the rotors; one vehicle has a rotor that pulls down in a hover."""
    made = mixed("double", name)
    limited = (made.python_saturation[:, :3] != 0.0).any(axis=1)
    assert limited.any() == (name != "ideal")
    assert name not in LIFTING or limited.mean() < 0.95
    for quantity, compared in made.quantities.items():
        assert compared.has_same_bits(), quantity
    assert np.array_equal(made.saturation, made.python_saturation)
    assert not made.beyond.any()


@pytest.mark.parametrize("name", LIFTING)
def test_mixer_in_float_is_near_and_takes_no_rounding_for_a_limit(name: str) -> None:
    made = mixed("float", name)
    for quantity, compared in made.quantities.items():
        if quantity != "speeds":  # a root of nearly nothing has no digits; its square tells
            assert compared.full_scale_ulps().max() < MIXER_FLOAT_ULPS[quantity], quantity
    c, expected = made.saturation, made.python_saturation
    assert not np.any((c != 0.0) & (c != expected))
    assert np.count_nonzero(c != expected) < 10  # a limit by less than the rounding: 5 found at most


WAYS = {"plus": 3, "cross": 3, "ideal": 3, "askew": 1, "octo": 3, "weak": 1, "eager": 1, "unwilling": 0}


@pytest.mark.parametrize("real", ["float", "double"])
@pytest.mark.parametrize("name", VEHICLES)
def test_the_mixer_knows_which_short_ways_it_may_go(name: str, real: str) -> None:
    assert mixed(real, name, 1).ways == WAYS[name]
    rotors = mixer_for(VEHICLES[name]())
    assert rotors.is_inverse + 2.0 * rotors.is_even == WAYS[name]


def edge_wrenches(rotors: Mixer, rounding: float) -> np.ndarray:
    """Wrenches at which a rotor is within 40 roundings of a limit, with next to no yaw or none."""
    made = []
    for tilt, steps in itertools.product((0.0, 0.3, -0.7), range(-40, 41)):
        lift = np.array([rotors.high, rotors.low]) - rotors.allocation[:, 1] * tilt
        for thrust in (lift / rotors.allocation[:, 0]).ravel() * (1.0 + steps * rounding):
            made += [[thrust, tilt, 0.0, yaw] for yaw in (0.0, 1e-9, -1e-9)]
    return np.array(made)


@functools.cache
def at_edges_in_python(name: str, dtype: np.dtype[np.floating]) -> Case:
    rotors = mixer_for(VEHICLES[name]())
    wrenches = edge_wrenches(rotors, float(np.finfo(dtype).eps)).astype(dtype).astype(np.float64)
    count = len(wrenches)
    made = Case(rotors, wrenches, np.zeros((count, rotors.spin.size)), np.zeros((count, 4)), np.zeros(count))
    python.mixer(wrenches, rotors, made.speeds, made.achieved, made.relative)
    return made


@pytest.mark.parametrize(("real", "apart"), [("float", 3.0), ("double", 24.0)])  # measured 1.5 and 11.5
@pytest.mark.parametrize("name", LIFTING)
def test_no_rotor_is_asked_for_more_than_it_can_do_however_near_it_is(
    name: str, real: str, apart: float
) -> None:
    c = core(real)
    rounding = float(np.finfo(c.dtype).eps)
    rotors, wrenches, expected, achieved, _ = at_edges_in_python(name, c.dtype)
    count, n = len(wrenches), rotors.spin.size
    speeds, saturation = c.unwritten(count, 8), c.unwritten(count, 4)
    rest = c.unwritten(count, 4), saturation, c.unwritten(count)
    c.call("drive_mixer", count, c.array(wrenches), mixer_of_c(c, rotors), n, speeds, *rest)
    turning = speeds[:, :n].astype(np.float64)
    lag = wrenches - achieved
    told = saturation != 0.0  # rounding is taken for no limit
    assert np.array_equal(np.sign(saturation)[told], (np.sign(lag) * (np.abs(lag) > 1e-9))[told])
    squares, expected = turning * np.abs(turning), expected * np.abs(expected)
    assert (
        squares <= rotors.high + rounding * np.abs(rotors.high)
    ).all()  # measured 0.45 of it: the root's own
    assert (squares >= rotors.low - rounding * np.abs(rotors.low)).all()
    assert np.abs(squares - expected).max() < apart * rounding * np.abs(rotors.high).max()


@pytest.mark.parametrize("real", ["float", "double"])
def test_a_slow_rotor_turns_the_way_it_is_asked_to(real: str) -> None:
    """Ideal rotors turn both ways; here slower than 1 rad/s, where a square is less than its root."""
    rotors, c = mixer_for(VEHICLES["ideal"]()), core(real)
    square = np.linspace(-0.9, 0.9, 7)
    wrenches = np.zeros((7, 4))
    wrenches[:, 0] = square / rotors.allocation[0, 0]
    speeds, rest = c.unwritten(7, 8), [c.unwritten(7, 4), c.unwritten(7, 4), c.unwritten(7)]
    c.call("drive_mixer", 7, c.array(wrenches), mixer_of_c(c, rotors), rotors.spin.size, speeds, *rest)
    expected = np.sign(square) * np.sqrt(np.abs(square))
    assert speeds[:, :4] == pytest.approx(np.tile(expected[:, None], 4), rel=1e-6, abs=1e-6)


def test_a_rotor_that_is_asked_for_nothing_has_pythons_zero() -> None:
    """Whose sign tells which side of nothing it was taken for."""
    rotors, c = mixer_for(VEHICLES["ideal"]()), core("double")
    wrenches = np.zeros((1, 4))
    speeds, expected = c.unwritten(1, 8), np.full((1, 4), np.nan)
    rest = c.unwritten(1, 4), c.unwritten(1, 4), c.unwritten(1)
    c.call("drive_mixer", 1, wrenches, mixer_of_c(c, rotors), rotors.spin.size, speeds, *rest)
    python.mixer(wrenches, rotors, expected, np.zeros((1, 4)), np.zeros(1))
    assert same_bits(speeds[:, :4], expected)
    assert not expected.any()


def undoes(real: str, rotors: Mixer) -> bool:
    """Whether the mixer in C finds that effectiveness undoes allocation, and that every rotor lifts."""
    c, n = core(real), rotors.spin.size
    flat = mixer_of_c(c, rotors)
    c.call("drive_mixer", 0, flat, flat, n, flat, flat, flat, flat)  # derives, and mixes nothing
    return bool(c.library.drive_mixer_ways(flat.ctypes.data_as(ctypes.c_void_p)) & 1)


@pytest.mark.parametrize(("real", "fault"), [("float", 1e-5), ("double", 1e-12)])
def test_each_number_of_effectiveness_times_allocation_is_looked_at(real: str, fault: float) -> None:
    """One of the sixteen is off by ten times what rounding could make of it, the others are as they were."""
    rotors = mixer_for(load_vehicle("x_quad"))
    assert undoes(real, rotors)
    for row, column in np.ndindex(4, 4):
        most = np.abs(rotors.effectiveness[row]).max() * np.abs(rotors.allocation[:, column]).sum()
        for sign in (-1.0, 1.0):
            off = rotors.allocation.copy()
            off[:, column] += sign * fault * most * rotors.allocation[:, row]
            assert not undoes(real, rotors._replace(allocation=off)), (row, column, sign)


def test_what_allocation_does_beside_the_demand_is_told_as_achieved() -> None:
    """A rotor that turns the vehicle more than allocation knows: thrust and tilt are right, and yaw is not."""
    rotors = mixer_for(load_vehicle("x_quad"))
    effectiveness = rotors.effectiveness.copy()
    effectiveness[3, 0] *= 1.5
    rotors = derived(rotors.allocation, effectiveness, rotors.low, rotors.high, rotors.spin)
    wrenches = np.array([[10.0, 0.1, 0.2, 0.0]])
    c, n = core("double"), rotors.spin.size
    speeds, achieved, saturation = np.zeros((1, 8)), np.zeros((1, 4)), np.zeros((1, 4))
    c.call("drive_mixer", 1, wrenches, mixer_of_c(c, rotors), n, speeds, achieved, saturation, np.zeros(1))
    py_speeds, py_achieved = np.zeros((1, n)), np.zeros((1, 4))
    python.mixer(wrenches, rotors, py_speeds, py_achieved, np.zeros(1))
    assert np.array_equal(achieved, py_achieved)
    assert achieved[0, :3] == pytest.approx(wrenches[0, :3], rel=1e-12)
    assert abs(achieved[0, 3]) > 0.01
    assert saturation[0, 3] == -achieved[0, 3]


@pytest.mark.parametrize("real", ["float", "double"])
def test_a_rotor_that_lifts_nothing_bars_the_short_way(real: str) -> None:
    """Though effectiveness undoes allocation: no thrust brings such a rotor between its limits."""
    rotors = mixer_for(load_vehicle("x_quad"))
    share = np.array([[1.0, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [0, -1, -1, 1]])
    rotors = rotors._replace(allocation=share, effectiveness=np.linalg.inv(share))
    assert not undoes(real, rotors)
    share[3, 0] = 0.25
    assert undoes(real, rotors._replace(effectiveness=np.linalg.inv(share)))
    share = share[::-1].copy()
    share[0, 0] = 0.0
    assert not undoes(real, rotors._replace(allocation=share, effectiveness=np.linalg.inv(share)))


def test_the_mixers_samples_reach_every_limit_both_ways() -> None:
    for axis in range(4):
        assert np.isin([-1.0, 1.0], mixed("double", "cross").saturation[:, axis]).all(), axis
    assert (mixed("double", "ideal").quantities["speeds"].python < 0.0).any()


@pytest.fixture(scope="module", autouse=True)
def _forget() -> Iterator[None]:
    """Samples of all laws and numbers take hundreds of megabytes."""
    yield
    for samples in (mixed_in_python, at_edges_in_python):
        samples.cache_clear()

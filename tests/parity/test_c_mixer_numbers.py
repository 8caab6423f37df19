"""What the mixer in C derives from the numbers of its rotors, and the differences that it takes for rounding."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Iterator

import numpy as np
import pytest

from flightstack.control.mixer import Mixer, derived, mixer_for
from flightstack.core.contract import LoopStatus
from flightstack.params.vehicle import load_vehicle
from tests.firmware.core_mixer import mixer_of_c
from tests.firmware.core_support import Core

REALS = ("float", "double")
LEAST = 1e-9
"""Smallest difference of thrust [N] or torque [N m] that is a limit."""
SATURATED = [
    LoopStatus.THRUST_SATURATED,
    LoopStatus.ROLL_SATURATED,
    LoopStatus.PITCH_SATURATED,
    LoopStatus.YAW_SATURATED,
]


def address(values: np.ndarray) -> ctypes.c_void_p:
    return values.ctypes.data_as(ctypes.c_void_p)


def uneven() -> Iterator[Mixer]:
    """Yield mixers of four rotors that push down, or one of which has a number half as large again, of either sign."""
    even = mixer_for(load_vehicle("x_quad"))
    yield even
    yield derived(even.allocation, even.effectiveness, -2.0 * even.high, even.high, even.spin)
    for rotor, factor in itertools.product(range(4), (1.5, -1.5)):
        for name, column in [
            *itertools.product(("allocation", "effectiveness"), range(4)),
            ("low", 0),
            ("high", 0),
        ]:
            changed = {n: np.array(getattr(even, n)) for n in ("allocation", "effectiveness", "low", "high")}
            place = {"allocation": (rotor, column), "effectiveness": (column, rotor)}.get(name, rotor)
            changed[name][place] *= factor
            yield derived(**changed, spin=even.spin)


def nearly_even() -> Iterator[Mixer]:
    """Yield mixers of which one rotor's number differs from the first one's by as much as rounding may, and by more."""
    even = mixer_for(load_vehicle("x_quad"))
    allocation, effectiveness, low, high, spin = even[:5]
    yield derived(allocation, effectiveness, np.zeros(4), high, spin)
    for first, places in itertools.product((2.0 - 2.0**-23, 1.0), (7, 8, 9, 14, 15, 16, 17)):
        numbers = np.array([first, first + places * 2.0**-52, first, first])
        yield derived(allocation, effectiveness, numbers, high, spin)
        yield derived(allocation, effectiveness, low, numbers, spin)
        shares = np.column_stack([numbers, allocation[:, 1:]])
        yield derived(shares, effectiveness, low, high, spin)


def derived_in_c(core: Core, rotors: Mixer) -> tuple[np.ndarray, np.ndarray]:
    """Return middle, reach, is_inverse and is_even in a row, and the resolution of thrust, roll, pitch and yaw."""
    memory, resolution = mixer_of_c(core, rotors), core.unwritten(4)
    core.library.fs_mixer_derive(address(memory), ctypes.c_uint16(rotors.spin.size), address(resolution))
    n, numbers = rotors.spin.size, memory[1 + 88 :]
    return np.hstack([numbers[:n], numbers[8 : 8 + n], numbers[16:18]]).astype(np.float64), resolution


def test_numbers_derived_in_double_have_pythons_bits() -> None:
    core = Core("double")
    assert {rotors.is_even for rotors in nearly_even()} == {0.0, 1.0}
    for rotors in (*uneven(), *nearly_even()):
        expected = np.hstack([rotors.middle, rotors.reach, rotors.is_inverse, rotors.is_even])
        made, resolution = derived_in_c(core, rotors)
        assert np.array_equal(made, expected)
        assert (resolution == LEAST).all()


def test_resolution_in_float_grows_with_the_largest_effect_of_a_rotor() -> None:
    """Sixteen roundings of the largest sum that an axis can reach."""
    core = Core("float")
    for rotors in uneven():
        reached = np.maximum(abs(rotors.low), abs(rotors.high)).sum() * abs(rotors.effectiveness).max(axis=1)
        expected = LEAST + 16.0 * 2.0**-24 * reached
        made = derived_in_c(core, rotors)[1].astype(np.float64)
        assert (abs(made - expected) < 2e-7 * expected).all()  # measured 1.3e-7


@pytest.mark.parametrize("real", REALS)
def test_difference_up_to_the_resolution_is_no_limit(real: str) -> None:
    """Each axis has a resolution of its own here; a difference of exactly that is rounding, the next number is none."""
    core = Core(real)
    resolution = core.array([0.5, 1.0, 2.0, 4.0])
    call = core.library.fs_saturation_of
    call.restype = ctypes.c_uint16
    for axis, bit in enumerate(SATURATED):
        for sign in (1.0, -1.0):
            demanded, achieved, saturation = core.array([0.0] * 4), core.array([0.0] * 4), core.unwritten(4)
            words = [address(values) for values in (demanded, achieved, resolution, saturation)]
            achieved[axis] = -sign * resolution[axis]
            assert call(*words) == 0
            assert not saturation.any()
            achieved[axis] = -sign * np.nextafter(resolution[axis], np.inf, dtype=core.dtype)
            assert call(*words) == bit
            assert saturation[axis] == -achieved[axis]
            assert np.count_nonzero(saturation) == 1

"""Rotations of the core in C against Python's, where one formula takes over from another: random inputs miss that."""

from __future__ import annotations

import numpy as np

from tests.firmware import core_reference as python
from tests.firmware.core_support import Core, same_bits

SMALL_SQUARE, LARGEST_SQUARE = 0.01, 0.1715
"""Squares of half an angle, and of its tangent, at which the formula changes (flightstack/core/geometry.py)."""
COUNT = 20_000


def around(value: float) -> np.ndarray:
    """Return numbers around a positive one: the next hundred to each side, 1e-7 of it to each side, and below it."""
    nearest = value * (1.0 + np.arange(-100, 101) * 2.0**-53)
    below = np.random.default_rng(6).uniform(0.7, 1.0, COUNT)
    return np.concatenate([nearest, value * np.linspace(1.0 - 1e-7, 1.0 + 1e-7, 2_001), value * below])


def compare(turned: np.ndarray, rates: np.ndarray, dt_s: float) -> None:
    count, core = len(rates), Core("double")
    made, expected = ((np.full((count, 3), np.nan), np.full((count, 4), np.nan)) for _ in range(2))
    core.call("drive_rotations", count, turned, rates, np.full(count, dt_s), *made)
    python.rotations(turned, rates, np.full(count, dt_s), *expected)
    for c, own in zip(made, expected, strict=True):
        assert same_bits(c, own)


def test_rotations_at_the_borders_of_their_formulas_have_pythons_bits() -> None:
    sine, rate = around(np.sqrt(LARGEST_SQUARE)), around(2.0 * np.sqrt(SMALL_SQUARE))
    turned, rates = np.zeros((sine.size, 4)), np.zeros((sine.size, 3))
    turned[:, 0] = np.where(np.arange(sine.size) % 2, 1.0, -1.0)
    turned[:, 2], rates[:, 1] = sine, rate
    turned[-1], turned[-2], turned[-3] = (0.0, 1.0, 0.0, 0.0), (-0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0)
    rates[:100, 1] = 0.2 * (1.0 - 2.0**-51)
    rates[:100, 2] = 1e-9 * np.sqrt(np.arange(100.0))  # the sum of squares passes through every number
    rates[-1] = 0.0
    square = ((rates[:, 0] ** 2 + rates[:, 1] ** 2) + rates[:, 2] ** 2) * 0.25
    assert (square == SMALL_SQUARE).any()
    compare(turned, rates, 1.0)


def test_angles_at_the_borders_of_quadrants_have_pythons_bits() -> None:
    """Odd multiples of an eighth of a turn: the nearest quarter changes there."""
    angles = np.outer(np.pi / 4.0 * np.arange(1, 400, 2), 1.0 + np.linspace(-6e-8, 6e-8, 41)).ravel()
    rates = np.zeros((angles.size, 3))
    rates[:, 2] = angles
    compare(np.zeros((angles.size, 4)), rates, 2.0)

"""The conditions under which a flight ends early: crash, or loss of control. Pure.

A vehicle has crashed when it lies on its side, is 10 m away from its reference, or when the plant diverges. It has lost
control when height, position or heading is far outside the range of its reference over the last two seconds: a step of
the reference, however large, is no loss of control. A flight counts only up to its ending.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from flightstack.core.contract import FloatArray
from flightstack.core.geometry_bulk import euler_from_quaternions

BoolArray: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]
CRASHED, LOST = "crashed", "lost"
FARTHEST_M = 10.0
"""Distance from the reference at which a flight counts as crashed."""
HEIGHT_LOST_M, PLACE_LOST_M, HEADING_LOST_DEG = 1.0, 3.0, 60.0
WINDOW_S = 2.0
"""Time over which the range of the reference is taken."""
_UPRIGHT = 0.0  # smallest cosine of the tilt


class Ending(NamedTuple):
    """The end of a flight; ``how`` and ``why`` are empty if it is complete."""

    ticks: int
    """Ticks that count."""
    how: str
    why: str


def ending(state: FloatArray, reference: FloatArray, diverged: bool, hz: float) -> Ending:
    """Return the ending of a flight; a crash takes precedence over a loss of control.

    ``state`` has shape (n, 13), the array form of ``VehicleState``; ``reference`` (n, 4): north, east, down, yaw, NaN
    for an uncontrolled axis.
    """
    crash = _first(_crashes(state, reference), Ending(len(state), "", ""), CRASHED)
    if not crash.how and diverged:
        return Ending(len(state), CRASHED, "the numbers of the plant ran away")
    if crash.how:
        return crash
    return _first(_losses(state, reference, hz), crash, LOST)


def _first(found: list[tuple[BoolArray, str]], otherwise: Ending, how: str) -> Ending:
    """Return the earliest of the events, each given by its ticks (shape (n,), bool) and its description."""
    end = otherwise
    for when, why in found:
        found_at = np.flatnonzero(when)
        if len(found_at) and found_at[0] < end.ticks:
            end = Ending(int(found_at[0]), how, why)
    return end


def _crashes(state: FloatArray, reference: FloatArray) -> list[tuple[BoolArray, str]]:
    x, y = state[:, 7], state[:, 8]
    away = np.linalg.norm(state[:, :3] - reference[:, :3], axis=1)
    return [
        (1.0 - 2.0 * (x * x + y * y) < _UPRIGHT, "turned over"),
        (away > FARTHEST_M, f"{FARTHEST_M:g} m away from its reference"),
    ]


def _losses(state: FloatArray, reference: FloatArray, hz: float) -> list[tuple[BoolArray, str]]:
    heading = np.unwrap(euler_from_quaternions(state[:, 6:10])[:, 2])
    beyond = _beyond(np.column_stack((state[:, :3], heading)), reference, max(1, round(WINDOW_S * hz)))
    return [
        (beyond[:, 2] > HEIGHT_LOST_M, f"height off by more than {HEIGHT_LOST_M:g} m"),
        (beyond[:, 3] > math.radians(HEADING_LOST_DEG), f"heading off by more than {HEADING_LOST_DEG:g}°"),
        (
            np.hypot(beyond[:, 0], beyond[:, 1]) > PLACE_LOST_M,
            f"off its place by more than {PLACE_LOST_M:g} m",
        ),
    ]


def _beyond(actual: FloatArray, reference: FloatArray, window: int) -> FloatArray:
    """Return the distance of each column from the range of its reference in the last ``window`` ticks.

    NaN where there is no reference.
    """
    behind = window // 2  # moves the filter's window from around a tick to before it
    size = 2 * behind + 1
    low = minimum_filter1d(reference, size, axis=0, mode="nearest", origin=behind)
    high = maximum_filter1d(reference, size, axis=0, mode="nearest", origin=behind)
    outside: FloatArray = np.maximum(np.maximum(actual - high, low - actual), 0.0)
    outside[np.isnan(reference)] = math.nan
    return outside

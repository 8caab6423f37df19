"""The batch smoother against truth in closed form: its errors are those that it claims."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import stats

from flightstack.core.contract import FloatArray
from flightstack.params.sensors import default_sensors
from tests.support.batch_smoother import CONSTANTS, SIZE, Solution, covariance, smoothed
from tests.support.drawn_flight import REST_KEYFRAMES, STEP_S, Drawn, drawn
from tests.support.preintegration import transposed, turn_of
from tests.support.smoothed_flight import noise_of

_KEYFRAMES, _SEEDS = 200, range(6)
_MIDDLE = 130
_NOISE = noise_of(default_sensors(), STEP_S, 20.0)


class _Smoothed(NamedTuple):
    drawn: Drawn
    solution: Solution


@cache
def _flight(seed: int) -> _Smoothed:
    flight = drawn(_NOISE, _KEYFRAMES, seed)
    return _Smoothed(flight, smoothed(flight.flight, _NOISE))


def _errors(found: _Smoothed, keyframe: int) -> FloatArray:
    """Return truth minus estimate of the unknowns of a keyframe."""
    states, truth = found.solution.states, found.drawn.truth
    turn = turn_of(transposed(states.attitude[keyframe]) @ truth.attitude[keyframe])
    return np.concatenate([turn, truth.others[keyframe] - states.others[keyframe]])


def _are_claimed(squares: float, freedom: int, most: int | None = None) -> bool:
    """Return True if ``squares`` is within the 99 % bounds of the chi-square distribution."""
    low, high = stats.chi2.ppf(0.005, freedom), stats.chi2.ppf(0.995, most or freedom)
    return bool(low < squares < high)


def test_errors_of_the_smoother_have_its_covariance() -> None:
    states, constants = 0.0, 0.0
    for seed in _SEEDS:
        found = _flight(seed)
        errors = _errors(found, _MIDDLE)
        states += errors @ np.linalg.solve(covariance(found.solution, _MIDDLE * SIZE), errors)
        errors = found.drawn.truth.constants - found.solution.states.constants
        constants += errors @ np.linalg.solve(
            covariance(found.solution, _KEYFRAMES * SIZE, CONSTANTS), errors
        )
    assert _are_claimed(states, SIZE * len(_SEEDS))
    assert _are_claimed(constants, CONSTANTS * len(_SEEDS))


def test_errors_of_the_smoother_are_within_three_deviations() -> None:
    ratios = []
    for seed in _SEEDS:
        found = _flight(seed)
        for keyframe in (5, 60, 100, 150, _KEYFRAMES - 1):
            deviations = np.sqrt(np.diag(covariance(found.solution, keyframe * SIZE)))
            ratios.append(np.abs(_errors(found, keyframe)) / deviations)
    share = np.mean(np.array(ratios) < 3.0)
    assert share > 0.99  # measured: all, the largest 2.84; of a normal distribution 0.9973


def test_residuals_of_the_smoother_have_unit_variance() -> None:
    found = [_flight(seed).solution for seed in _SEEDS]
    freedom = sum(solution.freedom for solution in found)
    exact = len(_SEEDS) * 6 * REST_KEYFRAMES  # at rest velocity and turn are exactly zero, without noise
    assert _are_claimed(sum(solution.squares for solution in found), freedom - exact, freedom)


def test_gnss_taken_at_the_time_of_its_message_contradicts_the_model() -> None:
    flight = _flight(0).drawn.flight
    late = flight._replace(
        gnss_position=np.roll(flight.gnss_position, 1, axis=0),
        gnss_velocity=np.roll(flight.gnss_velocity, 1, axis=0),
    )
    solution = smoothed(late, _NOISE)
    assert solution.squares > 1.5 * solution.freedom  # measured 13.2

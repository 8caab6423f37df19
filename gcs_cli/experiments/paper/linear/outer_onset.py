"""Where instability sets in in x, y and z: the longest outer period, in inner ticks, that a small step still survives.

The inner rate stays; an outer period is a whole number of its ticks, so that the period is sought by doubling and
bisection. Between the last period that decays and the first that grows, the growth is interpolated. Simulation and
eigenvalues are asked in the same way, and neither knows of the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from flightstack.params.vehicle import GRAVITY_M_S2
from gcs_cli.experiments.paper.linear.gains import POSITION_AXES, Gains
from gcs_cli.experiments.paper.linear.instability import Onset, growth_of
from gcs_cli.experiments.paper.linear.margins import spectral_radius
from gcs_cli.experiments.paper.linear.sampled import (
    Actuators,
    HorizontalPeriod,
    Period,
    Rates,
    VerticalPeriod,
)
from gcs_cli.experiments.paper.linear.small_signal import (
    VELOCITY_AT,
    actuators_of,
    flown_gains,
    fly_position,
    small_case,
)

INNER_HZ = 1000
LAG_S = 0.005
SETTING = "outer loop: motor lag 5 ms, no delay, inner loop at 1 kHz"
LARGEST_DIVISOR = 1024
TILT_OF = {"x": "pitch", "y": "roll"}
"""The attitude axis inside each horizontal loop."""
STEP_M = 1e-7
GROWN_M_S = 1e-3
"""Beyond it what is not linear begins to count."""
WATCHED_S = 30.0


def period_of(gains: Gains, axis: str, rates: Rates, actuators: Actuators) -> Period:
    """Return the sampled loop of a position axis."""
    if axis == "z":
        return VerticalPeriod(gains.position[axis], rates, actuators)
    law = gains.attitude[TILT_OF[axis]]
    return HorizontalPeriod(gains.position[axis], law, gains.reference, rates, actuators, GRAVITY_M_S2)


def longest_period(growth: Callable[[int], float]) -> float | None:
    """Return the outer period, in inner ticks, at which ``growth`` passes zero; None if it never is below.

    ``growth`` of a period is negative where a disturbance dies away. ``LARGEST_DIVISOR`` if even that is stable.
    """
    if growth(1) >= 0.0:
        return None
    sound, unsound = 1, 2
    while growth(unsound) < 0.0:
        if unsound >= LARGEST_DIVISOR:
            return float(LARGEST_DIVISOR)
        sound, unsound = unsound, 2 * unsound
    while unsound - sound > 1:
        middle = (sound + unsound) // 2
        sound, unsound = (middle, unsound) if growth(middle) < 0.0 else (sound, middle)
    below, above = growth(sound), growth(unsound)
    return sound + below / (below - above)


def lowest_outer_hz(
    gains: Gains, axis: str, actuators: Actuators, inner_hz: float = INNER_HZ
) -> float | None:
    """Return the lowest stable outer rate [Hz] from eigenvalues; None if not even the inner rate is stable."""

    def growth(divisor: int) -> float:
        closed = period_of(gains, axis, Rates(inner_hz, inner_hz / divisor), actuators).closed()
        return math.log(spectral_radius(closed)) / divisor

    ticks = longest_period(growth)
    return None if ticks is None else inner_hz / ticks


def simulated_outer_hz(controller: str, gains: str, axis: str) -> float | None:
    """Return the lowest outer rate [Hz] at which the real loops, flying the real plant, forget a small step."""
    case = small_case(controller, gains, INNER_HZ, lag_s=LAG_S)
    ticks, column = round(WATCHED_S * INNER_HZ), VELOCITY_AT + POSITION_AXES.index(axis)

    def growth(divisor: int) -> float:
        flight = fly_position(case, ticks, axis, STEP_M, divisor=divisor, alone=True, ends_at_m_s=GROWN_M_S)
        return growth_of(np.abs(flight.states[1:, column]), STEP_M)

    longest = longest_period(growth)
    return None if longest is None else INNER_HZ / longest


def find_outer_onset(controller: str, gains: str, axis: str) -> Onset:
    """Seek the onset of x, y or z in simulation and by eigenvalues."""
    actuators = actuators_of(small_case(controller, gains, INNER_HZ, lag_s=LAG_S), axis)
    predicted = lowest_outer_hz(flown_gains(controller, gains), axis, actuators)
    return Onset(controller, gains, SETTING, axis, simulated_outer_hz(controller, gains, axis), predicted)

"""The lowest stable rates, by simulation and by eigenvalues.

Simulation flies the real loops on the real plant and bisects for the rate at which a small disturbance decays, without
the prediction. For an attitude it kicks the axis and varies the inner rate. For x, y and z it steps the setpoint and
varies the outer period, a whole number of inner ticks. Between the last unstable and the first stable rate the growth
is interpolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.experiments.paper.flights.types import Case
from gcs_cli.experiments.paper.linear.gains import ATTITUDE_AXES, POSITION_AXES, Gains
from gcs_cli.experiments.paper.linear.margins import lowest_stable_hz, spectral_radius
from gcs_cli.experiments.paper.linear.sampled import Actuators, AttitudeTick, Rates, period_of
from gcs_cli.experiments.paper.linear.small_signal import (
    RATES_AT,
    VELOCITY_AT,
    actuators_of,
    flown_gains,
    fly_attitude,
    fly_position,
    small_case,
)

LOWEST_HZ, HIGHEST_HZ = 5, 2000
KICK_RAD_S = 1e-7
GROWN_RAD_S = 1e-3
"""Upper limit of the linear range: beyond it the rotor speeds change by per cents."""
DECAYED_RAD_S = 1e-13
"""A hundred times the rounding error."""
FEWEST_TICKS, LEAST_S = 1200, 3.0

INNER_HZ = 1000
"""While the outer rate varies."""
LAG_S = 0.005
OUTER_SETTING = "outer loop: motor lag 5 ms, no delay, inner loop at 1 kHz"
LARGEST_DIVISOR = 1024
STEP_M = 1e-7
GROWN_M_S = 1e-3
"""Upper limit of the linear range."""
WATCHED_S = 30.0


class Setting(NamedTuple):
    """Rotors, delay, plant and axes of one search."""

    name: str
    plant: str
    lag_s: float
    delay_steps: int
    axes: tuple[str, ...] = ATTITUDE_AXES


IDEAL = Setting("ideal rotors, one step of delay", "paper", 0.0, 1)
LAGGING = Setting("motor lag 5 ms, one step of delay", "paper", 0.005, 1)
SPIN_UP = Setting("motor lag 5 ms with the rotors' spin-up torque, no delay", "rigid", 0.005, 0, ("yaw",))
SETTINGS = (IDEAL, LAGGING, SPIN_UP)


class Onset(NamedTuple):
    """Lowest stable inner rates [Hz]; None: no rate up to ``HIGHEST_HZ`` is stable."""

    controller: str
    gains: str
    setting: str
    axis: str
    simulated_hz: float | None
    predicted_hz: float | None

    @property
    def difference_percent(self) -> float | None:
        """Simulated against predicted rate."""
        if self.simulated_hz is None or self.predicted_hz is None:
            return None
        return 100.0 * (self.simulated_hz / self.predicted_hz - 1.0)


def find_onset(controller: str, gains: str, setting: Setting, axis: str) -> Onset:
    """Return the lowest stable rate by simulation and by eigenvalues."""
    return Onset(
        controller,
        gains,
        setting.name,
        axis,
        simulated_hz(controller, gains, setting, axis),
        predicted_hz(controller, gains, setting, axis),
    )


def onset_case(controller: str, gains: str, setting: Setting, inner_hz: int) -> Case:
    """Return the small-signal case of a setting."""
    return small_case(
        controller, gains, inner_hz, plant=setting.plant, lag_s=setting.lag_s, delay_steps=setting.delay_steps
    )


def growth(case: Case, axis: str) -> float:
    """Return the final growth of a small kick about ``axis`` in one inner tick, as a logarithm."""
    ticks = max(FEWEST_TICKS, math.ceil(LEAST_S * case.inner_hz))
    flight = fly_attitude(case, ticks, axis, kick_rad_s=KICK_RAD_S, alone=True, ends_at_rad_s=GROWN_RAD_S)
    return growth_of(np.abs(flight.states[1:, RATES_AT:][:, ATTITUDE_AXES.index(axis)]), KICK_RAD_S)


def growth_of(rates: FloatArray, kick: float) -> float:
    """Return the growth in one tick, as a logarithm, of magnitudes after ``kick``, shape (n,).

    It compares the largest rates of the middle and the last third, before they decay into rounding.
    """
    above = np.flatnonzero(rates > DECAYED_RAD_S)
    third = (int(above[-1]) + 1) // 3 if above.size else 0
    if third < 4:  # too fast for thirds: only the sign counts
        return 1.0 if rates[-1] > kick else -1.0
    return math.log(rates[2 * third : 3 * third].max() / rates[third : 2 * third].max()) / third


def simulated_hz(controller: str, gains: str, setting: Setting, axis: str) -> float | None:
    """Return the lowest rate [Hz] at which a kick decays; None if it grows at the highest rate too."""

    def grows(hz: int) -> float:
        return growth(onset_case(controller, gains, setting, hz), axis)

    low, high = LOWEST_HZ, HIGHEST_HZ
    if grows(high) >= 0.0:
        return None
    if grows(low) < 0.0:
        return float(low)
    while high - low > 1:
        middle = math.isqrt(low * high)
        middle = min(max(middle, low + 1), high - 1)
        low, high = (low, middle) if grows(middle) < 0.0 else (middle, high)
    above, below = grows(low), grows(high)
    return low + above / (above - below)


def predicted_hz(controller: str, gains: str, setting: Setting, axis: str) -> float | None:
    """Return the same rate from the eigenvalues of the sampled loop."""
    law = flown_gains(controller, gains).attitude[axis]
    actuators = actuators_of(onset_case(controller, gains, setting, 1000), axis)
    return lowest_stable_hz(
        lambda hz: spectral_radius(AttitudeTick(law, hz, actuators).closed()), HIGHEST_HZ, LOWEST_HZ
    )


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
    """Return the lowest outer rate [Hz] at which a small step decays with the real loops and plant."""
    case = small_case(controller, gains, INNER_HZ, lag_s=LAG_S)
    ticks, column = round(WATCHED_S * INNER_HZ), VELOCITY_AT + POSITION_AXES.index(axis)

    def growth(divisor: int) -> float:
        flight = fly_position(case, ticks, axis, STEP_M, divisor=divisor, alone=True, ends_at_m_s=GROWN_M_S)
        return growth_of(np.abs(flight.states[1:, column]), STEP_M)

    longest = longest_period(growth)
    return None if longest is None else INNER_HZ / longest


def find_outer_onset(controller: str, gains: str, axis: str) -> Onset:
    """Return the lowest stable outer rate of x, y or z by simulation and by eigenvalues."""
    actuators = actuators_of(small_case(controller, gains, INNER_HZ, lag_s=LAG_S), axis)
    predicted = lowest_outer_hz(flown_gains(controller, gains), axis, actuators)
    return Onset(
        controller, gains, OUTER_SETTING, axis, simulated_outer_hz(controller, gains, axis), predicted
    )

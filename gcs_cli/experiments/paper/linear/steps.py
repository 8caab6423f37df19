"""Step responses in closed form, and their figures.

``SecondOrder`` is y/r = (wn² + z s)/(s² + 2 ζ wn s + wn²): a PD loop on a double integrator, without a zero when the
derivative acts on the measurement alone (z = 0), with one when it acts on the error (z = kd = 2 ζ wn).
``exact_figures`` does the same for any stable transfer function, by the matrix exponential.

Figures as in textbooks (and as MATLAB's stepinfo): overshoot in per cent of the final value, time of the peak, rise
from 10 to 90 %, and the time after which the response stays within 2 % of its final value.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from flightstack.core.contract import FloatArray
from gcs_cli.experiments.paper.flights.metrics import HIGH, LOW, SETTLED, rise_time_s, settling_time_s
from gcs_cli.experiments.paper.linear.continuous import TransferFunction

_EQUAL = 1e-7  # relative distance of two real poles below which they count as one


class StepFigures(NamedTuple):
    """Figures of a step response; ``peak_s`` is None without overshoot, a time None if it is not reached."""

    overshoot_percent: float
    peak_s: float | None
    rise_s: float | None
    settling_s: float | None


class SecondOrder(NamedTuple):
    """Natural frequency [rad/s], damping, and the zero's weight z [rad/s] (0: none)."""

    natural_rad_s: float
    damping: float
    zero_rad_s: float = 0.0

    @property
    def _rates(self) -> tuple[float, float]:
        """Decay σ and frequency [rad/s]: oscillating below damping 1, else half the distance of the poles."""
        w, zeta = self.natural_rad_s, self.damping
        return zeta * w, w * math.sqrt(abs(1.0 - zeta * zeta))

    @property
    def _oscillates(self) -> bool:
        return self.damping < 1.0 - _EQUAL

    @property
    def _is_double(self) -> bool:
        return abs(self.damping - 1.0) <= _EQUAL

    def value(self, time_s: float) -> float:
        """Return y(t), t ≥ 0.

        y = 1 − e^{−σt} [C(βt) + (σ − z)/β S(βt)], C and S being cos and sin, or cosh and sinh for real poles.
        """
        sigma, beta = self._rates
        slope = sigma - self.zero_rad_s
        if self._is_double:
            return 1.0 - math.exp(-sigma * time_s) * (1.0 + slope * time_s)
        if self._oscillates:
            swing = math.cos(beta * time_s) + slope / beta * math.sin(beta * time_s)
            return 1.0 - math.exp(-sigma * time_s) * swing
        slow, fast = math.exp((beta - sigma) * time_s), math.exp((-beta - sigma) * time_s)
        return 1.0 - 0.5 * ((1.0 + slope / beta) * slow + (1.0 - slope / beta) * fast)

    def extremes(self) -> list[float]:
        """Return the times at which y' = 0, t > 0; of an oscillation the first forty.

        y' is the impulse response e^{−σt} [z C(βt) + (wn² − σ z)/β S(βt)].
        """
        sigma, beta = self._rates
        z, rest = self.zero_rad_s, self.natural_rad_s**2 - sigma * self.zero_rad_s
        if self._is_double:
            times = [-z / rest] if rest != 0.0 else []
        elif self._oscillates:
            first = math.atan2(-z * beta, rest) % math.pi / beta
            first = first if first > 0.0 else math.pi / beta
            times = [first + k * math.pi / beta for k in range(40)]
        else:
            ratio = -z * beta / rest if rest != 0.0 else math.inf  # tanh βt
            times = [math.atanh(ratio) / beta] if abs(ratio) < 1.0 else []
        return [t for t in times if t > 0.0]

    def figures(self) -> StepFigures:
        """Return overshoot and peak by their formulas; rise and settling where y(t) crosses their levels."""
        return _figures(self.value, self.extremes(), 60.0 / min(self._slowest, self.natural_rad_s))

    @property
    def _slowest(self) -> float:
        sigma, beta = self._rates
        return sigma if self._oscillates or self._is_double else sigma - beta


def _figures(value: Callable[[float], float], extremes: list[float], end_s: float) -> StepFigures:
    """Read the figures of a response that is monotonic between its ``extremes`` and at its end by ``end_s``."""
    knots = [0.0, *(t for t in extremes if t < end_s), end_s]
    values = [value(t) for t in knots]
    peak = max(range(len(knots)), key=values.__getitem__)
    overshoot = max(0.0, 100.0 * (values[peak] - 1.0))
    low, high = _first_crossing(value, knots, LOW), _first_crossing(value, knots, HIGH)
    return StepFigures(
        overshoot,
        knots[peak] if overshoot > 0.0 and peak not in (0, len(knots) - 1) else None,
        None if low is None or high is None else high - low,
        _settling(value, knots, values),
    )


def _first_crossing(value: Callable[[float], float], knots: list[float], level: float) -> float | None:
    for begin, end in pairwise(knots):
        if value(begin) < level <= value(end):
            return _crossing(value, begin, end, level)
    return None


def _crossing(value: Callable[[float], float], begin: float, end: float, level: float) -> float:
    return float(brentq(lambda t: value(t) - level, begin, end, xtol=1e-12))


def _settling(value: Callable[[float], float], knots: list[float], values: list[float]) -> float | None:
    if abs(values[-1] - 1.0) > SETTLED:
        return None
    for index in range(len(knots) - 2, -1, -1):
        if abs(values[index] - 1.0) > SETTLED:
            return _crossing(
                value, knots[index], knots[index + 1], 1.0 + math.copysign(SETTLED, values[index] - 1.0)
            )
    return 0.0


def exact_figures(loop: TransferFunction) -> StepFigures | None:
    """Return the figures of any transfer function's step response; None when it is not stable.

    The response is the matrix exponential of the loop's companion form, so poles may coincide. Its extremes are sought
    on a grid a hundredth of the fastest swing apart, and refined.
    """
    poles = np.roots(loop.denominator)
    if poles.real.max() >= 0.0:
        return None
    matrix, output = _companion(loop)
    start = np.zeros(len(matrix))
    start[-1] = 1.0  # the constant input

    def state(time_s: float) -> FloatArray:
        moved: FloatArray = np.asarray(expm(matrix * time_s)) @ start
        return moved

    def value(time_s: float) -> float:
        return float(output @ state(time_s))

    def slope(time_s: float) -> float:
        return float(output @ matrix @ state(time_s))

    end_s = 12.0 / -poles.real.max()
    swings = end_s * np.abs(poles.imag).max() / (2.0 * math.pi)
    times = np.linspace(0.0, end_s, int(min(20_000.0, max(1000.0, 100.0 * swings))))
    slopes = _along(matrix, start, times) @ (output @ matrix)
    changes = np.flatnonzero(slopes[1:-1] * slopes[2:] < 0.0) + 1
    extremes = [float(brentq(slope, times[i], times[i + 1], xtol=1e-12)) for i in changes]
    return _figures(value, extremes, end_s)


def _companion(loop: TransferFunction) -> tuple[FloatArray, FloatArray]:
    """Return the matrix of [states, constant input] and the output row of a strictly proper transfer function.

    The output is scaled so that the response ends at 1.
    """
    order = len(loop.denominator) - 1
    matrix, output = np.zeros((order + 1, order + 1)), np.zeros(order + 1)
    matrix[: order - 1, 1:order] = np.eye(order - 1)
    matrix[order - 1, :order] = -loop.denominator[:0:-1] / loop.denominator[0]
    matrix[order - 1, order] = 1.0
    output[: len(loop.numerator)] = loop.numerator[::-1] / loop.denominator[0]
    output *= loop.denominator[-1] / loop.numerator[-1]
    return matrix, output


def _along(matrix: FloatArray, start: FloatArray, times: FloatArray) -> FloatArray:
    """Return the states at equally spaced times, shape (n, states)."""
    over, states = np.asarray(expm(matrix * (times[1] - times[0]))), np.empty((len(times), len(start)))
    states[0] = start
    for index in range(1, len(times)):
        states[index] = over @ states[index - 1]
    return states


def read_figures(time_s: FloatArray, response: FloatArray) -> StepFigures:
    """Read the figures of a sampled response to a unit step, straight lines between the samples.

    Both of shape (n,); the response must have ended near 1 for a settling time.
    """
    peak = int(response.argmax())
    overshoot = max(0.0, 100.0 * float(response[peak] - 1.0))
    return StepFigures(
        overshoot,
        float(time_s[peak]) if overshoot > 0.0 else None,
        rise_time_s(time_s, response),
        settling_time_s(time_s, response),
    )

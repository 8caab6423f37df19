"""Gain, phase and delay margins of a sampled loop, and the lowest rate at which it is stable."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy.optimize import brentq

from flightstack.core.contract import FloatArray

POINTS = 500
LOWEST_RAD_S = 1e-2
ComplexArray: TypeAlias = np.ndarray[Any, np.dtype[np.complex128]]
OpenLoop: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""(A, B, C) of L(z) = C (z − A)⁻¹ B, with negative feedback."""


class Margins(NamedTuple):
    """Distances of a stable loop from instability; None where no gain, or no lag, would make it unstable.

    ``gain_db`` is by how much the gain may grow, ``reduction_db`` by how much it may fall (a negative figure).
    ``phase_deg`` is the smallest lag at a frequency of unit gain that ends stability, ``crossover_rad_s`` that
    frequency, ``delay_s`` the smallest further delay: a phase over its own frequency, so for delays that are no whole
    number of steps it is an approximation.
    """

    gain_db: float | None
    reduction_db: float | None
    phase_deg: float | None
    crossover_rad_s: float | None
    delay_s: float | None


def spectral_radius(matrix: FloatArray) -> float:
    """Return the largest magnitude of an eigenvalue: by so much the slowest disturbance grows in one step."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def response(loop: OpenLoop, angular_rad: FloatArray) -> ComplexArray:
    """Return L(e^{jω}) at angles per step ω [rad], complex, of their shape."""
    a, b, c = loop
    z = np.exp(1j * angular_rad)[:, np.newaxis, np.newaxis]
    solved = np.linalg.solve(z * np.eye(len(a)) - a, np.broadcast_to(b[:, np.newaxis], (len(z), len(b), 1)))
    values: ComplexArray = np.asarray(c @ solved, dtype=np.complex128)[:, 0]
    return values


def closed(loop: OpenLoop, gain: float = 1.0) -> FloatArray:
    """Return the matrix of the loop closed with ``gain``."""
    a, b, c = loop
    return a - gain * np.outer(b, c)


def margins(loop: OpenLoop, dt_s: float) -> Margins | None:
    """Return the margins of a loop with the step ``dt_s``; None for one that is not stable."""
    if spectral_radius(closed(loop)) >= 1.0:
        return None
    angles = np.concatenate(
        [
            np.geomspace(LOWEST_RAD_S * dt_s, 0.05 * math.pi, POINTS),
            np.linspace(0.05, 1.0, POINTS)[1:] * math.pi,
        ]
    )
    factors = _critical_gains(loop, angles)
    above = [20.0 * math.log10(k) for k in factors if k > 1.0]
    below = [20.0 * math.log10(k) for k in factors if k < 1.0]
    lags = [(_lag_rad(loop, angle), angle) for angle in _unit_gain(loop, angles)]
    phase, crossover = min(lags, default=(None, None))
    return Margins(
        min(above, default=None),
        max(below, default=None),
        None if phase is None else math.degrees(phase),
        None if crossover is None else crossover / dt_s,
        min((lag / angle * dt_s for lag, angle in lags), default=None),
    )


def _refine(function: Callable[[float], float], angles: FloatArray, values: FloatArray) -> list[float]:
    """Return the zeros of ``function``, whose ``values`` at ``angles`` show where they are."""
    changes = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
    return [float(brentq(function, angles[i], angles[i + 1], xtol=1e-13)) for i in changes]


def _critical_gains(loop: OpenLoop, angles: FloatArray) -> list[float]:
    """Return the gains that put a pole on the unit circle: where L is real and negative, z = −1 included."""

    def imaginary(angle: float) -> float:
        return float(response(loop, np.array([angle]))[0].imag)

    inside = angles[:-1]
    crossings = [*_refine(imaginary, inside, response(loop, inside).imag), math.pi]
    at = response(loop, np.array(crossings))
    return [float(-1.0 / value.real) for value in at if value.real < -1e-12]


def _unit_gain(loop: OpenLoop, angles: FloatArray) -> list[float]:
    def excess(angle: float) -> float:
        return float(np.log(np.abs(response(loop, np.array([angle]))[0])))

    return _refine(excess, angles, np.log(np.abs(response(loop, angles))))


def _lag_rad(loop: OpenLoop, angle: float) -> float:
    """Return the lag that turns L at ``angle`` to −1."""
    value = response(loop, np.array([angle]))[0]
    return float((math.atan2(value.imag, value.real) + math.pi) % (2.0 * math.pi))


def lowest_stable_hz(
    radius: Callable[[float], float], highest_hz: float = 4000.0, lowest_hz: float = 2.0
) -> float | None:
    """Return the rate below which the loop first becomes unstable, coming from ``highest_hz``.

    ``radius`` gives the spectral radius at a rate. None when the loop is unstable at the highest rate already, which
    no rate cures; ``lowest_hz`` when it is stable down to there.
    """
    if radius(highest_hz) >= 1.0:
        return None
    rates = np.geomspace(highest_hz, lowest_hz, 240)
    for faster, slower in pairwise(rates.tolist()):
        if radius(slower) >= 1.0:
            return float(brentq(lambda hz: radius(hz) - 1.0, slower, faster, xtol=1e-9))
    return lowest_hz

"""The loops in continuous time: closed-loop transfer functions, their poles and step responses.

Polynomials in s, highest power first, as NumPy writes them. The linearised vehicle is a double integrator for each
axis (eq. 7 at hover, where coupling and gyroscopic terms vanish): φ'' = u for an attitude, z'' = a for the altitude,
and x'' = g·(tilt towards north) behind the attitude loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.experiments.paper.linear.gains import AttitudeGains, PositionGains, ReferenceFilter

_AT_ORIGIN = 1e-9


class TransferFunction(NamedTuple):
    """numerator(s) / denominator(s)."""

    numerator: FloatArray
    denominator: FloatArray

    def poles(self) -> list[complex]:
        """Return the poles, slowest first (by magnitude, then by imaginary part)."""
        return ordered(np.roots(self.denominator))


class Mode(NamedTuple):
    """A pole or a conjugate pair: natural frequency [rad/s] and damping (1 for a stable real pole)."""

    natural_rad_s: float
    damping: float


def ordered(poles: Iterable[complex]) -> list[complex]:
    """Sort poles by magnitude; of a conjugate pair the one below the real axis first."""
    return sorted((complex(p) for p in poles), key=lambda p: (round(abs(p), 9), p.imag))


def pair_mode(gains: AttitudeGains | PositionGains) -> Mode:
    """Return the mode of the PD gains alone, s² + kd s + kp. Damping above 1: two real poles."""
    natural = float(np.sqrt(gains.kp))
    return Mode(natural, gains.kd / (2.0 * natural))


def slowest_mode(poles: list[complex]) -> Mode:
    """Return natural frequency and damping of the pole that is nearest to the imaginary axis."""
    pole = max(poles, key=lambda p: p.real)
    return Mode(abs(pole), -pole.real / abs(pole))


def _pid(gains: AttitudeGains | PositionGains) -> tuple[FloatArray, bool]:
    """Return kd s + kp, or kd s² + kp s + ki with True: then both sides are multiplied by s."""
    if gains.ki == 0.0:
        return np.array([gains.kd, gains.kp]), False
    return np.array([gains.kd, gains.kp, gains.ki]), True


def _times_s(polynomial: FloatArray, times: int) -> FloatArray:
    return np.concatenate([polynomial, np.zeros(times)])


def _product(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.polymul(first, second), dtype=np.float64)


def _sum(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.polyadd(first, second), dtype=np.float64)


def reference_filter(reference: ReferenceFilter) -> TransferFunction:
    """Return ω²/(s² + 2 ζ ω s + ω²), or 1 where the filter passes the target through."""
    w = reference.bandwidth_rad_s
    if w <= 0.0:
        return TransferFunction(np.array([1.0]), np.array([1.0]))
    return TransferFunction(np.array([w * w]), np.array([1.0, 2.0 * reference.damping * w, w * w]))


def attitude_loop(gains: AttitudeGains) -> TransferFunction:
    """Return angle over reference angle: (kp + ki/s + ff kd s + fa s²)/(s² + kd s + kp + ki/s).

    The feed-forward takes the reference's own derivatives, so it adds zeros and no poles.
    """
    feedback, integral = _pid(gains)
    extra = int(integral)
    ahead = np.array([gains.acceleration_feedforward, gains.rate_feedforward * gains.kd, gains.kp])
    numerator = _times_s(ahead, extra)
    numerator[-1] += gains.ki if integral else 0.0
    denominator = _sum(_times_s(np.array([1.0, 0.0, 0.0]), extra), feedback)
    return TransferFunction(np.trim_zeros(numerator, "f"), denominator)


def tilt_loop(gains: AttitudeGains, reference: ReferenceFilter) -> TransferFunction:
    """Return angle over the outer loop's target: the reference filter before the attitude loop."""
    loop, ahead = attitude_loop(gains), reference_filter(reference)
    return TransferFunction(
        _product(loop.numerator, ahead.numerator), _product(loop.denominator, ahead.denominator)
    )


DIRECT = TransferFunction(np.array([1.0]), np.array([1.0]))
"""Inner loop of the altitude: the thrust follows at once."""


def position_loop(gains: PositionGains, inner: TransferFunction = DIRECT) -> TransferFunction:
    """Return position over its setpoint, a step (whose velocity is not fed ahead), with ``inner`` in the loop.

    x s² = (kp (x_d − x) + ki/s (x_d − x) − kd s x) N/D.
    """
    feedback, integral = _pid(gains)
    extra = int(integral)
    proportional = np.array([gains.kp, gains.ki]) if integral else np.array([gains.kp])
    numerator = _product(proportional, inner.numerator)
    denominator = _sum(_times_s(inner.denominator, 2 + extra), _product(feedback, inner.numerator))
    return TransferFunction(numerator, denominator)


def is_stable(poles: list[complex]) -> bool:
    """True if every pole lies in the left half-plane."""
    return all(pole.real < -_AT_ORIGIN for pole in poles)

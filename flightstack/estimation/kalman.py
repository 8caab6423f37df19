"""Scalar measurement updates of the error-state Kalman filter, with gates and adaptive measurement noise."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray
from flightstack.estimation.error_state import (
    ERROR_STATES,
    Covariance,
    ErrorVector,
    correct,
)

OBSERVATIONS = 25
GNSS_VELOCITY, GNSS_POSITION, BARO, MAG, RANGE = 0, 3, 6, 7, 10
REST_VELOCITY, REST_RATE, HOLD_POSITION, KNOWN_FIELD, DECLINATION, DRAG = 11, 14, 17, 19, 22, 23
"""First row of each sensor in ``Filter.observations``."""

_ADAPTATION = 0.01
"""Share of an innovation in the estimate of the noise variance."""

_PRIOR = 2.0
"""Number of innovations that the noise stated at the start counts for."""

_LARGEST_CORRELATION = 0.95

WHITE, CORRELATED, SLOW = 0.0, 1.0, 2.0
"""Errors of successive measurements: independent of each other; correlated, so that they count for less; the same, and
the first ones say little of the noise."""

HOLDS_TILT, HOLDS_HORIZONTAL, HOLDS_TILT_AND_GYRO = 1.0, 2.0, 3.0
"""States that keep their values and their uncertainty in an update: tilt, velocity, position and the accelerometer's
bias; the horizontal velocity and position; those of the first and the gyro's biases about x and y."""

BEHIND_SIZE = 7


class Observed(NamedTuple):
    """What the filter knows of the measurements of one quantity."""

    innovation: float
    """The newest one; the next two are of it."""
    variance: float
    """That the filter expects of it."""
    test_ratio: float
    """Squared ratio to the gate, which is as wide as the errors are correlated."""
    fused_s: float
    """Time of the last accepted one."""
    noise: float
    """Variance of the noise."""
    lagged: float
    """Mean product of successive innovations."""
    fused: float
    """Number of accepted measurements."""
    refused: float
    nis_sum: float
    """Sum of the squares of accepted innovations by their variance."""


ObservedRecord: TypeAlias = Annotated[Record, Observed]


class Filter(NamedTuple):
    """The filter's arrays, all written in place.

    Small ones come first: a target reaches them with the offset in one instruction.
    """

    nominal: Annotated[FloatArray, 28]
    h: ErrorVector
    """Jacobian of the measurement at hand."""
    ph: ErrorVector
    gain: ErrorVector
    clock: Annotated[FloatArray, 2]
    """Time of the state, at the delayed horizon; share of the measured IMU noise that innovations of GNSS confirm."""
    behind: Annotated[FloatArray, BEHIND_SIZE]
    """What the covariance has not followed yet: time, rotation vector of the body, velocity change NED by forces."""
    turn: Annotated[FloatArray, 3]
    """Rotation of about the last 5 s, in the body frame."""
    drag: Annotated[FloatArray, 2]
    """Specific force along x and y of the body, mean of about the last 5 s."""
    covariance: Covariance
    """Only the elements on and above the diagonal count."""
    observations: Annotated[RecordArray, Observed, OBSERVATIONS]


class Noise(NamedTuple):
    """Range of a measurement's noise [1σ]. The filter estimates the noise within it from its innovations."""

    least: float
    start: float
    largest: float
    gate: float
    kind: float
    """``WHITE``, ``CORRELATED`` or ``SLOW``."""


@compiled
def clear(x: ErrorVector) -> None:
    """Set every item to zero."""
    for i in range(ERROR_STATES):
        x[i] = 0.0


def symmetric(p: Covariance) -> Covariance:
    """Return a covariance with the elements below the diagonal, which the filter does not keep."""
    whole: FloatArray = np.triu(p) + np.triu(p, 1).T
    return whole


@compiled
def _project(f: Filter) -> float:
    """Write P hᵀ to ``ph`` and return h P hᵀ."""
    clear(f.ph)
    total = 0.0
    for k in range(ERROR_STATES):
        slope = f.h[k]
        if slope != 0.0:
            total += slope * (2.0 * f.ph[k] + slope * f.covariance[k, k])
            for i in range(k):
                f.ph[i] += slope * f.covariance[i, k]
            for i in range(k, ERROR_STATES):
                f.ph[i] += slope * f.covariance[k, i]
    return total


@compiled
def _correct(f: Filter, innovation: float) -> None:
    """Correct state and covariance with ``gain``: P hᵀ / variance, or zero for a state that keeps its value.

    Joseph's form with such a gain subtracts P hᵀ h P / variance from the covariance, except between two states that
    both keep their values: one product for each element instead of two.
    """
    p, gain, ph = f.covariance, f.gain, f.ph
    for i in range(ERROR_STATES):
        if gain[i] != 0.0:
            share = gain[i]
            for j in range(i, ERROR_STATES):
                p[i, j] -= share * ph[j]
        elif ph[i] != 0.0:
            share = ph[i]
            for j in range(i, ERROR_STATES):
                p[i, j] -= share * gain[j]
        p[i, i] = max(p[i, i], 1e-12)
    correct(f.nominal, gain, innovation)


@compiled
def _adapt_noise(o: ObservedRecord, r: float, projected: float, last: float, noise: Noise) -> None:
    """Move the noise variance ``r`` towards that of the accepted innovation; the first ones count for more.

    Each of these has twice its share of a mean: the noise stated at the start is forgotten with their number's square.
    Half the squared difference of two successive innovations has the variance of white noise, and an error of the
    model, which both have, does not count. Correlated errors have the whole variance, as their correlation is counted
    apart.
    """
    innovation = o["innovation"]
    o["lagged"] += _ADAPTATION * (innovation * last - o["lagged"])
    share, square = _ADAPTATION, innovation * innovation
    if noise.kind != SLOW and o["fused"] > 1.0:
        share = max(share, 2.0 / (o["fused"] + _PRIOR))
        if noise.kind == WHITE:
            square = 0.5 * (innovation - last) * (innovation - last)
    estimate = square - projected
    least, largest = noise.least * noise.least, noise.largest * noise.largest
    o["noise"] = min(max(r + share * (estimate - r), least), largest)


@compiled
def _hold(gain: ErrorVector, holds: float) -> None:
    """Make the gains of the states that are held zero."""
    if holds == HOLDS_HORIZONTAL:
        for i in range(2):
            gain[3 + i], gain[6 + i] = 0.0, 0.0
    elif holds > 0.0:
        gain[0], gain[1] = 0.0, 0.0
        for i in range(3, 9):
            gain[i] = 0.0
        for i in range(12, 15):
            gain[i] = 0.0
        if holds == HOLDS_TILT_AND_GYRO:
            gain[9], gain[10] = 0.0, 0.0


@compiled
def correlation_factor(o: ObservedRecord) -> float:
    """Return the factor by which the noise of a mean is larger than that of independent measurements."""
    correlation = min(max(o["lagged"] / o["variance"], 0.0), _LARGEST_CORRELATION)
    factor: float = (1.0 + correlation) / (1.0 - correlation)
    return factor


@compiled
def fuse(f: Filter, row: int, innovation: float, noise: Noise, holds: float) -> bool:
    """Fuse a scalar measurement with the Jacobian ``f.h``; return True if it is within its gate.

    A refused one that is smaller than the noise at the start moves the noise even so: a slow error, such as that of
    soft iron on another heading, else had an axis refused for good.

    With ``holds`` other than zero, these states keep their values and their uncertainty: a Schmidt-Kalman update.
    """
    o = f.observations[row]
    least, largest = noise.least * noise.least, noise.largest * noise.largest
    r = min(max(o["noise"] if o["noise"] > 0.0 else noise.start * noise.start, least), largest)
    projected = _project(f)
    expected = projected + r
    variance = expected
    o["variance"] = expected
    if noise.kind != WHITE:
        variance = projected + r * correlation_factor(o)
    last = o["innovation"]
    ratio = innovation * innovation / (noise.gate * noise.gate * variance)
    o["innovation"], o["test_ratio"] = innovation, ratio
    if not ratio <= 1.0:
        o["refused"] += 1.0
        if noise.kind == SLOW and abs(innovation) < noise.start:
            o["noise"] = min(r + _ADAPTATION * (innovation * innovation - expected), largest)
        return False
    o["fused"] += 1.0
    o["nis_sum"] += innovation * innovation / expected
    _adapt_noise(o, r, projected, last, noise)
    for i in range(ERROR_STATES):
        f.gain[i] = f.ph[i] / variance
    _hold(f.gain, holds)
    _correct(f, innovation)
    o["fused_s"] = f.clock[0]
    return True


@compiled
def reset_variance(p: Covariance, at: int, count: int, variance: float) -> None:
    """Make ``count`` states from ``at`` independent of all others, each with ``variance``."""
    for i in range(at, at + count):
        for j in range(i):
            p[j, i] = 0.0
        for j in range(i, ERROR_STATES):
            p[i, j] = 0.0
        p[i, i] = variance


@compiled
def deviation(f: Filter, at: int, count: int) -> float:
    """Return the root of the summed variances of ``count`` states from ``at``."""
    total = 0.0
    for i in range(at, at + count):
        total += f.covariance[i, i]
    return math.sqrt(total)

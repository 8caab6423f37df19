"""Random numbers of the sensors: one independent stream for each, whatever other sensors do.

Normal deviates are those of the gusts, made of PCG64's integers: see ``sim_bridge.plant.turbulence``.
"""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record
from flightstack.core.portable_math import exp
from sim_bridge.plant.turbulence import normal_deviates

_ROWS = 256
_FIRST_STREAM = 16
"""Jumps of the generator before the first stream; gusts have the first two."""
_STREAMS = {"imu": 0, "mag": 8, "baro": 16, "gnss": 24, "range": 32, "flow": 40}
_LOSSES = {"gyro": 48, "accel": 52, "mag": 56, "baro": 57, "gnss": 58, "range": 59, "flow": 60}


class NormalStream:
    """Rows of standard normal deviates for one sensor."""

    def __init__(self, seed: int, sensor: str, instance: int = 0, width: int = 1) -> None:
        self._bits = np.random.PCG64(seed).jumped(_FIRST_STREAM + _STREAMS[sensor] + instance)
        self._width = width
        self._left: list[FloatArray] = []

    def first(self, count: int) -> FloatArray:
        """Return ``count`` deviates for the constants of a sensor; call before the rows."""
        return normal_deviates(self._bits, count)

    def rows(self, count: int) -> FloatArray:
        """Return the next rows, shape (count, width)."""
        return normal_deviates(self._bits, count * self._width).reshape(count, self._width)

    def row(self) -> FloatArray:
        """Return the next row, shape (width,)."""
        if not self._left:
            self._left = list(self.rows(_ROWS)[::-1])
        return self._left.pop()


class UniformStream:
    """Numbers of a uniform distribution over [0, 1), which decide the losses of one sensor."""

    def __init__(self, seed: int, sensor: str, instance: int = 0) -> None:
        self._bits = np.random.PCG64(seed).jumped(_FIRST_STREAM + _LOSSES[sensor] + instance)

    def next(self) -> float:
        """Return the next number."""
        return float(int(self._bits.random_raw()) >> 11) / 2**53


def gauss_markov(step_s: float, time_s: float) -> tuple[float, float]:
    """Return decay and relative noise of a first-order Gauss-Markov process over one step, exact for any step."""
    decay = exp(-step_s / time_s)
    return decay, math.sqrt(1.0 - decay * decay)


class Wander:
    """Keeps ``decay`` and ``wander`` of a record, a Gauss-Markov process, to the times of its samples."""

    def __init__(self, record: Record, spread: FloatArray | float, time_s: float) -> None:
        self._record, self._spread, self._time_s = record, spread, time_s
        self._last_us: int | None = None
        self._step_us = -1

    def follow(self, time_us: int) -> None:
        """Set the coefficients for a sample at ``time_us``; the first sample is the start of the process."""
        step_us = 0 if self._last_us is None else time_us - self._last_us
        self._last_us = time_us
        if step_us != self._step_us:
            self._step_us = step_us
            decay, share = gauss_markov(step_us * 1e-6, self._time_s)
            self._record["decay"], self._record["wander"] = decay, np.multiply(share, self._spread)


@compiled
def with_fault(spread: float, fault: float) -> float:
    """Return the standard deviation with the noise of a fault on top."""
    return spread if fault == 0.0 else math.sqrt(spread * spread + fault * fault)


@compiled
def quantised(value: float, step: float) -> float:
    """Return ``value`` rounded to a multiple of ``step``, or unchanged if ``step`` is 0."""
    if step == 0.0:
        return value
    return step * math.floor(value / step + 0.5)


@compiled
def limited(value: float, largest: float) -> float:
    """Return ``value`` within ±``largest``."""
    return min(max(value, -largest), largest)

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

_ROWS = 512
"""As many as the inertial sensors draw: steps of a call."""
_FIRST_STREAM = 16
"""Jumps of the generator before the first stream; gusts have the first two."""
_STREAMS = {"imu": 0, "mag": 8, "baro": 16, "gnss": 24, "range": 32, "flow": 40}
_LOSSES = {"gyro": 48, "accel": 52, "mag": 56, "baro": 57, "gnss": 58, "range": 59, "flow": 60}


class NormalStream:
    """Rows of standard normal deviates for one sensor."""

    def __init__(self, seed: int, sensor: str, instance: int = 0, width: int = 1) -> None:
        self._bits = np.random.PCG64(seed).jumped(_FIRST_STREAM + _STREAMS[sensor] + instance)
        self._width = width
        self.block: FloatArray = np.zeros((2 * _ROWS, width))
        """Next rows, from ``cursor`` to the last one."""
        self._each: list[FloatArray] = list(self.block)
        self.cursor = np.full(1, len(self.block), np.int64)
        """Index of the next row in ``block``, which a kernel that takes rows moves on."""
        self._cursor = self.cursor.data  # a number of an array takes four times as long to read

    def first(self, count: int) -> FloatArray:
        """Return ``count`` deviates for the constants of a sensor; call before the rows."""
        return normal_deviates(self._bits, count)

    def rows(self, count: int) -> FloatArray:
        """Draw the next rows, shape (count, width)."""
        return normal_deviates(self._bits, count * self._width).reshape(count, self._width)

    def row(self) -> FloatArray:
        """Return the next row, shape (width,), valid until the next call of ``ready``."""
        at = self._cursor[0]
        if at == len(self._each):
            self.ready()
            at = self._cursor[0]
        self._cursor[0] = at + 1
        return self._each[at]

    def ready(self) -> int:
        """Return how many rows ``block`` has ready, at least 512; draw more if there are fewer."""
        left = len(self._each) - self._cursor[0]
        while left < _ROWS:
            start = len(self._each) - _ROWS
            self.block[start - left : start] = self.block[len(self._each) - left :]
            self.block[start:] = self.rows(_ROWS)
            left += _ROWS
            self._cursor[0] = len(self._each) - left
        return left


class UniformStream:
    """Numbers of a uniform distribution over [0, 1), which decide the losses of one sensor."""

    def __init__(self, seed: int, sensor: str, instance: int = 0) -> None:
        self._bits = np.random.PCG64(seed).jumped(_FIRST_STREAM + _LOSSES[sensor] + instance)

    def next(self) -> float:
        """Return the next number."""
        return float(int(self._bits.random_raw()) >> 11) / 2**53


@compiled
def gauss_markov(step_s: float, time_s: float) -> tuple[float, float]:
    """Return decay and relative noise of a first-order Gauss-Markov process over one step, exact for any step."""
    decay = exp(-step_s / time_s)
    return decay, math.sqrt(1.0 - decay * decay)


@compiled
def step_to(sensor: Record, time_us: int) -> float:
    """Return the time since the last measurement [s], 0 for the first one, and keep that of this one."""
    last_us = sensor["measured_us"]
    sensor["measured_us"] = time_us
    return 0.0 if last_us < 0 else (time_us - last_us) * 1e-6


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

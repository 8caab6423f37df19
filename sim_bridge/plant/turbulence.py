"""Seeded noise for the gusts of a compiled plant.

Wind and torque have independent random streams: enabling one does not change the other. A step uses one row of each,
whatever the number of steps in a call.

Normal deviates come from the integers of PCG64 by Box and Muller's method: those of NumPy depend on libm, whose last
bits depend on the processor, and may change between versions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record
from flightstack.core.portable_math import bounded_sin_cos, exp, log
from sim_bridge.plant.disturbance import (
    GUST_DOWN_RATIO,
    GUST_TIME_S,
    TORQUE_GUST_TIME_S,
    TORQUE_GUST_YAW_RATIO,
    Disturbance,
)
from sim_bridge.plant.layout import NOISE_ROWS

_UNUSED_BITS = np.uint64(11)
"""Of an integer of 64 bits for a number in [0, 1) with 53."""


@compiled
def _box_muller(integers: Any, deviates: FloatArray) -> None:
    """Write a pair of independent normal deviates for each pair of random integers of 64 bits.

    The loops are vectorised; as one they are not.
    """
    for pair in range(len(integers) // 2):
        deviates[2 * pair] = math.sqrt(-2.0 * log(1.0 - (integers[2 * pair] >> _UNUSED_BITS) / 2.0**53))
        deviates[2 * pair + 1] = 2.0 * math.pi * ((integers[2 * pair + 1] >> _UNUSED_BITS) / 2.0**53)
    for pair in range(len(integers) // 2):
        radius, (sine, cosine) = deviates[2 * pair], bounded_sin_cos(deviates[2 * pair + 1])
        deviates[2 * pair], deviates[2 * pair + 1] = radius * cosine, radius * sine


def normal_deviates(bits: np.random.PCG64, count: int) -> FloatArray:
    """Return the next ``count`` standard normal deviates; each pair takes two integers of 64 bits."""
    integers = bits.random_raw(count + count % 2)
    deviates = np.empty(len(integers))
    _box_muller(integers, deviates)
    return deviates[:count]


class _Gust:
    """A Gauss-Markov process of three components; ``name`` and ``noise`` are its fields in the record."""

    def __init__(
        self, record: Record, name: str, noise: str, spread: FloatArray, time_s: float, bits: np.random.PCG64
    ) -> None:
        self.active = False
        self._record, self._name = record, name
        self._noise: FloatArray = record[noise]
        self._spread, self._time_s = np.zeros(3), time_s
        self._bits = bits
        self._step_s = 0.0
        self._paused: FloatArray | None = None  # unit deviates at which the process was disabled
        self._ahead: FloatArray | None = None  # noise of the steps after the next NOISE_ROWS
        self.set_spread(spread)

    def set_spread(self, spread: FloatArray) -> None:
        """Set the standard deviations, zero for none; the present gust is scaled."""
        if np.array_equal(spread, self._spread):
            return
        present = self._paused
        if self.active:
            present = self._record[self._name] / self._spread
        elif present is None:
            present = normal_deviates(self._bits, 3)
        has_noise, self.active = self.active, bool(spread.any())
        self._spread, self._paused = spread, present
        self._record[self._name] = spread * present
        if self.active and not has_noise:
            self._noise[:NOISE_ROWS] = self._drawn() if self._ahead is None else self._ahead
            self._draw_ahead()
        self.set_step(self._step_s)

    def _drawn(self) -> FloatArray:
        return normal_deviates(self._bits, 3 * NOISE_ROWS).reshape(NOISE_ROWS, 3)

    def _draw_ahead(self) -> None:
        self._noise[NOISE_ROWS:] = self._ahead = self._drawn()

    def pass_by(self) -> None:
        """Draw new noise after ``NOISE_ROWS`` steps."""
        if self.active:
            self._noise[:NOISE_ROWS] = self._noise[NOISE_ROWS:]
            self._draw_ahead()

    def set_step(self, step_s: float) -> None:
        """Set decay and noise of one step: spread and correlation time do not depend on the step."""
        self._step_s = step_s
        decay = exp(-step_s / self._time_s)
        self._record[f"{self._name}_decay"] = decay
        self._record[f"{self._name}_scale"] = self._spread * math.sqrt(1.0 - decay * decay)


def _wind_spread(gust_m_s: float) -> FloatArray:
    return np.array([1.0, 1.0, GUST_DOWN_RATIO]) * gust_m_s


class Turbulence:
    """Gusts of wind and torque of one plant, written to its record of ``MEMORY``."""

    def __init__(self, record: Record, disturbance: Disturbance, seed: int) -> None:
        torque = np.array([1.0, 1.0, TORQUE_GUST_YAW_RATIO]) * disturbance.torque_gust_n_m
        self._record = record
        wind = _wind_spread(disturbance.gust_m_s)
        self._gusts = (
            _Gust(record, "gust", "noise", wind, GUST_TIME_S, np.random.PCG64(seed)),
            _Gust(
                record,
                "torque_gust",
                "torque_noise",
                torque,
                TORQUE_GUST_TIME_S,
                np.random.PCG64(seed).jumped(),
            ),
        )
        record["torque"] = record["steady_torque"] + record["torque_gust"]
        self.active = any(gust.active for gust in self._gusts)

    def set_gust(self, gust_m_s: float) -> None:
        """Set the standard deviation of the gusts of wind."""
        self.rows_left()  # a gust that begins now uses the first noise that is drawn for it
        self._gusts[0].set_spread(_wind_spread(gust_m_s))
        self.active = any(gust.active for gust in self._gusts)

    def set_step(self, step_s: float) -> None:
        """Adapt the processes to the plant's step [s]."""
        for gust in self._gusts:
            gust.set_step(step_s)

    def rows_left(self) -> int:
        """Return the number of steps with noise left, more than ``NOISE_ROWS``."""
        if (row := int(self._record["noise_row"])) >= NOISE_ROWS:
            for gust in self._gusts:
                gust.pass_by()
            self._record["noise_row"] = row = row - NOISE_ROWS
        return 2 * NOISE_ROWS - row

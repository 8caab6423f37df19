"""Low-pass filter of the rates for the control loops, as PX4's of the gyro (IMU_GYRO_CUTOFF).

Second-order Butterworth, in the trapezoidal state-variable form (A. Simper, Cytomic technical paper "Linear Trap
Integrated SVF", 2013). Its state is physical, so that a step of another length needs no new start. The filter of the
navigation takes the unfiltered samples.
"""

from __future__ import annotations

import math
from typing import Annotated, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.portable_math import tan

RATE_FILTER_SIZE = 9
"""Band and low state of each axis (6), the step and the cutoff for which the factor holds, and the factor."""
RateFilter: TypeAlias = Annotated[FloatArray, RATE_FILTER_SIZE]

_STEP_S, _CUTOFF_HZ, _FACTOR = 6, 7, 8
_DAMPING = math.sqrt(2.0)
_HIGHEST_SHARE = 0.45
"""Cutoff over the sample rate from which the filter passes the rates on unchanged."""


@compiled
def _start(x: RateFilter, gyro: Vector3) -> None:
    x[0], x[1], x[2], x[3], x[4], x[5] = 0.0, gyro.x, 0.0, gyro.y, 0.0, gyro.z


@compiled
def _filter_axis(x: RateFilter, at: int, value: float) -> float:
    """Return the filtered value of one axis."""
    g = x[_FACTOR]
    a1 = 1.0 / (1.0 + g * (g + _DAMPING))
    step = value - x[at + 1]
    band = a1 * (x[at] + g * step)
    low: float = x[at + 1] + g * band
    x[at], x[at + 1] = 2.0 * band - x[at], 2.0 * low - x[at + 1]
    return low


@compiled
def filtered_rates(x: RateFilter, gyro: Vector3, dt_s: float, cutoff_hz: float) -> Vector3:
    """Return the rates [rad/s] behind the filter; unchanged if ``cutoff_hz`` is 0 or near half the sample rate."""
    if cutoff_hz <= 0.0 or cutoff_hz * dt_s >= _HIGHEST_SHARE:
        _start(x, gyro)
        x[_STEP_S] = 0.0
        return gyro
    if x[_STEP_S] != dt_s or x[_CUTOFF_HZ] != cutoff_hz:
        if x[_STEP_S] == 0.0:
            _start(x, gyro)
        x[_STEP_S], x[_CUTOFF_HZ], x[_FACTOR] = dt_s, cutoff_hz, tan(math.pi * cutoff_hz * dt_s)
    roll = _filter_axis(x, 0, gyro.x)
    pitch = _filter_axis(x, 2, gyro.y)
    yaw = _filter_axis(x, 4, gyro.z)
    return Vector3(roll, pitch, yaw)

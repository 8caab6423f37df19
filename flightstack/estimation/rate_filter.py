"""Low-pass filter of the rates for the control loops, as PX4's of the gyro (IMU_GYRO_CUTOFF).

Second-order Butterworth, in the trapezoidal state-variable form (A. Simper, Cytomic technical paper "Linear Trap
Integrated SVF", 2013). Its state is physical, so that a step of another length needs no new start. The filter of the
navigation takes the unfiltered samples.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple, TypeAlias

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, Vector3
from flightstack.core.portable_math import tan

_DAMPING = math.sqrt(2.0)
_HIGHEST_SHARE = 0.45
"""Cutoff over the sample rate from which the filter passes the rates on unchanged."""


class RateFilter(NamedTuple):
    """State of the filter."""

    band: Annotated[FloatArray, 3]
    """Of each axis, as the next one."""
    low: Annotated[FloatArray, 3]
    step_s: float
    """Step and cutoff for which the factor holds."""
    cutoff_hz: float
    factor: float


RateFilterRecord: TypeAlias = Annotated[Record, RateFilter]


@compiled
def _start(x: RateFilterRecord, gyro: Vector3) -> None:
    x["band"][0], x["band"][1], x["band"][2] = 0.0, 0.0, 0.0
    x["low"][0], x["low"][1], x["low"][2] = gyro.x, gyro.y, gyro.z


@compiled
def _filter_axis(x: RateFilterRecord, axis: int, value: float) -> float:
    """Return the filtered value of one axis."""
    g = x["factor"]
    a1 = 1.0 / (1.0 + g * (g + _DAMPING))
    step = value - x["low"][axis]
    band = a1 * (x["band"][axis] + g * step)
    low: float = x["low"][axis] + g * band
    x["band"][axis], x["low"][axis] = 2.0 * band - x["band"][axis], 2.0 * low - x["low"][axis]
    return low


@compiled
def filtered_rates(x: RateFilterRecord, gyro: Vector3, dt_s: float, cutoff_hz: float) -> Vector3:
    """Return the rates [rad/s] behind the filter; unchanged if ``cutoff_hz`` is 0 or near half the sample rate."""
    if cutoff_hz <= 0.0 or cutoff_hz * dt_s >= _HIGHEST_SHARE:
        _start(x, gyro)
        x["step_s"] = 0.0
        return gyro
    if x["step_s"] != dt_s or x["cutoff_hz"] != cutoff_hz:
        if x["step_s"] == 0.0:
            _start(x, gyro)
        x["step_s"], x["cutoff_hz"], x["factor"] = dt_s, cutoff_hz, tan(math.pi * cutoff_hz * dt_s)
    roll = _filter_axis(x, 0, gyro.x)
    pitch = _filter_axis(x, 1, gyro.y)
    yaw = _filter_axis(x, 2, gyro.z)
    return Vector3(roll, pitch, yaw)

"""Differences of float32 numbers in units of the last place."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray

Float32Array: TypeAlias = np.ndarray[Any, np.dtype[np.float32]]
IntArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

_MAGNITUDE = 0x7FFF_FFFF


def steps_apart(first: Float32Array, second: Float32Array) -> IntArray:
    """Return the number of float32 steps between each pair of numbers: 0 if equal; −0 equals 0.

    Representable numbers are dense near zero, so that rounding errors count much here: ``in_ulps`` measures against
    the magnitude of the signal.
    """
    apart: IntArray = np.abs(_ordinal(first) - _ordinal(second))
    return apart


def _ordinal(values: Float32Array) -> IntArray:
    bits = np.ascontiguousarray(values, np.float32).view(np.int32).astype(np.int64)
    return np.where(bits < 0, -(bits & _MAGNITUDE), bits)


def ulp_of(magnitude: float) -> float:
    """Return the distance from a float32 number to the next larger one."""
    return float(np.spacing(np.float32(abs(magnitude))))


def in_ulps(difference: FloatArray | float, magnitude: float) -> FloatArray | float:
    """Return a difference in units of the last place that a float32 of ``magnitude`` has."""
    return difference / ulp_of(magnitude)

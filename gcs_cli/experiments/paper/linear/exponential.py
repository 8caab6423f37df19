"""The exponential of a small matrix: SciPy's calls a threaded library, which costs milliseconds for six rows."""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.contract import FloatArray

_TERMS = 18
_SMALL = 0.5


def exponential(matrix: FloatArray) -> FloatArray:
    """Return e^M of a square matrix: Taylor's series of M/2^k, squared k times.

    With a norm of at most 0.5, the first term left out is below 2^-18/18! ≈ 6e-22 of the sum.
    """
    norm = float(np.abs(matrix).sum(axis=1).max())
    halvings = max(0, math.ceil(math.log2(norm / _SMALL))) if norm > _SMALL else 0
    scaled = matrix / 2.0**halvings
    total = term = np.eye(len(matrix))
    for order in range(1, _TERMS):
        term = term @ scaled / order
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total

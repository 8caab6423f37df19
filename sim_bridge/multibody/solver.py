"""Turn knobs until conditions are met, as little as possible: Newton's method for fewer equations than unknowns."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flightstack.core.contract import FloatArray

_ROUNDS = 40
_STEP = 1e-6
_MET = 1e-14
_GOOD = 1e-6  # less is rounding, or a mesh of single precision
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 1e-3)  # of a step, the first that helps is taken
_SMALLEST_RATIO = 1e-7  # of singular values: conditions that no knob moves are left alone


def meet(miss: Callable[[FloatArray], FloatArray], ladder: Sequence[FloatArray]) -> FloatArray:
    """Return knobs x near zero with miss(x) = 0, or in the least squares where that cannot be.

    ``ladder`` holds limits of |x|, narrow ones first: the first within which all is met are taken, and the last where
    nothing is. No randomness: the same conditions give the same bits.
    """
    for limits in ladder:
        x, rest = _newton(miss, np.zeros(len(limits)), limits)
        if np.abs(rest).max() < _GOOD:
            return x
    # least squares end some 1e-7 beside conditions that can be met after all
    return _newton(miss, _compromise(miss, x, limits), limits)[0]


def _newton(
    miss: Callable[[FloatArray], FloatArray], x: FloatArray, limits: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return knobs within the limits, from ``x`` on, and what is missed with them.

    Each step is the shortest one, measured in units of the limits, to where the linearised conditions are met
    (Gauss-Newton with the pseudo-inverse).
    """
    rest = miss(x)
    for _ in range(_ROUNDS):
        if np.abs(rest).max() < _MET:
            break
        step = _step(_slope(miss, x), rest, x, limits)
        for share in _SHARES:
            new = np.clip(x + share * step, -limits, limits)
            new_rest = miss(new)
            if new_rest @ new_rest < rest @ rest:
                x, rest = new, new_rest
                break
        else:
            break
    return x, rest


def _compromise(miss: Callable[[FloatArray], FloatArray], x: FloatArray, limits: FloatArray) -> FloatArray:
    """Return the least squares within the limits, from ``x`` on, for conditions that cannot all be met."""
    from scipy.optimize import least_squares  # noqa: PLC0415  # slow to load, and seldom needed

    inside = np.clip(x, -0.99 * limits, 0.99 * limits)
    found: FloatArray = least_squares(miss, inside, bounds=(-limits, limits), x_scale=limits, max_nfev=60).x
    return found


def _step(slope: FloatArray, rest: FloatArray, x: FloatArray, limits: FloatArray) -> FloatArray:
    """Shortest step to slope·step = −rest that leaves no knob beyond its limit, in the sense of least squares."""
    step = np.zeros(len(x))
    free = np.ones(len(x), dtype=bool)
    while free.any():
        weighted = slope[:, free] * limits[free]
        inverse = np.linalg.pinv(weighted, rcond=_SMALLEST_RATIO)
        step[free] = limits[free] * (inverse @ -(rest + slope[:, ~free] @ step[~free]))
        over = free & (np.abs(x + step) > limits)
        if not over.any():
            break
        step[over] = np.sign(step[over]) * limits[over] - x[over]
        free &= ~over
    return step


def _slope(miss: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """Jacobian by central differences, shape (conditions, knobs)."""
    columns = []
    for index in range(len(x)):
        step = np.zeros(len(x))
        step[index] = _STEP
        columns.append((miss(x + step) - miss(x - step)) / (2.0 * _STEP))
    return np.array(columns).T

"""Solve an underdetermined system of equations within limits, with the smallest change: damped Gauss-Newton."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flightstack.core.contract import FloatArray

_ITERATIONS = 40
_DIFFERENCE = 1e-6
_CONVERGED = 1e-14
_SOLVED = 1e-6  # less is rounding, or a mesh of single precision
_DAMPING = (
    1.0,
    0.5,
    0.25,
    0.1,
    0.03,
    0.01,
    1e-3,
)  # factors of a step; the first that reduces the residual is taken
_SMALLEST_RATIO = 1e-7  # of singular values: equations that no unknown affects are ignored

Residual = Callable[[FloatArray], FloatArray]


def solve(residual: Residual, limits: Sequence[FloatArray]) -> FloatArray:
    """Return x near zero with residual(x) = 0, or the least-squares solution if there is none.

    ``limits`` holds bounds of |x|, narrow ones first: the first bounds with a solution are used, or the last ones.
    No randomness: the same equations give the same bits.
    """
    for bounds in limits:
        x, rest = _newton(residual, np.zeros(len(bounds)), bounds)
        if np.abs(rest).max() < _SOLVED:
            return x
    # least squares stop some 1e-7 away from a solution that exists
    return _newton(residual, _least_squares(residual, x, bounds), bounds)[0]


def _newton(residual: Residual, x: FloatArray, limits: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x within the limits, starting from ``x``, and its residual.

    Each step is the shortest one, in units of the limits, that solves the linearised equations (Gauss-Newton with
    the pseudo-inverse).
    """
    rest = residual(x)
    for _ in range(_ITERATIONS):
        if np.abs(rest).max() < _CONVERGED:
            break
        step = _step(_jacobian(residual, x), rest, x, limits)
        for factor in _DAMPING:
            new = np.clip(x + factor * step, -limits, limits)
            new_rest = residual(new)
            if new_rest @ new_rest < rest @ rest:
                x, rest = new, new_rest
                break
        else:
            break
    return x, rest


def _least_squares(residual: Residual, x: FloatArray, limits: FloatArray) -> FloatArray:
    """Return the least-squares solution within the limits, starting from ``x``."""
    from scipy.optimize import least_squares

    inside = np.clip(x, -0.99 * limits, 0.99 * limits)
    found: FloatArray = least_squares(
        residual, inside, bounds=(-limits, limits), x_scale=limits, max_nfev=60
    ).x
    return found


def _step(jacobian: FloatArray, rest: FloatArray, x: FloatArray, limits: FloatArray) -> FloatArray:
    """Return the shortest least-squares step with jacobian·step = −rest that exceeds no limit."""
    step = np.zeros(len(x))
    free = np.ones(len(x), dtype=bool)
    while free.any():
        weighted = jacobian[:, free] * limits[free]
        inverse = np.linalg.pinv(weighted, rcond=_SMALLEST_RATIO)
        step[free] = limits[free] * (inverse @ -(rest + jacobian[:, ~free] @ step[~free]))
        over = free & (np.abs(x + step) > limits)
        if not over.any():
            break
        step[over] = np.sign(step[over]) * limits[over] - x[over]
        free &= ~over
    return step


def _jacobian(residual: Residual, x: FloatArray) -> FloatArray:
    """Return the Jacobian by central differences, shape (equations, unknowns)."""
    columns = []
    for index in range(len(x)):
        step = np.zeros(len(x))
        step[index] = _DIFFERENCE
        columns.append((residual(x + step) - residual(x - step)) / (2.0 * _DIFFERENCE))
    return np.array(columns).T

"""Linear algebra for small matrices in plain floats, with bit-identical results on every processor.

LAPACK and BLAS select kernels, and with them the order of operations, by processor. The functions here fix the order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightstack.core.contract import FloatArray

_SWEEPS = 30  # Jacobi's method converges quadratically: random 6 × 6 matrices took at most seven sweeps

_LEAST_REST = 1e-9  # relative residual below which a row counts as dependent on earlier rows


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Scalar product, summed from first to last."""
    total = 0.0
    for left, right in zip(a, b, strict=True):
        total += left * right
    return total


def pseudo_inverse(matrix: FloatArray) -> FloatArray:
    """Return the pseudo-inverse, shape (n, m), of a matrix A, shape (m, n), also if its rows differ much in size.

    A = L·Q by Gram-Schmidt orthonormalisation with each row processed twice; a dependent row adds nothing to Q. Then
    A⁺ = Qᵀ·L⁺.
    """
    lower, orthonormal = _orthonormal_rows(matrix.tolist())
    if not orthonormal:
        return np.zeros(matrix.shape[::-1])
    if len(orthonormal) == len(lower):
        inverse = _triangular_inverse(lower)
    else:  # L has more rows than columns, and independent columns
        inverse = pseudo_inverse(np.array(lower).T).T.tolist()
    columns, places = list(zip(*inverse, strict=True)), list(zip(*orthonormal, strict=True))
    return np.array([[dot(place, column) for column in columns] for place in places])


def _orthonormal_rows(rows: list[list[float]]) -> tuple[list[list[float]], list[list[float]]]:
    """Return L, shape (m, rank), and Q, shape (rank, n), of rows L·Q."""
    orthonormal: list[list[float]] = []
    lower: list[list[float]] = []
    for row in rows:
        rest, shares = row, [0.0] * len(orthonormal)
        for _ in range(2):
            for known, unit in enumerate(orthonormal):
                share = dot(rest, unit)
                shares[known] += share
                rest = [value - share * part for value, part in zip(rest, unit, strict=True)]
        length = math.sqrt(dot(rest, rest))
        if length > _LEAST_REST * math.sqrt(dot(row, row)):
            shares.append(length)
            orthonormal.append([value / length for value in rest])
        lower.append(shares)
    return [shares + [0.0] * (len(orthonormal) - len(shares)) for shares in lower], orthonormal


def _triangular_inverse(lower: list[list[float]]) -> list[list[float]]:
    """Return the inverse of a lower triangular matrix."""
    count = len(lower)
    inverse = [[0.0] * count for _ in range(count)]
    for column in range(count):
        for row in range(column, count):
            total = 1.0 if row == column else 0.0
            for known in range(column, row):
                total -= lower[row][known] * inverse[known][column]
            inverse[row][column] = total / lower[row][row]
    return inverse


def largest_eigenvalue(matrix: FloatArray) -> float:
    """Return the largest eigenvalue of a symmetric matrix, shape (n, n), by Jacobi's method in cyclic order."""
    a: list[list[float]] = matrix.tolist()
    count = len(a)
    for _ in range(_SWEEPS):
        largest = max(abs(a[i][i]) for i in range(count))
        if all(abs(a[i][j]) <= 1e-17 * largest for i in range(count) for j in range(i)):
            break
        for p in range(count - 1):
            for q in range(p + 1, count):
                _rotate(a, p, q)
    return max(a[i][i] for i in range(count))


def _rotate(a: list[list[float]], p: int, q: int) -> None:
    """Make ``a[p][q]`` zero by a rotation of the rows and columns p and q."""
    if a[p][q] == 0.0:
        return
    theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q])
    tangent = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
    cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for k in range(len(a)):
        a[k][p], a[k][q] = cosine * a[k][p] - sine * a[k][q], sine * a[k][p] + cosine * a[k][q]
    for k in range(len(a)):
        a[p][k], a[q][k] = cosine * a[p][k] - sine * a[q][k], sine * a[p][k] + cosine * a[q][k]
    a[p][q] = a[q][p] = 0.0

"""Linear algebra of a few rows in plain floats: the same bits on every processor.

LAPACK and BLAS choose their kernels by the processor, and with them the order of operations. What a flight is made of
is small enough for loops whose order is written here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightstack.contract import FloatArray

_SWEEPS = 30  # Jacobi's method converges quadratically: seven sweeps were the most for a random 6 × 6 matrix

_LEAST_REST = 1e-9  # share of a row that the rows before it must leave of it


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Scalar product, summed from first to last."""
    total = 0.0
    for left, right in zip(a, b, strict=True):
        total += left * right
    return total


def pseudo_inverse(matrix: FloatArray) -> FloatArray:
    """Return the pseudo-inverse, shape (n, m), of a matrix of full row rank, shape (m, n): A⁺ = Aᵀ(A·Aᵀ)⁻¹.

    The rows are made orthonormal one after the other (A = L·Q, Gram and Schmidt's method, each row twice), then
    L·X = I is solved from the first row on: A⁺ = Qᵀ·X. Raise ValueError if the rows depend on each other.
    """
    rows: list[list[float]] = matrix.tolist()
    count = len(rows)
    orthonormal: list[list[float]] = []
    lower = [[0.0] * count for _ in range(count)]
    for index, row in enumerate(rows):
        rest = row
        for _ in range(2):
            for known, unit in enumerate(orthonormal):
                share = dot(rest, unit)
                lower[index][known] += share
                rest = [value - share * part for value, part in zip(rest, unit, strict=True)]
        length = math.sqrt(dot(rest, rest))
        if not length > _LEAST_REST * math.sqrt(dot(row, row)):
            raise ValueError("the rows of the matrix depend on each other")
        lower[index][index] = length
        orthonormal.append([value / length for value in rest])
    inverse = np.zeros((len(rows[0]), count))
    for column in range(count):
        solution = [0.0] * count
        for index in range(column, count):
            total = 1.0 if index == column else 0.0
            for known in range(column, index):
                total -= lower[index][known] * solution[known]
            solution[index] = total / lower[index][index]
        for place in range(len(rows[0])):
            inverse[place, column] = dot([unit[place] for unit in orthonormal], solution)
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

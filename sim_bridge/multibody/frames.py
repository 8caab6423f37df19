"""Conversion between the project's frames and those of the MuJoCo model.

The project uses world NED (north, east, down) and body FRD (forward, right, down), the model world NWU (north, west,
up) and body FLU (forward, left, up). Both pairs differ by half a turn about x, which is its own inverse: each function
converts in both directions.
"""

from __future__ import annotations

from collections.abc import Sequence

Triple = tuple[float, float, float]


def flip_vector(v: Sequence[float]) -> Triple:
    """Convert a vector between NED and NWU, or between FRD and FLU."""
    x, y, z = v
    return x, -y, -z


def flip_quaternion(q: Sequence[float]) -> tuple[float, float, float, float]:
    """Convert a quaternion (w, x, y, z) between FRD to NED and FLU to NWU."""
    w, x, y, z = q
    return w, x, -y, -z

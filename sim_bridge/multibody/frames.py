"""Between the project's frames and MuJoCo's: the only place that knows how they differ.

The project has the world NED (north, east, down) and the body FRD (forward, right, down). The model has the world
north, west, up and the body forward, left, up. Both pairs differ by half a turn about the x axis, which is its own
inverse: each function works in both directions.
"""

from __future__ import annotations

from collections.abc import Sequence

Triple = tuple[float, float, float]


def flip_vector(v: Sequence[float]) -> Triple:
    """Turn (x, y, z) by half a turn about x: NED or FRD to the model's world or body, and back."""
    x, y, z = v
    return x, -y, -z


def flip_quaternion(q: Sequence[float]) -> tuple[float, float, float, float]:
    """Turn the axes of a quaternion (w, x, y, z) body to world, in both frames at once."""
    w, x, y, z = q
    return w, x, -y, -z

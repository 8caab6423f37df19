"""Motion in the convention of viewers: east, north, up and forward, left, up. Pure."""

from __future__ import annotations

import math

import numpy as np

from flightstack.core.contract import FloatArray

_HALF = math.sqrt(0.5)
WORLD, BODY = "map", "base_link"
"""Frames, as ROS names them (REP 105): east, north, up; forward, left, up."""
PATH_POINTS = 4000
"""Largest number of points of a drawn path."""


def enu_positions(ned_m: FloatArray) -> FloatArray:
    """Return positions NED (n, 3) as ENU."""
    return np.column_stack((ned_m[:, 1], ned_m[:, 0], -ned_m[:, 2]))


def enu_quaternions(q: FloatArray) -> FloatArray:
    """Return quaternions FRD to NED, shape (n, 4), as quaternions FLU to ENU; both scalar first.

    The turn of the world is the product with (0, √½, √½, 0) on the left, that of the body with (0, 1, 0, 0) on the
    right.
    """
    w, x, y, z = q.T
    turned = _HALF * np.column_stack((-x - y, w + z, w - z, y - x))
    w, x, y, z = turned.T
    return np.column_stack((-x, w, z, -y))

"""What the scripts of this folder share. The interpreter of the simulator runs it, which has no flightstack."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

RATE_HZ = 500
SIDE_M, SPEED_M_S, ALTITUDE_M = 4.0, 1.0, 1.0
CORNERS_M = ((0.0, 0.0), (SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M))


def place_m(time_s: float) -> tuple[float, float, float]:
    """Return the point of the square at a time: x, y, z, z up [m]."""
    sides, way_m = divmod(SPEED_M_S * time_s, SIDE_M)
    (x, y), (to_x, to_y) = (CORNERS_M[int(sides + more) % 4] for more in (0, 1))
    share = way_m / SIDE_M
    return x + share * (to_x - x), y + share * (to_y - y), ALTITUDE_M


def answer(fly: Callable[[float], tuple[float, float]]) -> None:
    """For each line of stdin, fly that many seconds; print a line of JSON.

    ``fly`` returns the simulated time of all vehicles together [s], and the distance to the square at the end [m].
    """
    for line in sys.stdin:
        began_s = time.process_time()
        simulated_s, error_m = fly(float(line))
        spent_s = time.process_time() - began_s
        answered = {"simulated_s": simulated_s, "processor_s": spent_s, "error_m": float(error_m)}
        print(json.dumps(answered), flush=True)

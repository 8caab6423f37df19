"""How far two plants come apart when the same loops fly the same trajectory on both. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gcs_cli.paper.cases import CONTENDERS, DESIRED, MULTIBODY, PLAIN, RIGID, SMALL_ANGLE, key
from gcs_cli.paper.types import Recording

POSITION_BOUND_M = 0.01
ATTITUDE_BOUND_DEG = 0.5
"""What the rigid-body plant and the multibody plant may differ by over the whole desired trajectory."""
PAIRS = ((RIGID, MULTIBODY, True), (SMALL_ANGLE, RIGID, False))
"""Pairs of plants, and whether the bound holds for them: small angles are another model, and differ by right."""


def difference(one: Recording, other: Recording) -> dict[str, Any]:
    """Return the largest and the RMS difference of position [m] and attitude [°], over the time that both flew."""
    count = min(len(one.time_s), len(other.time_s))
    position = np.linalg.norm(one.position_ned_m[:count] - other.position_ned_m[:count], axis=1)
    attitude = np.degrees(np.abs(one.euler_rad[:count] - other.euler_rad[:count]))
    worst = attitude.max(axis=1)
    return {
        "max_position_m": float(position.max()),
        "rms_position_m": float(np.sqrt(np.mean(position**2))),
        "max_attitude_deg": float(worst.max()),
        "rms_attitude_deg": float(np.sqrt(np.mean(worst**2))),
        "max_roll_pitch_yaw_deg": attitude.max(axis=0).tolist(),
        "seconds": float(one.time_s[count - 1]),
        "both_flew_to_the_end": one.ended_s is None and other.ended_s is None,
    }


def comparisons(recordings: Mapping[str, Recording], trajectory: str = DESIRED) -> dict[str, Any]:
    """Return the differences of each pair of plants, "rigid_multibody" first, for each contender that flew both."""
    table: dict[str, Any] = {}
    for one, other, bounded in PAIRS:
        for contender in CONTENDERS:
            pair = [recordings.get(key(contender.name, trajectory, PLAIN, plant)) for plant in (one, other)]
            if pair[0] is None or pair[1] is None:
                continue
            found = difference(pair[0], pair[1])
            if bounded:
                found |= {
                    "position_bound_m": POSITION_BOUND_M,
                    "attitude_bound_deg": ATTITUDE_BOUND_DEG,
                    "within_bounds": found["both_flew_to_the_end"]
                    and found["max_position_m"] <= POSITION_BOUND_M
                    and found["max_attitude_deg"] <= ATTITUDE_BOUND_DEG,
                }
            table.setdefault(f"{one}_{other}", {})[contender.name] = found
    return table

"""Differences between two plants on which the same loops fly the same trajectory. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from gcs_cli.experiments.paper.flights.cases import (
    CONTENDERS,
    DESIRED,
    HARD,
    MULTIBODY,
    NUDGE,
    PLAIN,
    RIGID,
    SMALL_ANGLE,
    SMOOTH,
    STEPS,
    key,
)
from gcs_cli.experiments.paper.flights.types import Recording

POSITION_BOUND_M = 0.01
ATTITUDE_BOUND_DEG = 0.5
"""Largest allowed difference of the rigid-body and the multibody plant over the desired trajectory."""
ROUNDING_M = 1e-6
"""A larger effect of a push of 10⁻¹² N means that an unstable loop amplifies it."""
PAIRS = ((RIGID, MULTIBODY, True), (SMALL_ANGLE, RIGID, False))
"""Pairs of plants, and True if the bound applies: the small-angle plant is another model."""


class Apart(NamedTuple):
    """Differences of two flights of the same case over their n common ticks."""

    time_s: FloatArray
    """Shape (n,)."""
    position_m: FloatArray
    """Distance, shape (n,)."""
    attitude_deg: FloatArray
    """Of roll, pitch and yaw, shape (n, 3)."""


def apart(one: Recording, other: Recording) -> Apart:
    """Return the differences of two flights, tick by tick."""
    n = min(len(one.time_s), len(other.time_s))
    return Apart(
        one.time_s[:n],
        np.linalg.norm(one.position_ned_m[:n] - other.position_ned_m[:n], axis=1),
        np.degrees(np.abs(one.euler_rad[:n] - other.euler_rad[:n])),
    )


def difference(one: Recording, other: Recording) -> dict[str, Any]:
    """Return the largest and the RMS difference of position [m] and attitude [°], over their common time."""
    time_s, position, attitude = apart(one, other)
    worst = attitude.max(axis=1)
    return {
        "max_position_m": float(position.max()),
        "rms_position_m": float(np.sqrt(np.mean(position**2))),
        "max_attitude_deg": float(worst.max()),
        "rms_attitude_deg": float(np.sqrt(np.mean(worst**2))),
        "max_roll_pitch_yaw_deg": attitude.max(axis=0).tolist(),
        "seconds": float(time_s[-1]),
        "both_flew_to_the_end": one.ended_s is None and other.ended_s is None,
    }


def comparisons(recordings: Mapping[str, Recording], trajectory: str = DESIRED) -> dict[str, Any]:
    """Return the differences of each pair of plants, "rigid_multibody" first, for each contender that flew both.

    ``rounding`` is the effect of a push of 10⁻¹² N on the rigid body, if that case was flown. ``bound_decides`` is True
    if the effect stayed small: a loop that amplifies rounding separates two equal plants by chance.
    """
    table: dict[str, Any] = {}
    for first, second, bounded in PAIRS:
        for contender in CONTENDERS:
            one, other, nudged = (
                recordings.get(key(contender.name, trajectory, condition, plant))
                for condition, plant in ((PLAIN, first), (PLAIN, second), (NUDGE.name, first))
            )
            if one is None or other is None:
                continue
            found = difference(one, other)
            if bounded:
                found |= _bounds(found, None if nudged is None else difference(one, nudged))
            table.setdefault(f"{first}_{second}", {})[contender.name] = found
    return table


def _bounds(found: Mapping[str, Any], rounding: Mapping[str, Any] | None) -> dict[str, Any]:
    return {
        "position_bound_m": POSITION_BOUND_M,
        "attitude_bound_deg": ATTITUDE_BOUND_DEG,
        "within_bounds": found["both_flew_to_the_end"]
        and found["max_position_m"] <= POSITION_BOUND_M
        and found["max_attitude_deg"] <= ATTITUDE_BOUND_DEG,
        "rounding": rounding,
        "bound_decides": rounding is not None and rounding["max_position_m"] < ROUNDING_M,
    }


def other_trajectories(recordings: Mapping[str, Recording]) -> dict[str, Any]:
    """Return the same table for each other trajectory of which the multibody plant flew at least one case."""
    found = {name: comparisons(recordings, name) for name in (SMOOTH, HARD, *STEPS)}
    pair = f"{RIGID}_{MULTIBODY}"
    return {name: {pair: of[pair]} for name, of in found.items() if pair in of}

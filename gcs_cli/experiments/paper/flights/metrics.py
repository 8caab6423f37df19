"""Figures of a recording: of each axis against its reference, of the path in XY, and of the rotors' work. Pure.

A move of an axis lies between two holds of its reference (0.9 s or longer without a change); a step is a move that
takes no time. Its response is scaled to 0 before and 1 after it. Over the moves of an axis

* overshoot is the largest share by which the response passes 1 before the next move begins. It is given for each move,
  and the largest and the median of them all. A move counts only if the axis was at rest when it began, within 2 % of
  the move of its place and slower than 2 % of the move per second: else the rest of the previous move would count;
* rise time, from 10 to 90 %, and settling time, from the move's begin until the response stays within 2 % of 1, are
  those of the last such move that is observed for 4 s or more; None without one, or where it does not rise or settle.

Crossings are interpolated between ticks. Errors are actual minus reference; the steady-state error is the mean of the
last second. A reference without holds (the attitude target of the outer loop) has errors only.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray, LoopStatus
from gcs_cli.experiments.paper.flights.types import AxisMetrics, MoveMetrics, Recording

HOLD_S = 0.9
"""Shortest hold of a reference; a change between two holds is one move, or none if the reference returns."""
SETTLED = 0.02
AT_REST_PER_S = 0.02
"""Largest speed at rest, as a share of the next move per second."""
WATCHED_S = 4.0
"""Observation time of a response for its settling time."""
_SPEED_OVER_S = 0.05
LOW, HIGH = 0.1, 0.9
STEADY_S = 1.0
_SMALLEST_MOVE = 1e-9
_PATH_EVERY_S = 0.04
_SPACING_M = 0.05

_BITS = {
    "roll": LoopStatus.ROLL_SATURATED,
    "pitch": LoopStatus.PITCH_SATURATED,
    "yaw": LoopStatus.YAW_SATURATED,
    "thrust": LoopStatus.THRUST_SATURATED,
}


class Move(NamedTuple):
    """One move of a reference, in ticks: it begins in ``begin``, and its response is observed until ``end``."""

    begin: int
    end: int
    start: float
    target: float


class PathMetrics(NamedTuple):
    """Errors of the path in the horizontal plane [m]."""

    rms_error_m: float
    """Distance from the reference of the same time."""
    max_error_m: float
    path_rms_m: float
    """Distance from the nearest point of the path, at any time."""
    path_max_m: float
    beyond_m: float
    """Largest distance outside the bounding rectangle of the path: the overshoot at its corners."""


class Effort(NamedTuple):
    """Load of the rotors."""

    saturated_percent: dict[str, float]
    """Share of the ticks in which the mixer could not follow: roll, pitch, yaw, thrust."""
    torque_rms_n_m: tuple[float, float, float]
    """Demanded torque, which shows an oscillating loop first."""


def measure(recording: Recording) -> dict[str, AxisMetrics]:
    """Return the figures of x, y, z (down), roll, pitch and yaw, for the axes that the trajectory controls."""
    time_s = recording.time_s
    signals = {
        "x": (recording.position_ned_m[:, 0], recording.reference[:, 0]),
        "y": (recording.position_ned_m[:, 1], recording.reference[:, 1]),
        "z": (recording.position_ned_m[:, 2], recording.reference[:, 2]),
        "roll": (recording.euler_rad[:, 0], recording.euler_target_rad[:, 0]),
        "pitch": (recording.euler_rad[:, 1], recording.euler_target_rad[:, 1]),
        "yaw": (recording.euler_rad[:, 2], recording.reference[:, 3]),
    }
    return {
        name: axis_metrics(time_s, actual, reference)
        for name, (actual, reference) in signals.items()
        if len(reference) and not np.isnan(reference[0])
    }


def axis_metrics(time_s: FloatArray, actual: FloatArray, reference: FloatArray) -> AxisMetrics:
    """Return the figures of one axis; all arrays of shape (n,), n at least 1, equally spaced in time."""
    error = actual - reference
    steady = error[time_s > time_s[-1] - STEADY_S]
    found = moves(time_s, reference)
    counted = [move for move in found if began_at_rest(time_s, actual, move)]
    overshoots = [_overshoot(time_s, actual, move, move in counted) for move in found]
    over = [one.overshoot_percent for one in overshoots if one.overshoot_percent is not None]
    rise_s, settling_s = None, None
    for move in counted:
        if _watched_s(time_s, move) > WATCHED_S - _SPEED_OVER_S:
            passed_s, share = time_s[move.begin : move.end] - time_s[move.begin], _share(actual, move)
            rise_s, settling_s = rise_time_s(passed_s, share), settling_time_s(passed_s, share)
    return AxisMetrics(
        max(over, default=None), rise_s, settling_s,
        float(steady.mean()), _rms(error), float(np.abs(error).max()),
        float(np.median(over)) if over else None, tuple(overshoots),
    )  # fmt: skip


def began_at_rest(time_s: FloatArray, actual: FloatArray, move: Move) -> bool:
    """True if the axis was at rest at its start value when the move began; ``actual`` has shape (n,)."""
    size = abs(move.target - move.start)
    since = max(0, int(np.searchsorted(time_s, time_s[move.begin] - _SPEED_OVER_S)))
    early, late = np.array_split(actual[since : move.begin], 2)  # means: a small oscillation counts as rest
    if not early.size or not late.size:
        return abs(float(actual[move.begin - 1]) - move.start) <= SETTLED * size
    moved_s = 0.5 * float(time_s[move.begin] - time_s[since])
    error, moved = abs(float(late.mean()) - move.start), abs(float(late.mean() - early.mean()))
    return error <= SETTLED * size and moved <= AT_REST_PER_S * size * moved_s


def _overshoot(time_s: FloatArray, actual: FloatArray, move: Move, counts: bool) -> MoveMetrics:
    over = max(0.0, 100.0 * (float(_share(actual, move).max()) - 1.0)) if counts else None
    return MoveMetrics(float(time_s[move.begin]), _watched_s(time_s, move), move.target - move.start, over)


def _share(actual: FloatArray, move: Move) -> FloatArray:
    return (actual[move.begin : move.end] - move.start) / (move.target - move.start)


def _watched_s(time_s: FloatArray, move: Move) -> float:
    return float(time_s[move.end - 1] - time_s[move.begin])


def moves(time_s: FloatArray, reference: FloatArray) -> list[Move]:
    """Return the moves of a reference, shape (n,), in order of time."""
    changes = np.flatnonzero(np.diff(reference) != 0.0) + 1
    edges = [0, *changes.tolist(), len(reference)]
    step_s = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 0.0
    shortest = HOLD_S / step_s if step_s > 0.0 else 0.0
    # the first is a hold however short it is: a flight begins at rest
    holds = [(a, b) for a, b in itertools.pairwise(edges) if a == 0 or b - a >= shortest]
    found = []
    for (_, begin), (arrived, end) in itertools.pairwise(holds):
        start, target = float(reference[begin - 1]), float(reference[arrived])
        if abs(target - start) > _SMALLEST_MOVE:
            found.append(Move(begin, end, start, target))
    return found


def rise_time_s(time_s: FloatArray, share: FloatArray) -> float | None:
    """Return the time from the first passage of 10 % to that of 90 %; None where one is not reached."""
    low, high = _first_passage_s(time_s, share, LOW), _first_passage_s(time_s, share, HIGH)
    return None if low is None or high is None else high - low


def _first_passage_s(time_s: FloatArray, share: FloatArray, level: float) -> float | None:
    above = np.flatnonzero(share >= level)
    if not len(above):
        return None
    return _crossing_s(time_s, share, int(above[0]), level)


def _crossing_s(time_s: FloatArray, share: FloatArray, after: int, level: float) -> float:
    """Time between ticks ``after`` − 1 and ``after`` at which a straight line passes ``level``."""
    if after == 0:
        return float(time_s[0])
    low, high = float(share[after - 1]), float(share[after])
    part = (level - low) / (high - low)
    return float(time_s[after - 1] + part * (time_s[after] - time_s[after - 1]))


def settling_time_s(time_s: FloatArray, share: FloatArray) -> float | None:
    """Return the time from which the response stays within 2 % of 1; None if it ends outside."""
    outside = np.flatnonzero(np.abs(share - 1.0) > SETTLED)
    if not len(outside):
        return 0.0
    last = int(outside[-1])
    if last + 1 == len(share):
        return None
    edge = 1.0 + SETTLED if share[last] > 1.0 else 1.0 - SETTLED
    return _crossing_s(time_s, share, last + 1, edge)


def path_metrics(recording: Recording) -> PathMetrics | None:
    """Return the figures of the path in XY; None if the trajectory does not control the position."""
    here, there = recording.position_ned_m[:, :2], recording.reference[:, :2]
    if not len(there) or np.isnan(there[0, 0]):
        return None
    error = np.linalg.norm(here - there, axis=1)
    distance = _distance_from_path(recording, there)
    beyond = np.maximum(here - there.max(axis=0), there.min(axis=0) - here).max()
    return PathMetrics(
        _rms(error), float(error.max()), _rms(distance), float(distance.max()), max(0.0, float(beyond))
    )


def _distance_from_path(recording: Recording, there: FloatArray) -> FloatArray:
    """Distance of the flight, every 40 ms, from the polyline of its whole reference."""
    here = recording.position_ned_m[:: max(1, round(_PATH_EVERY_S * recording.case.inner_hz)), None, :2]
    corners = _polyline(there)
    nearest: FloatArray = np.linalg.norm(here[:, 0] - corners[0], axis=1)
    if len(corners) > 1:
        begin, along = corners[:-1], np.diff(corners, axis=0)
        away = here - begin  # (points, segments, 2)
        share = np.clip((away * along).sum(axis=2) / (along * along).sum(axis=1), 0.0, 1.0)
        away -= share[:, :, None] * along
        nearest = np.sqrt((away * away).sum(axis=2).min(axis=1))
    return nearest


def _polyline(points: FloatArray) -> FloatArray:
    """Distinct corners of the path: one every 5 cm, and one at each rest."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    moved = np.flatnonzero(lengths > 0.0)  # the path moves from point i to i + 1
    if not len(moved):
        return points[:1]
    mark = np.floor(np.cumsum(lengths[moved]) / _SPACING_M)
    new_mark = np.diff(mark, prepend=-1.0) > 0.0
    rests = np.diff(moved, append=len(points)) > 1
    return np.vstack((points[:1], points[moved[new_mark | rests] + 1]))


def effort(recording: Recording) -> Effort:
    """Return the load of the rotors."""
    status, torque = recording.status, recording.wrench[:, 1:]
    shares = {name: 100.0 * float(((status & bit) != 0).mean()) for name, bit in _BITS.items()}
    roll, pitch, yaw = (_rms(torque[:, axis]) for axis in range(3))
    return Effort(shares, (roll, pitch, yaw))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values * values)))

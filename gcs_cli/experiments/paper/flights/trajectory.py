"""Desired trajectories: moves of the axes, added up, read from TOML and sampled with their derivatives. Pure.

A file has a description, a duration, a ``kind`` (position, or attitude for the inner loop alone)
and moves. A move begins at ``at_s``, takes ``over_s``, and displaces each axis that it names; displacements of moves
that overlap add up. Its shape is one of

* step: at once; the reference has no rate, however far it jumps,
* ramp: at a constant rate; the reference jumps in its rate,
* smooth: the least jerk on the way, a polynomial of the fifth degree that begins and ends at rest,
* sine, cosine: A sin φ and A (1 − cos φ), φ running smoothly through ``cycles`` turns; both together are a circle.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import SETPOINT_SIZE, FloatArray
from flightstack.core.errors import ConfigError
from flightstack.params.toml_file import Table, read_toml

FOLDER = Path(__file__).parent / "trajectories"
SHAPES = ("step", "ramp", "smooth", "sine", "cosine")
POSITION, ATTITUDE = "position", "attitude"

MODEL_RAD_S, MODEL_DAMPING, MODEL_M_S2 = 3.0, 1.0, 4.5
"""The reference model: natural frequency, damping, and the most that it accelerates, horizontally and vertically."""

_LONGEST_S = 600.0
_FARTHEST_M, _FARTHEST_DEG = 1e3, 3600.0
_SAME_TIME_S = 1e-9
_LENGTHS = {"north_m": ("north", 1.0), "east_m": ("east", 1.0), "up_m": ("down", -1.0)}
_ANGLES = {
    name: (name.removesuffix("_deg"), math.radians(1.0)) for name in ("roll_deg", "pitch_deg", "yaw_deg")
}
_AXES = {POSITION: ("north", "east", "down", "yaw"), ATTITUDE: ("roll", "pitch", "yaw")}


class Move(NamedTuple):
    """One axis displaced in one stretch of time."""

    axis: str
    """north, east, down [m], roll, pitch or yaw [rad]."""
    shape: str
    at_s: float
    over_s: float
    by: float
    """Displacement at the end, or amplitude of a wave."""
    cycles: float = 1.0


class Trajectory(NamedTuple):
    """The reference of a flight; all axes begin at zero."""

    name: str
    description: str
    kind: str
    duration_s: float
    moves: tuple[Move, ...]

    @property
    def axes(self) -> tuple[str, ...]:
        """The controlled axes, in the order of the columns of ``sample``."""
        return _AXES[self.kind]


class Sampled(NamedTuple):
    """A trajectory at n times: arrays of shape (n, axes)."""

    value: FloatArray
    rate: FloatArray
    acceleration: FloatArray


def trajectory_names() -> list[str]:
    """Return the names of the built-in trajectories."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_trajectory(name_or_path: str) -> Trajectory:
    """Read a trajectory by its name or by the path of a TOML file; raise ConfigError."""
    path = Path(name_or_path)
    if not path.suffix:
        if name_or_path not in trajectory_names():
            raise ConfigError(
                name_or_path, "", f"is no trajectory; there are {', '.join(trajectory_names())}"
            )
        path = FOLDER / f"{name_or_path}.toml"
    table = read_toml(path)
    kind = table.choice("kind", (POSITION, ATTITUDE))
    trajectory = Trajectory(
        path.stem,
        table.text("description"),
        kind,
        table.number("duration_s", 0.01, _LONGEST_S),
        tuple(move for entry in table.tables("move") for move in _moves(entry, kind)),
    )
    table.finish()
    return trajectory


def _moves(table: Table, kind: str) -> list[Move]:
    """Read one table: a move for each axis that it names."""
    shape = table.choice("shape", SHAPES)
    at_s = table.number("at_s", 0.0, _LONGEST_S)
    over_s = 0.0 if shape == "step" else table.number("over_s", 1e-3, _LONGEST_S)
    cycles = table.number("cycles", 1e-3, 1e3, 1.0) if shape in ("sine", "cosine") else 1.0
    moves = []
    for names, farthest in ((_LENGTHS, _FARTHEST_M), (_ANGLES, _FARTHEST_DEG)):
        for key, (axis, unit) in names.items():
            if axis in _AXES[kind] and table.has(key):
                by = unit * table.number(key, -farthest, farthest)
                moves.append(Move(axis, shape, at_s, over_s, by, cycles))
    table.finish()
    return moves


def sample(trajectory: Trajectory, time_s: FloatArray, scale: float = 1.0) -> Sampled:
    """Return value, rate and acceleration of all axes, times ``scale``, at the times of shape (n,).

    A step has neither rate nor acceleration; a ramp has no acceleration.
    """
    shape = (len(time_s), len(trajectory.axes))
    total = Sampled(np.zeros(shape), np.zeros(shape), np.zeros(shape))
    for move in trajectory.moves:
        column = trajectory.axes.index(move.axis)
        for sums, part in zip(total, _displacement(move, time_s), strict=True):
            sums[:, column] += scale * part
    return total


def _displacement(move: Move, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    passed = time_s - move.at_s
    if move.shape == "step":
        zero = np.zeros_like(passed)
        return np.where(passed >= -_SAME_TIME_S, move.by, 0.0), zero, zero
    share = np.clip(passed / move.over_s, 0.0, 1.0)
    under_way = (passed >= -_SAME_TIME_S) & (passed < move.over_s - _SAME_TIME_S)
    if move.shape == "ramp":
        rate = np.where(under_way, move.by / move.over_s, 0.0)
        return move.by * share, rate, np.zeros_like(passed)
    progress, speed, push = _least_jerk(share, move.over_s)
    if move.shape == "smooth":
        return move.by * progress, move.by * speed, move.by * push
    return _wave(move, progress, speed, push)


def _least_jerk(share: FloatArray, over_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Progress from 0 to 1 with the least jerk, and its derivatives; at rest at both ends."""
    s = share
    progress = s**3 * (10.0 + s * (6.0 * s - 15.0))
    speed = 30.0 * (s * (1.0 - s)) ** 2 / over_s
    push = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / over_s**2
    return progress, speed, push


def _wave(
    move: Move, progress: FloatArray, speed: FloatArray, push: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    turn = 2.0 * math.pi * move.cycles
    phase, phase_rate, phase_push = turn * progress, turn * speed, turn * push
    sin, cos = np.sin(phase), np.cos(phase)
    if move.shape == "sine":
        curve = cos * phase_push - sin * phase_rate**2
        return move.by * sin, move.by * cos * phase_rate, move.by * curve
    curve = sin * phase_push + cos * phase_rate**2
    return move.by * (1.0 - cos), move.by * sin * phase_rate, move.by * curve


def setpoints(trajectory: Trajectory, time_s: FloatArray, scale: float = 1.0) -> FloatArray:
    """Return the array forms of ``PositionSetpoint`` along a position trajectory, shape (n, 11)."""
    at = sample(trajectory, time_s, scale)
    rows = np.zeros((len(time_s), SETPOINT_SIZE))
    rows[:, 0:3], rows[:, 3:6], rows[:, 6:9] = at.value[:, :3], at.rate[:, :3], at.acceleration[:, :3]
    rows[:, 9], rows[:, 10] = at.value[:, 3], at.rate[:, 3]
    return rows


def shaped_setpoints(trajectory: Trajectory, time_s: FloatArray, scale: float = 1.0) -> FloatArray:
    """Return setpoints whose position follows the trajectory's through the reference model, shape (n, 11).

    This project's own gains are designed for them: a step becomes a path with velocity and acceleration feedforward.
    ``time_s`` is equally spaced; the heading is not shaped.
    """
    rows = setpoints(trajectory, time_s, scale)
    step_s = float(time_s[1] - time_s[0]) if len(time_s) > 1 else 0.0
    position, velocity = rows[0, 0:3].copy(), np.zeros(3)
    for row in rows:
        wanted = MODEL_RAD_S**2 * (row[0:3] - position) - 2.0 * MODEL_DAMPING * MODEL_RAD_S * velocity
        wanted[:2] *= min(1.0, MODEL_M_S2 / max(float(np.linalg.norm(wanted[:2])), MODEL_M_S2))
        wanted[2] = min(max(float(wanted[2]), -MODEL_M_S2), MODEL_M_S2)
        row[0:3], row[3:6], row[6:9] = position, velocity, wanted
        velocity = velocity + step_s * wanted
        position = position + step_s * velocity
    return rows

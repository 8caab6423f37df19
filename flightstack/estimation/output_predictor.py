"""The output at the rate of the IMU: integrates each sample and follows the filter, which is late by its delay."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import (
    conjugate,
    cross,
    quaternion_product,
    rotate,
    rotation_over,
    rotation_vector,
)
from flightstack.estimation.error_state import read_vector, write_vector
from flightstack.estimation.prediction import Motion
from flightstack.estimation.rings import IMU_RING, IMU_ROWS, Rings, count_of, oldest_slot, slot_of


@compiled
def read_motion(row: FloatArray) -> Motion:
    """Read a row of the track, shape (11,): time, attitude, velocity, position."""
    return Motion(Quaternion(row[1], row[2], row[3], row[4]), read_vector(row, 5), read_vector(row, 8))


@compiled
def write_motion(row: FloatArray, time_s: float, motion: Motion) -> None:
    """Write a row of the track."""
    q = motion.attitude
    row[0], row[1], row[2], row[3], row[4] = time_s, q.w, q.x, q.y, q.z
    write_vector(row, 5, motion.velocity_ned_m_s)
    write_vector(row, 8, motion.position_ned_m)


class _Change(NamedTuple):
    """Change of the filter's state that a row of the track follows."""

    turn: Quaternion
    north: Vector3
    """The rows of the matrix of that rotation."""
    east: Vector3
    down: Vector3
    speed_m_s: Vector3
    """The new velocity less the old one turned."""
    before_m: Vector3
    """Position."""
    after_m: Vector3
    start_s: float
    """Time of the state."""


@compiled
def _turned_by(c: _Change, x: float, y: float, z: float) -> Vector3:
    return Vector3(
        c.north.x * x + c.north.y * y + c.north.z * z,
        c.east.x * x + c.east.y * y + c.east.z * z,
        c.down.x * x + c.down.y * y + c.down.z * z,
    )


@compiled
def _change(turn: Quaternion, before: Motion, after: Motion, start_s: float) -> _Change:
    """Return the change from a state to another one that is turned by ``turn``."""
    x = rotate(turn, Vector3(1.0, 0.0, 0.0))
    y = rotate(turn, Vector3(0.0, 1.0, 0.0))
    z = cross(x, y)
    u, v = rotate(turn, before.velocity_ned_m_s), after.velocity_ned_m_s
    return _Change(
        turn,
        Vector3(x.x, y.x, z.x),
        Vector3(x.y, y.y, z.y),
        Vector3(x.z, y.z, z.z),
        Vector3(v.x - u.x, v.y - u.y, v.z - u.z),
        before.position_ned_m,
        after.position_ned_m,
        start_s,
    )


@compiled
def _replayed(row: FloatArray, c: _Change, gravity: float) -> None:
    """Move a row that followed from the state before the change so that it follows from the one after it.

    Its specific force turns too; free fall does not.
    """
    late, age_s = read_motion(row), row[0] - c.start_s
    v, q = late.velocity_ned_m_s, late.position_ned_m
    before, after, u = c.before_m, c.after_m, c.speed_m_s
    fall = gravity * age_s
    drop = 0.5 * fall * age_s
    dv = _turned_by(c, v.x, v.y, v.z - fall)
    dp = _turned_by(c, q.x - before.x, q.y - before.y, q.z - before.z - drop)
    velocity = Vector3(u.x + dv.x, u.y + dv.y, u.z + dv.z + fall)
    place = Vector3(
        after.x + u.x * age_s + dp.x, after.y + u.y * age_s + dp.y, after.z + u.z * age_s + dp.z + drop
    )
    write_motion(row, row[0], Motion(quaternion_product(c.turn, late.attitude), velocity, place))


@compiled
def follow(rings: Rings, output: FloatArray, target: Motion, share: float, gravity: float) -> None:
    """Move the output and the track by ``share`` of the filter's difference to the track's oldest row.

    ``target`` is the filter's state at the time of that row. Times after it are corrected for the effect of the
    difference until then.
    """
    oldest = rings.track[oldest_slot(rings, IMU_RING)]
    start, start_s = read_motion(oldest), oldest[0]
    turn = rotation_vector(quaternion_product(target.attitude, conjugate(start.attitude)))
    correction = rotation_over(turn, share)
    after = Motion(
        quaternion_product(correction, start.attitude),
        _between(start.velocity_ned_m_s, target.velocity_ned_m_s, share),
        _between(start.position_ned_m, target.position_ned_m, share),
    )
    change = _change(correction, start, after, start_s)
    for number in range(IMU_ROWS):
        if number >= count_of(rings, IMU_RING):
            break
        row = rings.track[slot_of(rings, IMU_RING, IMU_ROWS, number)]
        _replayed(row, change, gravity)
    _replayed(output, change, gravity)


@compiled
def _between(a: Vector3, b: Vector3, share: float) -> Vector3:
    return Vector3(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.z + share * (b.z - a.z))

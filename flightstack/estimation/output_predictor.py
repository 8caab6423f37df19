"""The output at the rate of the IMU: integrates each sample and follows the filter, which is late by its delay."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import conjugate, quaternion_product, rotate, rotation_over, rotation_vector
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


@compiled
def _replayed(
    row: FloatArray, correction: Quaternion, before: Motion, after: Motion, gravity: float, start_s: float
) -> None:
    """Move a row that followed from ``before`` so that it follows from ``after``: its specific force turns too."""
    late, age_s = read_motion(row), row[0] - start_s
    u, v = before.velocity_ned_m_s, late.velocity_ned_m_s
    p, q = before.position_ned_m, late.position_ned_m
    fall = gravity * age_s
    dv = rotate(correction, Vector3(v.x - u.x, v.y - u.y, v.z - u.z - fall))
    dp = rotate(
        correction,
        Vector3(q.x - p.x - u.x * age_s, q.y - p.y - u.y * age_s, q.z - p.z - (u.z + 0.5 * fall) * age_s),
    )
    u, p = after.velocity_ned_m_s, after.position_ned_m
    velocity = Vector3(u.x + dv.x, u.y + dv.y, u.z + dv.z + fall)
    place = Vector3(
        p.x + u.x * age_s + dp.x, p.y + u.y * age_s + dp.y, p.z + (u.z + 0.5 * fall) * age_s + dp.z
    )
    write_motion(row, row[0], Motion(quaternion_product(correction, late.attitude), velocity, place))


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
    for number in range(IMU_ROWS):
        if number >= count_of(rings, IMU_RING):
            break
        row = rings.track[slot_of(rings, IMU_RING, IMU_ROWS, number)]
        _replayed(row, correction, start, after, gravity, start_s)
    _replayed(output, correction, start, after, gravity, start_s)


@compiled
def _between(a: Vector3, b: Vector3, share: float) -> Vector3:
    return Vector3(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.z + share * (b.z - a.z))

"""The output at the rate of the IMU: integrates each sample and follows the filter, which is late by its delay."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Quaternion, Vector3
from flightstack.core.geometry import conjugate, cross, quaternion_product, rotation_vector
from flightstack.estimation.error_state import read_vector, scaled, sum_of, turned, write_vector
from flightstack.estimation.prediction import Motion
from flightstack.estimation.rings import IMU_RING, IMU_ROWS, Rings, slot_of


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
def _shifted(
    late: Motion, error: Motion, turn: Vector3, start: Motion, age_s: float, gravity: float
) -> Motion:
    """Return ``late``, ``age_s`` after ``start``, corrected for an error of ``start``.

    An error of attitude turns the specific force since ``start``, and so the change of velocity and position.
    """
    fall = gravity * age_s
    dv = Vector3(
        late.velocity_ned_m_s.x - start.velocity_ned_m_s.x,
        late.velocity_ned_m_s.y - start.velocity_ned_m_s.y,
        late.velocity_ned_m_s.z - start.velocity_ned_m_s.z - fall,
    )
    dp = Vector3(
        late.position_ned_m.x - start.position_ned_m.x - start.velocity_ned_m_s.x * age_s,
        late.position_ned_m.y - start.position_ned_m.y - start.velocity_ned_m_s.y * age_s,
        late.position_ned_m.z
        - start.position_ned_m.z
        - start.velocity_ned_m_s.z * age_s
        - 0.5 * fall * age_s,
    )
    velocity = sum_of(error.velocity_ned_m_s, cross(turn, dv))
    position = sum_of(sum_of(error.position_ned_m, scaled(error.velocity_ned_m_s, age_s)), cross(turn, dp))
    return Motion(
        turned(late.attitude, turn),
        sum_of(late.velocity_ned_m_s, velocity),
        sum_of(late.position_ned_m, position),
    )


@compiled
def follow(rings: Rings, output: FloatArray, target: Motion, share: float, gravity: float) -> None:
    """Move the output and the track by ``share`` of the filter's difference to the track's oldest row.

    ``target`` is the filter's state at the time of that row. Times after it are corrected for the effect of the
    difference until then.
    """
    oldest = rings.track[slot_of(rings, IMU_RING, IMU_ROWS, 0)]
    start, start_s = read_motion(oldest), oldest[0]
    turn = scaled(rotation_vector(quaternion_product(target.attitude, conjugate(start.attitude))), share)
    error = Motion(
        target.attitude,
        scaled(sum_of(target.velocity_ned_m_s, scaled(start.velocity_ned_m_s, -1.0)), share),
        scaled(sum_of(target.position_ned_m, scaled(start.position_ned_m, -1.0)), share),
    )
    for number in range(IMU_ROWS):
        if number >= rings.cursors[IMU_RING, 1]:
            break
        row = rings.track[slot_of(rings, IMU_RING, IMU_ROWS, number)]
        write_motion(row, row[0], _shifted(read_motion(row), error, turn, start, row[0] - start_s, gravity))
    age_s = output[0] - start_s
    write_motion(output, output[0], _shifted(read_motion(output), error, turn, start, age_s, gravity))

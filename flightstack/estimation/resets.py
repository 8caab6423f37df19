"""Resets: a part of the state is set to a measurement, and its change is counted for guidance and position control."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, Vector3
from flightstack.estimation.error_state import GNSS_BIAS, POSITION, VELOCITY
from flightstack.estimation.fusion import horizontal_accuracy, speed_accuracy, vertical_accuracy
from flightstack.estimation.kalman import Filter, reset_variance
from flightstack.estimation.memory import POSITION_RESET, VELOCITY_RESET, YAW_RESET

_LEAST_POSITION_M, _LEAST_SPEED_M_S = 0.5, 0.3


@compiled
def reset_velocity(m: Record, f: Filter, row: FloatArray, first: int, count: int) -> None:
    """Set ``count`` axes of the velocity from ``first`` to a GNSS measurement."""
    resets, speed_m_s = m["resets"], max(speed_accuracy(row), _LEAST_SPEED_M_S)
    resets[VELOCITY_RESET] += 1.0
    for axis in range(3):
        resets[VELOCITY_RESET + 1 + axis] = 0.0
    for axis in range(first, first + count):
        resets[VELOCITY_RESET + 1 + axis] = row[4 + axis] - f.nominal[4 + axis]
        f.nominal[4 + axis], m["refused_s"][axis] = row[4 + axis], 0.0
    reset_variance(f.covariance, VELOCITY + first, count, speed_m_s * speed_m_s)


@compiled
def reset_position(m: Record, f: Filter, row: FloatArray, first: int, count: int) -> None:
    """Set ``count`` axes of the position from ``first`` to a GNSS measurement."""
    resets, accuracy_m = m["resets"], vertical_accuracy(row) if first == 2 else horizontal_accuracy(row)
    accuracy_m = max(accuracy_m, _LEAST_POSITION_M)
    age_s = f.clock[0] - row[0]
    resets[POSITION_RESET] += 1.0
    for axis in range(3):
        resets[POSITION_RESET + 1 + axis] = 0.0
    for axis in range(first, first + count):
        now_m = row[1 + axis] + age_s * f.nominal[4 + axis]
        resets[POSITION_RESET + 1 + axis] = now_m - f.nominal[7 + axis]
        f.nominal[7 + axis], f.nominal[25 + axis], m["refused_s"][3 + axis] = now_m, 0.0, 0.0
    reset_variance(f.covariance, POSITION + first, count, accuracy_m * accuracy_m)
    reset_variance(f.covariance, GNSS_BIAS + first, count, 1e-4)


@compiled
def count_correction(m: Record, f: Filter, position_m: Vector3, velocity_m_s: Vector3) -> None:
    """Count the horizontal change from an earlier position and velocity as resets of both."""
    resets, x = m["resets"], f.nominal
    resets[POSITION_RESET] += 1.0
    resets[POSITION_RESET + 1], resets[POSITION_RESET + 2] = x[7] - position_m.x, x[8] - position_m.y
    resets[VELOCITY_RESET] += 1.0
    resets[VELOCITY_RESET + 1], resets[VELOCITY_RESET + 2] = x[4] - velocity_m_s.x, x[5] - velocity_m_s.y
    resets[POSITION_RESET + 3], resets[VELOCITY_RESET + 3] = 0.0, 0.0


@compiled
def count_yaw_reset(m: Record, turn_rad: float) -> None:
    """Count a change of the yaw."""
    m["resets"][YAW_RESET] += 1.0
    m["resets"][YAW_RESET + 1] = turn_rad


@compiled
def count_of_resets(m: Record) -> float:
    """Return the number of resets of any kind."""
    total: float = m["resets"][POSITION_RESET] + m["resets"][VELOCITY_RESET] + m["resets"][YAW_RESET]
    return total

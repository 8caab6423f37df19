"""Resets: a part of the state is set to a measurement, and its change is counted for guidance and position control."""

from __future__ import annotations

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.estimation.error_state import GNSS_BIAS, POSITION, VELOCITY
from flightstack.estimation.fusion import horizontal_accuracy, speed_accuracy, vertical_accuracy
from flightstack.estimation.kalman import Filter, reset_variance
from flightstack.estimation.memory import MemoryRecord, ResetRecord

_LEAST_POSITION_M, _LEAST_SPEED_M_S = 0.5, 0.3


@compiled
def reset_velocity(m: MemoryRecord, f: Filter, row: FloatArray, first: int, count: int) -> None:
    """Set ``count`` axes of the velocity from ``first`` to a GNSS measurement."""
    speed_m_s = max(speed_accuracy(row), _LEAST_SPEED_M_S)
    reset = m["resets"]["velocity"]
    _count(reset, f.clock[0])
    for axis in range(first, first + count):
        _add_change(reset, axis, row[4 + axis] - f.nominal[4 + axis])
        f.nominal[4 + axis], m["refused_s"][axis] = row[4 + axis], 0.0
    reset_variance(f.covariance, VELOCITY + first, count, speed_m_s * speed_m_s)


@compiled
def reset_position(m: MemoryRecord, f: Filter, row: FloatArray, first: int, count: int) -> None:
    """Set ``count`` axes of the position from ``first`` to a GNSS measurement."""
    accuracy_m = vertical_accuracy(row) if first == 2 else horizontal_accuracy(row)
    accuracy_m = max(accuracy_m, _LEAST_POSITION_M)
    age_s = f.clock[0] - row[0]
    reset = m["resets"]["position"]
    _count(reset, f.clock[0])
    for axis in range(first, first + count):
        now_m = row[1 + axis] + age_s * f.nominal[4 + axis]
        _add_change(reset, axis, now_m - f.nominal[7 + axis])
        f.nominal[7 + axis], f.nominal[25 + axis], m["refused_s"][3 + axis] = now_m, 0.0, 0.0
    reset_variance(f.covariance, POSITION + first, count, accuracy_m * accuracy_m)
    reset_variance(f.covariance, GNSS_BIAS + first, count, 1e-4)


@compiled
def count_correction(
    m: MemoryRecord, f: Filter, north_m: float, east_m: float, north_m_s: float, east_m_s: float
) -> None:
    """Count a horizontal change of position and velocity as resets of both."""
    position, velocity = m["resets"]["position"], m["resets"]["velocity"]
    _count(position, f.clock[0])
    _count(velocity, f.clock[0])
    _add_change(position, 0, north_m)
    _add_change(position, 1, east_m)
    _add_change(velocity, 0, north_m_s)
    _add_change(velocity, 1, east_m_s)


@compiled
def _count(reset: ResetRecord, now_s: float) -> None:
    """Count a reset of position or velocity; the changes of one step of the filter are added up."""
    reset["number"] += 1.0
    if reset["time_s"] != now_s:
        reset["time_s"] = now_s
        for axis in range(3):
            reset["change"][axis] = 0.0


@compiled
def _add_change(reset: ResetRecord, axis: int, change: float) -> None:
    reset["change"][axis] += change
    reset["sum"][axis] += change


@compiled
def count_yaw_reset(m: MemoryRecord, turn_rad: float) -> None:
    """Count a change of the yaw."""
    reset = m["resets"]["yaw"]
    reset["number"] += 1.0
    reset["change_rad"] = turn_rad
    reset["sum_rad"] += turn_rad


@compiled
def count_of_resets(m: MemoryRecord) -> float:
    """Return the number of resets of any kind."""
    resets = m["resets"]
    total: float = resets["position"]["number"] + resets["velocity"]["number"] + resets["yaw"]["number"]
    return total

"""Figures of a flight beside the tracking error: attitude error, control effort, overshoot at waypoints. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geometry_bulk import quaternions_from_euler
from gcs_cli.report.flight_data import Flight, Series, series

_LEAST_LEG_M = 0.1
_ONWARD = math.cos(math.radians(80.0))
"""Cosine of the largest turn after which a path still goes on beyond a waypoint."""


class Visit(NamedTuple):
    """An item with a position, current from ``begin_s`` on."""

    begin_s: float
    seq: int


def attitude_errors_rad(flight: Flight) -> Series:
    """Setpoint minus attitude in roll, pitch and yaw [rad], −π to π, while flying, shape (n, 3)."""
    time_s, target, actual = _attitude_pairs(flight)
    return series(time_s, np.remainder(target - actual + math.pi, 2.0 * math.pi) - math.pi)


def attitude_error(flight: Flight) -> Series:
    """Angle [rad] between attitude and attitude setpoint while flying, shape (n, 1), at the times of the setpoint."""
    time_s, *pair = _attitude_pairs(flight)
    wanted, is_ = (quaternions_from_euler(euler) for euler in pair)
    chord = np.minimum(np.linalg.norm(wanted - is_, axis=1), np.linalg.norm(wanted + is_, axis=1))
    angle = 4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))  # |q1 - q2| = 2 sin(angle / 4)
    finite = np.isfinite(angle)
    return series(time_s[finite], angle[finite][:, None])


def _attitude_pairs(flight: Flight) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times while flying, attitude setpoints then and the newest attitudes, Euler angles [rad] (n, 3)."""
    time_s, target = flight.attitude_target
    if not len(time_s) or not len(flight.attitude.time_s):
        return np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3))
    at = np.searchsorted(flight.attitude.time_s, time_s, side="right") - 1
    kept = (at >= 0) & flight.flying(time_s)
    return time_s[kept], target[kept], flight.attitude.values[at[kept]]


def rms(values: FloatArray) -> float | None:
    """Root mean square of all values; None of none."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else None


def rms_torque_n_m(flight: Flight) -> list[float] | None:
    """Root mean square of the torque asked for about x, y and z of the body, in flight."""
    time_s, torque = flight.torque
    torque = torque[flight.flying(time_s) & np.isfinite(torque).all(axis=1)]
    return [float(value) for value in np.sqrt(np.mean(np.square(torque), axis=0))] if len(torque) else None


def rms_command_rate_rad_s2(flight: Flight) -> float | None:
    """Root mean square, over rotors and time in flight, of how fast the commanded rotor speeds change [rad/s²]."""
    time_s, command = flight.rotor_command
    if len(time_s) < 2:
        return None
    step_s = np.diff(time_s)
    kept = flight.flying(time_s)
    kept = kept[1:] & kept[:-1] & (step_s > 0.0)
    rate = np.diff(command, axis=0)[kept] / step_s[kept, None]
    return rms(rate[np.isfinite(rate).all(axis=1)])


def overshoots_m(flight: Flight, places: Mapping[int, FloatArray]) -> dict[int, float]:
    """Return by item how far [m] the vehicle flew beyond it, along the direction of the leg that led to it.

    The largest of all visits; 0 where the vehicle never passed the item. A visit lasts from when the item is current
    until the vehicle, on its way to the next one, no longer moves in the leg's direction, or has reached the next one.
    Items are left out that no leg leads to, and those after which the path goes on beyond them. ``places``: positions
    NED [m] of items.
    """
    time_s, position = flight.position
    flying = flight.flying(time_s) & np.isfinite(position).all(axis=1)
    time_s, position = time_s[flying], position[flying]
    if not len(time_s):
        return {}
    visits, end_s = _visits(flight, places)
    targets = [position[0], *(places[visit.seq] for visit in visits)]
    begins = [*(visit.begin_s for visit in visits), end_s, math.inf]
    found: dict[int, float] = {}
    for index, visit in enumerate(visits):
        leg, onward = targets[index + 1] - targets[index], _after(targets, index + 1)
        length = float(np.linalg.norm(leg))
        if length < _LEAST_LEG_M or (onward is not None and float(onward @ leg) > _ONWARD * length):
            continue
        first, left, last = np.searchsorted(time_s, begins[index : index + 3])
        beyond = (position[first:last] - targets[index + 1]) @ (leg / length)
        returning = np.flatnonzero(np.diff(beyond[left - first :]) <= 0.0)
        end = left - first + 1 + int(returning[0]) if len(returning) else len(beyond)
        found[visit.seq] = max(found.get(visit.seq, 0.0), float(beyond[:end].max(initial=0.0)))
    return found


def _visits(flight: Flight, places: Mapping[int, FloatArray]) -> tuple[list[Visit], float]:
    """Return the visits to items with a place, in order, and when the mission ended."""
    visits: list[Visit] = []
    for progress in flight.mission:
        if progress.finished:
            return visits, progress.time_s
        if progress.current in places and (not visits or visits[-1].seq != progress.current):
            visits.append(Visit(progress.time_s, progress.current))
    return visits, math.inf


def _after(targets: Sequence[FloatArray], index: int) -> FloatArray | None:
    """Return the direction of the leg after target ``index``, of length 1; None if there is none."""
    for target in targets[index + 1 : index + 2]:
        leg = target - targets[index]
        length = float(np.linalg.norm(leg))
        return leg / length if length >= _LEAST_LEG_M else None
    return None

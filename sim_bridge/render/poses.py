"""A flight interpolated between its samples: pose at any time, and the trail."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geometry_bulk import heading_from_quaternions
from flightstack.flight_log.poses_file import Poses

_SMOOTH_S = 0.9
"""Half the width of the window over which the chase camera averages the heading."""
_TRAIL_STEP_M = 0.02
_TRAIL_MISS_M = 0.003
_TRAIL_LONGEST_M = 0.5
"""Largest distance from the flown path, and largest length, of a segment of the trail."""
_TRAIL_SAMPLES = 20_000  # examined, which bounds the start-up time of a long flight
MOST_TRAIL = 1500
"""Points of the trail that is drawn."""


class Moment(NamedTuple):
    """The vehicle at one time: NED, FRD, SI; rotor angles [rad] are integrals of the absolute speeds."""

    time_s: float
    position_ned_m: tuple[float, float, float]
    attitude: tuple[float, float, float, float]
    speed_m_s: float
    heading_rad: float
    chase_heading_rad: float
    rotor_speed_rad_s: tuple[float, ...]
    rotor_angle_rad: tuple[float, ...]
    target_ned_m: tuple[float, float, float] | None


class FlightPath:
    """Poses as functions of time, constant before the first and after the last one."""

    def __init__(self, poses: Poses) -> None:
        self.poses = poses
        self.begin_s, self.end_s = float(poses.time_s[0]), float(poses.time_s[-1])
        self._attitude = _continuous(poses.attitude)
        self._speed_m_s = _speed(poses.time_s, poses.position_ned_m)
        self._heading = np.unwrap(heading_from_quaternions(poses.attitude))
        self._chase = _smoothed(poses.time_s, self._heading)
        self._angle = _integral(poses.time_s, np.nan_to_num(np.abs(poses.rotor_speed_rad_s)))
        self._trail = _thinned(poses.position_ned_m)
        points = np.vstack((poses.position_ned_m, poses.waypoints_ned_m))
        self.low_ned_m, self.high_ned_m = points.min(axis=0), points.max(axis=0)

    def at(self, time_s: float) -> Moment:
        """Return the moment at ``time_s`` by linear interpolation."""
        poses = self.poses
        position = self._row(poses.position_ned_m, time_s)
        w, x, y, z = self._row(self._attitude, time_s)
        length = math.sqrt(w * w + x * x + y * y + z * z) or 1.0
        target = self._row(poses.target_ned_m, time_s)
        return Moment(
            time_s,
            (position[0], position[1], position[2]),
            (w / length, x / length, y / length, z / length),
            float(np.interp(time_s, poses.time_s, self._speed_m_s)),
            float(np.interp(time_s, poses.time_s, self._heading)),
            float(np.interp(time_s, poses.time_s, self._chase)),
            self._row(poses.rotor_speed_rad_s, time_s),
            self._row(self._angle, time_s),
            (target[0], target[1], target[2]) if all(map(math.isfinite, target)) else None,
        )

    def waypoint_names(self) -> list[str]:
        """Return the names of the waypoints."""
        given = self.poses.waypoint_numbers
        return [f"{number:.0f}" for number in given] or [
            str(number) for number in range(1, 1 + len(self.poses.waypoints_ned_m))
        ]

    def trail(self, time_s: float, most: int) -> FloatArray:
        """Return the path flown until ``time_s``, NED [m], shape (n, 3), in at most ``most`` + 1 points."""
        count = int(np.searchsorted(self.poses.time_s[self._trail], time_s, side="right"))
        rows = self._trail[:count]
        if len(rows) > most:
            rows = rows[np.linspace(0, len(rows) - 1, most).astype(int)]
        return np.vstack((self.poses.position_ned_m[rows], self.at(time_s).position_ned_m))

    def _row(self, values: FloatArray, time_s: float) -> tuple[float, ...]:
        """Return a row of values (n, k), interpolated at a time."""
        times = self.poses.time_s
        after = int(np.searchsorted(times, time_s, side="right"))
        if after == 0 or after == len(times):
            return tuple(values[min(after, len(times) - 1)].tolist())
        begin, end = times[after - 1], times[after]
        share = (time_s - begin) / (end - begin)
        return tuple((values[after - 1] + share * (values[after] - values[after - 1])).tolist())


def _continuous(attitude: FloatArray) -> FloatArray:
    """Choose the sign of each quaternion that is nearer to the one before."""
    dots = np.sum(attitude[1:] * attitude[:-1], axis=1)
    signs = np.cumprod(np.where(dots < 0.0, -1.0, 1.0))
    return attitude * np.concatenate(([1.0], signs))[:, None]


def _speed(time_s: FloatArray, position: FloatArray) -> FloatArray:
    if len(time_s) < 2:
        return np.zeros(len(time_s))
    speed: FloatArray = np.linalg.norm(np.gradient(position, time_s, axis=0), axis=1)
    return speed


def _smoothed(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the mean over a window of time around each sample."""
    total = _integral(time_s, values[:, None])[:, 0]
    begin = np.maximum(time_s - _SMOOTH_S, time_s[0])
    end = np.minimum(time_s + _SMOOTH_S, time_s[-1])
    width = end - begin
    area = np.interp(end, time_s, total) - np.interp(begin, time_s, total)
    return np.where(width > 0.0, area / np.where(width > 0.0, width, 1.0), values)


def _integral(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Integrate columns (n, k) over time by trapezoids."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time_s)[:, None]
    return np.vstack((np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)))


def _thinned(position: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the indices of the samples of the trail: few on straight parts, more in curves."""
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))))
    step = max(_TRAIL_STEP_M, float(along[-1]) / _TRAIL_SAMPLES)
    near = np.unique(np.floor(along / step), return_index=True)[1]
    kept, last = [0], len(near) - 1
    for candidate in range(2, last + 1):
        begin, between = position[near[kept[-1]]], position[near[kept[-1] + 1 : candidate]]
        chord = position[near[candidate]] - begin
        offset = between - begin
        share = np.clip(offset @ chord / max(float(chord @ chord), 1e-12), 0.0, 1.0)
        miss = np.linalg.norm(offset - share[:, None] * chord, axis=1).max()
        if miss > _TRAIL_MISS_M or along[near[candidate]] - along[near[kept[-1]]] > _TRAIL_LONGEST_M:
            kept.append(candidate - 1)
    drawn: np.ndarray[tuple[int], np.dtype[np.intp]] = near[np.unique([*kept, last])]
    return drawn

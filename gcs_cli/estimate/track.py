"""Estimates over time, and the differences between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.geometry_bulk import euler_from_quaternions
from gcs_cli.estimate.log_samples import times_s, topic_of
from gcs_cli.logs.recording import Recording, Topic


@dataclass(frozen=True, eq=False)
class Track:
    """Attitude, shape (n, 4), and motion, shape (m, 3), at times [s] of their own; NED relative to ``origin``."""

    attitude_s: FloatArray
    attitude: FloatArray
    motion_s: FloatArray
    velocity_m_s: FloatArray
    position_m: FloatArray
    origin: GeoPoint | None


@dataclass(frozen=True, eq=False)
class Differences:
    """One estimate minus another: angles [deg] at ``attitude_s``, velocity and position at ``motion_s``."""

    attitude_s: FloatArray
    roll_deg: FloatArray
    pitch_deg: FloatArray
    tilt_deg: FloatArray
    yaw_deg: FloatArray
    motion_s: FloatArray
    velocity_m_s: FloatArray
    position_m: FloatArray
    is_geographic: bool
    """False: the positions are compared without their offset at the start, because an origin is unknown."""


def logged_track(log: Recording, suffix: str = "") -> Track | None:
    """Return the estimate in a log, or with ``suffix`` ``_groundtruth`` the truth; None if a topic is missing."""
    attitude = topic_of(log, f"vehicle_attitude{suffix}")
    motion = topic_of(log, f"vehicle_local_position{suffix}")
    if attitude is None or motion is None:
        return None
    quaternions = attitude.columns([f"q[{i}]" for i in range(4)])
    velocity, position = motion.columns(["vx", "vy", "vz"]), motion.columns(["x", "y", "z"])
    if quaternions is None or velocity is None or position is None or min(attitude.count, motion.count) < 2:
        return None
    valid = np.isfinite(quaternions).all(axis=1) & (np.abs(np.linalg.norm(quaternions, axis=1) - 1.0) < 0.1)
    origin, position = _origin(motion, position)
    return Track(
        times_s(attitude)[valid], _continuous(quaternions[valid]), times_s(motion), velocity, position, origin
    )


def _origin(motion: Topic, position: FloatArray) -> tuple[GeoPoint | None, FloatArray]:
    """Return the last origin of a local frame, and the positions relative to it."""
    places = motion.columns(["ref_lat", "ref_lon", "ref_alt"])
    if places is None or not np.isfinite(places[-1]).all() or not places[-1, :2].any():
        return None, position
    frame = LocalFrame(GeoPoint(*places[-1].tolist()))
    moved = position.copy()
    for place in np.unique(places, axis=0):
        if np.isfinite(place).all() and place[:2].any():
            moved[(places == place).all(axis=1)] += frame.to_ned(GeoPoint(*place.tolist()))
    return frame.origin, moved


def _continuous(quaternions: FloatArray) -> FloatArray:
    """Return the quaternions with signs that do not change from one to the next."""
    signs = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
    flipped: FloatArray = quaternions * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
    return flipped


def differences(estimate: Track, reference: Track, begin_s: float, end_s: float) -> Differences:
    """Return ``estimate`` minus ``reference`` between two times, at the times of the one with fewer samples."""
    attitude_s = _times(estimate.attitude_s, reference.attitude_s, begin_s, end_s)
    motion_s = _times(estimate.motion_s, reference.motion_s, begin_s, end_s)
    q, r = (_at(attitude_s, track.attitude_s, track.attitude) for track in (estimate, reference))
    q, r = q / np.linalg.norm(q, axis=1)[:, None], r / np.linalg.norm(r, axis=1)[:, None]
    error = _product(q, r * [1.0, -1.0, -1.0, -1.0])  # in world axes: tilt of the vertical, turn about it
    euler = _wrapped(euler_from_quaternions(q) - euler_from_quaternions(r))
    velocity = _at(motion_s, estimate.motion_s, estimate.velocity_m_s)
    velocity = velocity - _at(motion_s, reference.motion_s, reference.velocity_m_s)
    position = _at(motion_s, estimate.motion_s, estimate.position_m)
    position = position - _at(motion_s, reference.motion_s, reference.position_m)
    is_geographic = estimate.origin is not None and reference.origin is not None
    if estimate.origin is not None and reference.origin is not None:
        position = position + np.array(LocalFrame(reference.origin).to_ned(estimate.origin))
    elif len(position):
        position = position - position[0]
    return Differences(
        attitude_s,
        np.degrees(euler[:, 0]),
        np.degrees(euler[:, 1]),
        np.degrees(2.0 * np.arcsin(np.clip(np.hypot(error[:, 1], error[:, 2]), 0.0, 1.0))),
        np.degrees(_wrapped(2.0 * np.arctan2(error[:, 3], error[:, 0]))),
        motion_s,
        velocity,
        position,
        is_geographic,
    )


def errors_at(estimate: Track, reference: Track) -> FloatArray:
    """Return rotation vector [rad, NED], velocity and position, estimate minus reference, at ``estimate.motion_s``.

    Shape (n, 9); the times of both kinds are equal. NaN outside the time of the reference, or without its origin.
    """
    times = estimate.motion_s
    r = _at(times, reference.attitude_s, reference.attitude)
    r = r / np.linalg.norm(r, axis=1)[:, None]
    turn = _product(estimate.attitude, r * [1.0, -1.0, -1.0, -1.0])
    turn = 2.0 * turn[:, 1:] * np.where(turn[:, :1] < 0.0, -1.0, 1.0)
    velocity = estimate.velocity_m_s - _at(times, reference.motion_s, reference.velocity_m_s)
    position = estimate.position_m - _at(times, reference.motion_s, reference.position_m)
    if estimate.origin is None or reference.origin is None:
        position = np.full_like(position, np.nan)
    else:
        position = position + np.array(LocalFrame(reference.origin).to_ned(estimate.origin))
    errors = np.column_stack([turn, velocity, position])
    errors[(times < reference.motion_s[0]) | (times > reference.motion_s[-1])] = np.nan
    return errors


def _times(a: FloatArray, b: FloatArray, begin_s: float, end_s: float) -> FloatArray:
    fewer = a if len(a) <= len(b) else b
    first, last = max(begin_s, a[0], b[0]), min(end_s, a[-1], b[-1])
    times: FloatArray = fewer[(fewer >= first) & (fewer <= last)]
    return times


def _at(times: FloatArray, of: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack([np.interp(times, of, column) for column in values.T])


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    w, x, y, z = a.T
    v, i, j, k = b.T
    return np.column_stack(
        [
            w * v - x * i - y * j - z * k,
            w * i + x * v + y * k - z * j,
            w * j - x * k + y * v + z * i,
            w * k + x * j - y * i + z * v,
        ]
    )


def _wrapped(angles: Any) -> FloatArray:
    wrapped: FloatArray = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped


def summary_of(d: Differences) -> dict[str, float | None]:
    """Return root mean square and largest size of each difference; None where there is none."""
    parts = {
        "roll_deg": d.roll_deg,
        "pitch_deg": d.pitch_deg,
        "tilt_deg": d.tilt_deg,
        "yaw_deg": d.yaw_deg,
        "velocity_horizontal_m_s": np.hypot(d.velocity_m_s[:, 0], d.velocity_m_s[:, 1]),
        "velocity_vertical_m_s": d.velocity_m_s[:, 2],
        "position_horizontal_m": np.hypot(d.position_m[:, 0], d.position_m[:, 1]),
        "position_vertical_m": d.position_m[:, 2],
    }
    found: dict[str, float | None] = {}
    for name, values in parts.items():
        quantity, _, unit = name.rpartition("_m_s") if name.endswith("_m_s") else name.rpartition("_")
        unit = "m_s" if name.endswith("_m_s") else unit
        has = len(values) > 0
        found[f"{quantity}_rms_{unit}"] = float(np.sqrt(np.mean(np.square(values)))) if has else None
        found[f"{quantity}_max_{unit}"] = float(np.abs(values).max()) if has else None
    return found


def flight_span(track: Track) -> tuple[float, float] | None:
    """Return the first and the last time 0.5 m above the start; None for a vehicle that stays on the ground."""
    heights = track.position_m[0, 2] - track.position_m[:, 2]
    air = track.motion_s[heights > 0.5]
    return (float(air[0]), float(air[-1])) if len(air) else None

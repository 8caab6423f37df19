"""Pose files (.npz): the poses of a vehicle over time, rendered by ``sim-bridge render``.

A NumPy archive with one array per field of ``Poses``.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flightstack.core.atomic_file import write_bytes_atomically
from flightstack.core.contract import MAX_ROTORS, FloatArray
from flightstack.core.errors import ConfigError

NO_POINTS: FloatArray = np.zeros((0, 3))
NO_NUMBERS: FloatArray = np.zeros(0)
_BAD_FILE = (
    ValueError,
    KeyError,
    EOFError,
    zipfile.BadZipFile,
    NotImplementedError,
    TypeError,
    AttributeError,
)


class Poses(NamedTuple):
    """Poses of a flight at n times.

    ``time_s`` (n,) is increasing; ``position_ned_m`` (n, 3) is relative to home; ``attitude`` (n, 4) holds unit
    quaternions, scalar first, body FRD to world NED; ``rotor_speed_rad_s`` is (n, rotors). ``target_ned_m`` (n, 3) is
    the position setpoint, NaN without one. ``waypoints_ned_m`` (m, 3) are the planned positions, labelled with the
    integers ``waypoint_numbers`` (m,), by default from 1. ``vehicle`` is the name of a built-in vehicle or
    the path of its file. ``title`` is drawn into the picture.
    """

    time_s: FloatArray
    position_ned_m: FloatArray
    attitude: FloatArray
    rotor_speed_rad_s: FloatArray
    target_ned_m: FloatArray
    waypoints_ned_m: FloatArray = NO_POINTS
    vehicle: str = "paper_quad"
    title: str = ""
    waypoint_numbers: FloatArray = NO_NUMBERS


def write_poses(path: Path, poses: Poses) -> None:
    """Write the file atomically; raise OSError."""
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {name: np.asarray(value) for name, value in poses._asdict().items()}
    np.savez_compressed(buffer, **arrays)
    write_bytes_atomically(path, buffer.getvalue())


def read_poses(path: Path) -> Poses:
    """Read the file; raise ConfigError if it cannot be read or is invalid."""
    try:
        with (
            path.open("rb") as raw,
            np.load(raw, allow_pickle=False) as file,
        ):  # NumPy does not close damaged files
            content = {name: file[name] for name in Poses._fields if name in file}
    except OSError as error:
        raise ConfigError(path, "", f"cannot be read: {error.strerror or error}") from error
    except _BAD_FILE as error:
        raise ConfigError(path, "", f"is not a pose file: {error}") from error
    return _checked(path, content)


def _checked(path: Path, content: dict[str, np.ndarray[Any, Any]]) -> Poses:
    def numbers(name: str, *columns: int, default: FloatArray | None = None) -> FloatArray:
        value = content.get(name, default)
        if value is None:
            raise ConfigError(path, name, "is missing")
        wanted = (value.shape[0] if value.ndim else 0, *columns)
        if value.dtype.kind not in "fiu" or value.ndim != 1 + len(columns) or value.shape != wanted:
            shape = ", ".join(str(size) for size in ("n", *columns))
            raise ConfigError(path, name, f"is not an array of numbers of shape ({shape})")
        return value.astype(np.float64)

    time_s = numbers("time_s")
    count = len(time_s)
    if not count or not np.isfinite(time_s).all() or (np.diff(time_s) <= 0.0).any():
        raise ConfigError(path, "time_s", "is not a series of increasing times")
    speeds = content.get("rotor_speed_rad_s", np.zeros((count, 4)))
    rotors = speeds.shape[1] if speeds.ndim == 2 else 0
    if rotors > MAX_ROTORS:
        raise ConfigError(path, "rotor_speed_rad_s", f"has {rotors} rotors, at most {MAX_ROTORS} are allowed")
    poses = Poses(
        time_s,
        numbers("position_ned_m", 3),
        numbers("attitude", 4),
        numbers("rotor_speed_rad_s", rotors, default=speeds),
        numbers("target_ned_m", 3, default=np.full((count, 3), np.nan)),
        numbers("waypoints_ned_m", 3, default=NO_POINTS),
        str(content.get("vehicle", "paper_quad")),
        str(content.get("title", "")),
        numbers("waypoint_numbers", default=NO_NUMBERS),
    )
    _check_rows(path, poses)
    norm = np.linalg.norm(poses.attitude, axis=1, keepdims=True)
    if (norm < 0.5).any():
        raise ConfigError(path, "attitude", "contains an invalid quaternion")
    return poses._replace(attitude=poses.attitude / norm)


def _check_rows(path: Path, poses: Poses) -> None:
    """Raise ConfigError unless rows match ``time_s``, poses are finite and waypoint numbers are whole."""
    labels = poses.waypoint_numbers
    if (
        not np.isfinite(labels).all()
        or len(labels) not in (0, len(poses.waypoints_ned_m))
        or not (np.trunc(labels) == labels).all()
    ):
        raise ConfigError(path, "waypoint_numbers", "must be one integer per row of waypoints_ned_m")
    for name in ("position_ned_m", "attitude", "rotor_speed_rad_s", "target_ned_m"):
        rows, expected = len(getattr(poses, name)), len(poses.time_s)
        if rows != expected:
            raise ConfigError(path, name, f"has {rows} rows, time_s has {expected}")
    for name in ("position_ned_m", "attitude"):
        if not np.isfinite(getattr(poses, name)).all():
            raise ConfigError(path, name, "contains values that are not finite")

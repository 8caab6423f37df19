"""Read the triangles of a mesh: STL (binary and text) and Wavefront OBJ."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError

IntArray: TypeAlias = np.ndarray[Any, np.dtype[np.int64]]

_HEADER = 84
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_LARGEST_FILE = 100_000_000


def read_mesh(file: Path) -> FloatArray:
    """Return the triangles, shape (n, 3, 3), corners counter-clockwise seen from outside.

    Raises ConfigError if the file cannot be read, has no triangles or does not enclose a volume.
    """
    try:
        if file.stat().st_size > _LARGEST_FILE:
            raise ConfigError(file, "", f"is larger than {_LARGEST_FILE // 1_000_000} MB; simplify the mesh")
        content = file.read_bytes()
    except OSError as error:
        raise ConfigError(file, "", f"cannot be read: {error.strerror}") from error
    try:
        triangles = _read_obj(content) if file.suffix.lower() == ".obj" else _read_stl(content)
    except (ValueError, IndexError, UnicodeDecodeError):
        raise ConfigError(file, "", "is not a mesh in STL or OBJ") from None
    if len(triangles) < 4 or not np.isfinite(triangles).all():
        raise ConfigError(
            file, "", "is not a solid: it needs at least four triangles with finite coordinates"
        )
    _check_closed(file, triangles)
    return triangles


def _read_stl(content: bytes) -> FloatArray:
    if len(content) >= _HEADER:
        count = int.from_bytes(content[80:_HEADER], "little")
        if len(content) == _HEADER + count * _TRIANGLE.itemsize:
            return np.frombuffer(content, _TRIANGLE, count, _HEADER)["corners"].astype(np.float64)
    words = content.decode("ascii").split()
    places = [index for index, word in enumerate(words) if word == "vertex"]
    corners = np.array([[float(word) for word in words[at + 1 : at + 4]] for at in places])
    return corners.reshape(-1, 3, 3)


def _read_obj(content: bytes) -> FloatArray:
    corners: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in content.decode("utf-8").splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            corners.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            places = [int(word.split("/")[0]) for word in words[1:]]
            face = [place - 1 if place > 0 else len(corners) + place for place in places]
            triangles.extend((face[0], *pair) for pair in pairwise(face[1:]))
    return np.array(corners)[np.array(triangles, dtype=np.int64).reshape(-1, 3)]


def corners_and_faces(triangles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the unique corners, shape (m, 3), and the faces as indices of corners, shape (n, 3)."""
    corners, number = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    faces = number.reshape(-1, 3)
    return corners, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]  # without degenerate faces


def _check_closed(file: Path, triangles: FloatArray) -> None:
    """Raise ConfigError unless each edge occurs once in each direction and the volume is positive."""
    _, faces = corners_and_faces(triangles)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    directed, times = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(directed[:, ::-1], axis=0)
    if (times != 1).any() or len(directed) != len(back) or (directed != back).any():
        raise ConfigError(file, "", "is not a closed surface: every edge must join two triangles")
    volume = np.einsum("ni,ni->n", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])).sum()
    if volume <= 0.0:
        raise ConfigError(file, "", "is inside out: its corners must go counter-clockwise seen from outside")

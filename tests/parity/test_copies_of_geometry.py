"""Euler angles without compiled code, and those of many rows, against the loops' functions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import euler_from_quaternion, quaternion_from_euler
from flightstack.core.geometry_bulk import euler_from_quaternions, heading_from_quaternions
from flightstack.core.portable_math import euler_angles

QUATERNIONS = np.roll(Rotation.random(200, rng=7).as_quat(), 1, axis=1)


def test_euler_angles_have_the_same_bits_without_numba() -> None:
    for q in QUATERNIONS:
        assert euler_angles(*q.tolist()) == euler_from_quaternion(Quaternion(*q))


def test_euler_angles_survive_the_round_trip() -> None:
    for angles in (Vector3(0.1, -0.2, 3.0), Vector3(-3.1, 1.5, -0.5)):
        assert euler_angles(*quaternion_from_euler(*angles)) == pytest.approx(angles, abs=1e-14)


def test_bulk_euler_angles_are_the_loops() -> None:
    expected = [euler_from_quaternion(Quaternion(*q)) for q in QUATERNIONS]
    assert np.allclose(euler_from_quaternions(QUATERNIONS), expected, rtol=0.0, atol=1e-15)
    headings = heading_from_quaternions(QUATERNIONS)
    assert np.allclose(headings, [angles.z for angles in expected], rtol=0.0, atol=1e-15)

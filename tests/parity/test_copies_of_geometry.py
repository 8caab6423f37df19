"""The few formulas that exist twice, for callers without compiled code, against the copy in geometry."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.geometry import euler_from_quaternion, quaternion_from_euler
from flightstack.core.geometry_bulk import euler_from_quaternions, heading_from_quaternions
from flightstack.services.telemetry.fields import euler

QUATERNIONS = np.roll(Rotation.random(200, rng=7).as_quat(), 1, axis=1)


def test_telemetry_and_reports_turn_quaternions_into_the_loops_euler_angles() -> None:
    for q, heading in zip(QUATERNIONS, heading_from_quaternions(QUATERNIONS), strict=True):
        expected = euler_from_quaternion(Quaternion(*q))
        assert euler(q.tolist()) == pytest.approx(expected, abs=1e-15)
        assert heading == pytest.approx(expected.z, abs=1e-15)


def test_euler_angles_survive_the_round_trip_through_both() -> None:
    for angles in (Vector3(0.1, -0.2, 3.0), Vector3(-3.1, 1.5, -0.5)):
        assert euler(list(quaternion_from_euler(*angles))) == pytest.approx(angles, abs=1e-14)


def test_bulk_euler_angles_are_the_loops() -> None:
    expected = [euler_from_quaternion(Quaternion(*q)) for q in QUATERNIONS]
    assert np.allclose(euler_from_quaternions(QUATERNIONS), expected, rtol=0.0, atol=1e-15)

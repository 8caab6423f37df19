"""POSES.npz: what is written is read, and what is none is refused with a sentence."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightstack.core.errors import ConfigError
from flightstack.core.geometry_bulk import euler_from_quaternions, quaternions_from_euler
from flightstack.flight_log.poses_file import Poses, read_poses, write_poses
from tests.support.sample_poses import sample_poses


def test_what_is_written_is_read(tmp_path: Path) -> None:
    poses = sample_poses(1.0)
    write_poses(tmp_path / "p.npz", poses)
    again = read_poses(tmp_path / "p.npz")
    for name in Poses._fields:
        if name == "attitude":  # brought to length one again
            np.testing.assert_allclose(again.attitude, poses.attitude, rtol=1e-15)
        else:
            np.testing.assert_array_equal(getattr(again, name), getattr(poses, name), name)


def test_targets_waypoints_and_speeds_may_be_left_out(tmp_path: Path) -> None:
    poses = sample_poses(1.0)
    np.savez(
        tmp_path / "p.npz", time_s=poses.time_s, position_ned_m=poses.position_ned_m, attitude=poses.attitude
    )
    again = read_poses(tmp_path / "p.npz")
    assert np.isnan(again.target_ned_m).all()
    assert again.waypoints_ned_m.shape == (0, 3)
    assert not again.rotor_speed_rad_s.any()
    assert again.vehicle == "paper_quad"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"time_s": np.array([0.0, 1.0, 1.0])}, "time_s: is not a series of increasing times"),
        ({"time_s": np.zeros(0)}, "time_s: is not a series of increasing times"),
        ({"time_s": np.array([0.0, np.nan, 1.0])}, "time_s: is not a series of increasing times"),
        ({"position_ned_m": np.zeros((3, 2))}, "position_ned_m: is not an array of numbers of shape (n, 3)"),
        ({"position_ned_m": np.full((3, 3), np.inf)}, "position_ned_m: contains values that are not finite"),
        ({"attitude": np.zeros((3, 4))}, "attitude: contains an invalid quaternion"),
        ({"attitude": np.array(["a"] * 3)}, "attitude: is not an array of numbers"),
        ({"position_ned_m": np.zeros((2, 3))}, "position_ned_m: has 2 rows, time_s has 3"),
        ({"rotor_speed_rad_s": np.zeros((3, 9))}, "rotor_speed_rad_s: has 9 rotors, at most 8 are allowed"),
        (
            {"waypoint_numbers": np.ones(2)},
            "waypoint_numbers: must be one integer per row of waypoints_ned_m",
        ),
        (
            {"waypoints_ned_m": np.zeros((1, 3)), "waypoint_numbers": np.array([np.inf])},
            "waypoint_numbers: must be one integer",
        ),
        ({"waypoints_ned_m": np.zeros(())}, "waypoints_ned_m: is not an array of numbers of shape (n, 3)"),
    ],
)
def test_bad_content_is_named(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    good = {
        "time_s": np.array([0.0, 1.0, 2.0]),
        "position_ned_m": np.zeros((3, 3)),
        "attitude": np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)),
    }
    np.savez(tmp_path / "p.npz", **{**good, **change})
    with pytest.raises(ConfigError) as caught:
        read_poses(tmp_path / "p.npz")
    assert said in str(caught.value)


def test_missing_arrays_are_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", time_s=np.zeros(1))
    with pytest.raises(ConfigError, match="position_ned_m: is missing"):
        read_poses(tmp_path / "p.npz")


def test_a_pickle_is_not_opened(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", time_s=np.array([object()]))
    with pytest.raises(ConfigError, match="is not a pose file"):
        read_poses(tmp_path / "p.npz")


@given(st.binary(max_size=300), st.integers(0, 400))
def test_damaged_files_are_refused_with_a_sentence(tmp_path_factory: Any, junk: bytes, cut: int) -> None:
    buffer = io.BytesIO()
    np.savez(buffer, time_s=np.zeros(1))
    for content in (junk, buffer.getvalue()[:cut]):
        path = tmp_path_factory.getbasetemp() / "damaged.npz"
        path.write_bytes(content)
        with pytest.raises(ConfigError):
            read_poses(path)


def test_there_is_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        read_poses(tmp_path / "none.npz")


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_euler_angles_make_the_quaternion_that_gives_them_back(roll: float, pitch: float, yaw: float) -> None:
    euler = np.array([[roll, pitch, yaw]])
    q = quaternions_from_euler(euler)
    assert np.linalg.norm(q) == pytest.approx(1.0)
    np.testing.assert_allclose(euler_from_quaternions(q), euler, atol=1e-7)

"""Interpolated poses, camera views and the duration of films."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from flightstack.flight_log.poses_file import Poses
from sim_bridge.render.cameras import CAMERAS, FIELD_DEG, Site, View, project, view
from sim_bridge.render.film import gif_durations_ms
from sim_bridge.render.live_view import SNAPSHOT
from sim_bridge.render.live_window import LiveFlight, newest
from sim_bridge.render.pictures import film_of, numbered, spread
from sim_bridge.render.poses import FlightPath
from tests.support.sample_poses import sample_poses

SPAN_M, GROUND_M = 0.33, -0.1
SITE = Site(SPAN_M, GROUND_M)


def _poses(time_s: list[float], **values: list[list[float]]) -> Poses:
    count = len(time_s)
    poses = Poses(
        np.array(time_s),
        np.zeros((count, 3)),
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        np.zeros((count, 4)),
        np.full((count, 3), np.nan),
    )
    return poses._replace(**{name: np.array(value) for name, value in values.items()})


def test_poses_are_interpolated_between_samples() -> None:
    half = math.sqrt(0.5)
    path = FlightPath(
        _poses(
            [1.0, 3.0],
            position_ned_m=[[0.0, 0.0, 0.0], [4.0, -2.0, -6.0]],
            attitude=[[1.0, 0.0, 0.0, 0.0], [half, 0.0, 0.0, half]],
            rotor_speed_rad_s=[[100.0] * 4, [300.0] * 4],
        )
    )
    moment = path.at(2.0)
    assert moment.position_ned_m == pytest.approx((2.0, -1.0, -3.0))
    assert moment.attitude == pytest.approx((math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8)))
    assert moment.heading_rad == pytest.approx(math.pi / 4)
    assert moment.rotor_speed_rad_s == pytest.approx((200.0,) * 4)
    assert moment.speed_m_s == pytest.approx(math.sqrt(4.0 + 1.0 + 9.0))
    assert path.at(3.0).rotor_angle_rad == pytest.approx((400.0,) * 4)
    assert moment.target_ned_m is None


def test_quaternion_sign_flips_do_not_spin_the_vehicle() -> None:
    path = FlightPath(_poses([0.0, 1.0], attitude=[[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]]))
    assert abs(path.at(0.5).attitude[0]) == pytest.approx(1.0)


def test_poses_are_constant_outside_the_flight() -> None:
    path = FlightPath(sample_poses(2.0))
    assert path.at(-5.0).position_ned_m == path.at(0.0).position_ned_m
    assert path.at(99.0).position_ned_m == path.at(path.end_s).position_ned_m


def test_one_sample_is_a_flight() -> None:
    moment = FlightPath(_poses([2.0], position_ned_m=[[1.0, 2.0, -3.0]])).at(2.0)
    assert moment.position_ned_m == (1.0, 2.0, -3.0)
    assert moment.speed_m_s == 0.0


def test_the_trail_ends_at_the_vehicle_and_never_has_too_many_points() -> None:
    path = FlightPath(sample_poses(60.0))
    for time_s in (0.0, 0.013, 7.7, 60.0):
        trail = path.trail(time_s, 100)
        assert len(trail) <= 101
        np.testing.assert_array_equal(trail[-1], path.at(time_s).position_ned_m)
        np.testing.assert_array_equal(trail[0], path.poses.position_ned_m[0])


def test_chase_camera_smooths_a_jump_of_the_heading() -> None:
    time_s = np.arange(0.0, 10.0, 0.02)
    yaw = np.where(time_s < 5.0, 0.0, 2.0)
    attitude = np.column_stack((np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)))
    path = FlightPath(_poses(time_s.tolist(), attitude=attitude.tolist()))
    headings = np.array([path.at(time).chase_heading_rad for time in time_s])
    assert headings[0] == pytest.approx(0.0)
    assert headings[-1] == pytest.approx(2.0)
    assert np.abs(np.diff(headings)).max() < 0.03  # 2 rad over 1.8 s in steps of 20 ms: 0.022


def _eye(seen: View) -> np.ndarray:
    turn, up = math.radians(seen.azimuth_deg), math.radians(seen.elevation_deg)
    ahead = np.array([math.cos(turn) * math.cos(up), math.sin(turn) * math.cos(up), math.sin(up)])
    return np.array(seen.look_at_m) - seen.distance_m * ahead


@pytest.mark.parametrize("camera", CAMERAS)
def test_each_camera_has_the_vehicle_in_its_picture(camera: str) -> None:
    poses = sample_poses(8.0)
    path = FlightPath(poses)
    flown = poses.position_ned_m * (1.0, -1.0, -1.0)
    site = SITE._replace(low_m=tuple(flown.min(axis=0)), high_m=tuple(flown.max(axis=0)))
    for time_s in np.linspace(0.0, 8.0, 33).tolist():
        moment = path.at(time_s)
        north, east, down = moment.position_ned_m
        seen = view(camera, moment, site)
        place = project(seen, (north, -east, -down), (1280, 720))
        assert place is not None
        assert 0.0 < place[0] < 1280.0
        assert 0.0 < place[1] < 720.0
        assert _eye(seen)[2] > GROUND_M
        assert seen.field_deg <= FIELD_DEG


def test_chase_camera_is_behind_the_vehicle() -> None:
    path = FlightPath(_poses([0.0], attitude=[[math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]]))  # nose east
    eye = _eye(view("chase", path.at(0.0), SITE))
    assert eye[1] > 1.0  # west of it
    assert eye[2] > 0.0


def test_the_frames_of_a_gif_last_as_long_as_the_film() -> None:
    for fps in (12.5, 15.0, 24.0, 30.0):
        assert sum(gif_durations_ms(300, fps)) == pytest.approx(1000.0 * 300 / fps, abs=10.0)


def test_file_names_of_several_pictures_are_numbered() -> None:
    assert numbered(Path("a/b.png"), 1) == [Path("a/b.png")]
    assert numbered(Path("a/b.png"), 3) == [Path("a/b-1.png"), Path("a/b-2.png"), Path("a/b-3.png")]
    assert numbered(Path("b.png"), 10)[0] == Path("b-01.png")
    assert film_of(Path("f.mp4"), 2.0, 4.0, 10.0, 1.0).frames == 20
    assert film_of(Path("f.mp4"), 2.0, 4.0, 10.0, 4.0).frames == 5
    assert film_of(Path("f.mp4"), 2.0, 2.0, 10.0, 1.0).frames == 1
    assert spread(0.0, 8.0, 3) == [0.0, 4.0, 8.0]


# ------------------------------------------------------------------ live


def _snapshot(time_s: float, north: float, speed: float = 100.0) -> bytes:
    return SNAPSHOT.pack(time_s, north, 0.0, -1.0, 3.0, 0.0, 4.0, 1.0, *[0.0] * 6, *[speed] * 8)


def test_snapshots_become_moments_and_a_trail() -> None:
    flight = LiveFlight(rotors=4, most_points=3)
    moment = flight.update(_snapshot(0.01, 0.0))
    assert moment.speed_m_s == pytest.approx(5.0)
    for step in range(1, 6):
        moment = flight.update(_snapshot(0.01 + 0.02 * step, 0.1 * step))
    assert moment.position_ned_m == pytest.approx((0.5, 0.0, -1.0))
    assert moment.rotor_angle_rad == pytest.approx((100.0 * 0.11,) * 4)
    assert len(flight.trail(0.0, 99)) == 4  # the newest three and the present position


def test_snapshot_that_is_not_finite_is_ignored() -> None:
    flight = LiveFlight(rotors=4, most_points=3)
    before = flight.update(_snapshot(0.01, 1.0))
    assert flight.update(_snapshot(0.02, math.nan)) == before
    assert flight.update(_snapshot(0.03, 1.0, speed=math.inf)).rotor_speed_rad_s == (0.0,) * 4


def test_newest_complete_snapshot_is_used() -> None:
    one, two, three = (_snapshot(time_s, 0.0) for time_s in (1.0, 2.0, 3.0))
    buffer = bytearray(one + two + three[:10])
    assert newest(buffer) == two
    assert bytes(buffer) == three[:10]
    assert newest(buffer) is None
    buffer += three[10:]
    assert newest(buffer) == three
    assert not buffer

"""How the reference follows a companion's stream, on a vehicle that is where the reference is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.contract import Quaternion, Vector3
from flightstack.core.enums import Mode
from flightstack.guidance.setpoints import (
    NOT_GIVEN,
    AttitudeSetpoint,
    OffboardSetpoint,
    PointSetpoint,
    Sticks,
)
from flightstack.params.vehicle import GRAVITY_M_S2
from tests.support.perfect_vehicle import WEIGHT_N, PerfectVehicle

NAN = math.nan
MAX_THRUST_N = 20.0
STILL = Vector3(0.0, 0.0, 0.0)


def in_offboard(setpoint: OffboardSetpoint, **params: float) -> PerfectVehicle:
    vehicle = PerfectVehicle(**params)
    vehicle.airborne_at(0.0, 0.0, -5.0)
    send(vehicle, setpoint)
    vehicle.enter(Mode.OFFBOARD)
    return vehicle


def send(vehicle: PerfectVehicle, setpoint: OffboardSetpoint) -> None:
    vehicle.navigator.set_offboard(setpoint, MAX_THRUST_N)


def velocities(vehicle: PerfectVehicle) -> np.ndarray:
    return np.diff(np.array(vehicle.path), axis=0) / vehicle.dt_s


def test_a_position_is_approached_as_a_waypoint_and_held() -> None:
    vehicle = in_offboard(PointSetpoint(Vector3(20.0, -10.0, -8.0)))
    vehicle.run(15.0)
    assert vehicle.position == pytest.approx([20.0, -10.0, -8.0], abs=1e-4)
    path = np.array(vehicle.path)
    aside = (path[:, :2] @ (10.0, 20.0)) / math.hypot(10.0, 20.0)
    assert np.abs(aside).max() < 1e-9  # a straight line
    assert np.abs(velocities(vehicle)[:, :2]).max() > 3.0
    assert vehicle.yaw == 0.0  # no heading was given: it stays


def test_a_position_stays_within_the_speeds_of_the_parameters() -> None:
    far = PointSetpoint(Vector3(200.0, 0.0, -60.0))
    vehicle = in_offboard(far, MPC_XY_VEL_MAX=6.0, MPC_Z_VEL_MAX_UP=2.0)
    vehicle.run(20.0)
    v = velocities(vehicle)
    assert v[:, 0].max() == pytest.approx(6.0, rel=0.01)
    assert -v[:, 2].min() == pytest.approx(2.0, rel=0.01)


def test_a_velocity_moves_and_its_end_stops() -> None:
    vehicle = in_offboard(PointSetpoint(velocity_ned_m_s=Vector3(2.0, -1.0, -0.5)))
    vehicle.run(4.0)
    assert velocities(vehicle)[-1] == pytest.approx([2.0, -1.0, -0.5], abs=1e-3)
    send(vehicle, PointSetpoint(velocity_ned_m_s=STILL))
    vehicle.run(5.0)
    assert np.abs(velocities(vehicle)[-1]).max() < 1e-4


def test_a_velocity_across_and_a_height() -> None:
    """Mixed: the horizontal part is a velocity, the vertical one a position."""
    vehicle = in_offboard(PointSetpoint(Vector3(NAN, NAN, -9.0), Vector3(1.5, 0.0, NAN)))
    vehicle.run(8.0)
    assert vehicle.position[2] == pytest.approx(-9.0, abs=1e-3)
    assert velocities(vehicle)[-1] == pytest.approx([1.5, 0.0, 0.0], abs=1e-3)


def test_an_acceleration_accelerates_up_to_the_top_speed() -> None:
    setpoint = PointSetpoint(Vector3(NAN, NAN, -5.0), NOT_GIVEN, Vector3(1.0, 0.0, NAN))
    vehicle = in_offboard(setpoint, MPC_XY_VEL_MAX=5.0)
    vehicle.run(3.0)
    v = velocities(vehicle)[:, 0]
    assert (v[-1] - v[-51]) / (50 * vehicle.dt_s) == pytest.approx(1.0, rel=1e-3)
    vehicle.run(10.0)
    assert velocities(vehicle)[:, 0].max() == pytest.approx(5.0, rel=0.01)


def circle(time_s: float, with_acceleration: bool) -> PointSetpoint:
    radius, turn = 5.0, 0.5
    angle = turn * time_s
    p = Vector3(radius * math.sin(angle), radius * (1.0 - math.cos(angle)), -5.0)
    v = Vector3(radius * turn * math.cos(angle), radius * turn * math.sin(angle), 0.0)
    a = Vector3(-radius * turn**2 * math.sin(angle), radius * turn**2 * math.cos(angle), 0.0)
    return PointSetpoint(p, v, a if with_acceleration else NOT_GIVEN)


@pytest.mark.parametrize(
    ("with_acceleration", "every", "error_m"),
    # seen: 0.104, 0.0064 and 0.051 m. A circle of 5 m at 2.5 m/s has 1.25 m/s²: 1/12 s² of it is 0.104 m
    [(False, 1, 0.115), (True, 1, 0.008), (True, 10, 0.06)],
    ids=["position and velocity", "and acceleration", "and acceleration, at 5 Hz"],
)
def test_a_trajectory_is_followed_closely(with_acceleration: bool, every: int, error_m: float) -> None:
    vehicle = in_offboard(circle(0.0, with_acceleration))
    errors = []
    for tick in range(1500):
        if tick % every == 0:
            send(vehicle, circle(vehicle.time_s, with_acceleration))
        vehicle.tick()
        errors.append(np.linalg.norm(vehicle.position - circle(vehicle.time_s, False).position_ned_m))
    assert max(errors[500:]) < error_m  # it began at rest beside a point that moves


def test_a_position_alone_lags_a_moving_point_as_it_would_a_waypoint() -> None:
    vehicle = in_offboard(PointSetpoint(Vector3(0.0, 0.0, -5.0)))
    for _ in range(800):
        send(vehicle, PointSetpoint(Vector3(2.0 * vehicle.time_s, 0.0, -5.0)))
        vehicle.tick()
    assert 2.0 * vehicle.time_s - vehicle.position[0] == pytest.approx(2.1, abs=0.15)  # 1 s of its speed


@pytest.mark.parametrize(("yaw", "rate", "after_8_s"), [(2.0, NAN, 2.0), (NAN, 0.4, 3.2), (NAN, NAN, 0.0)])
def test_heading_rate_or_neither(yaw: float, rate: float, after_8_s: float) -> None:
    vehicle = in_offboard(PointSetpoint(Vector3(0.0, 0.0, -5.0), yaw_rad=yaw, yaw_rate_rad_s=rate))
    vehicle.run(8.0)
    assert vehicle.turned == pytest.approx(
        after_8_s, abs=0.1
    )  # 0.067 rad late: a rate needs time to build up
    if math.isfinite(yaw):
        assert vehicle.yaw == pytest.approx(yaw, abs=1e-3)


def test_without_any_setpoint_it_stops() -> None:
    vehicle = PerfectVehicle()
    vehicle.airborne_at(0.0, 0.0, -5.0)
    vehicle.navigator.goal.trajectory[3:6] = 3.0, 0.0, 0.0
    vehicle.enter(Mode.OFFBOARD)
    vehicle.run(5.0)
    assert np.abs(vehicle.state[3:6]).max() < 1e-3


def test_a_reference_without_position_does_not_leave_a_vehicle_that_cannot_follow() -> None:
    vehicle = in_offboard(PointSetpoint(velocity_ned_m_s=Vector3(5.0, 5.0, -1.0)))
    n, stuck = vehicle.navigator, vehicle.state.copy()
    for _ in range(1000):
        n.step(Mode.OFFBOARD, stuck, np.array([1.0, 0.0, 0.0, 0.0, WEIGHT_N]), WEIGHT_N)
    assert n.setpoint[:3] == pytest.approx([3.0, 3.0, -8.0])


def test_an_attitude_is_handed_on_and_the_reference_goes_with_the_vehicle() -> None:
    tilted = Quaternion(math.cos(0.1), 0.0, -math.sin(0.1), 0.0)  # nose down by 0.2 rad
    vehicle = in_offboard(AttitudeSetpoint(tilted, STILL, 0.5))
    n = vehicle.navigator
    state = vehicle.state.copy()
    state[:6] = 1.0, 2.0, -3.0, 0.4, 0.5, 0.6
    n.step(Mode.OFFBOARD, state, np.array([1.0, 0.0, 0.0, 0.0, WEIGHT_N]), WEIGHT_N)
    assert n.flies_attitude(Mode.OFFBOARD)
    assert not n.flies_attitude(Mode.HOLD)
    assert n.attitude_target == pytest.approx([*tilted, 0.5 * MAX_THRUST_N])
    assert n.setpoint[:6] == pytest.approx(state[:6])
    # the thrust equals the weight: forward with g sin(0.2), down with g (1 − cos(0.2))
    assert n.setpoint[6:9] == pytest.approx(
        [GRAVITY_M_S2 * math.sin(0.2), 0.0, GRAVITY_M_S2 * (1 - math.cos(0.2))], rel=1e-4
    )


def test_body_rates_turn_the_target_but_not_far_ahead_of_the_vehicle() -> None:
    vehicle = in_offboard(AttitudeSetpoint(None, Vector3(0.0, 0.0, 0.5), 0.5))
    n = vehicle.navigator
    target = np.array([1.0, 0.0, 0.0, 0.0, WEIGHT_N])
    for _ in range(20):
        n.step(Mode.OFFBOARD, vehicle.state, target, WEIGHT_N)
        target = n.attitude_target.copy()
    assert 2.0 * math.atan2(target[3], target[0]) == pytest.approx(0.5 * 20 * vehicle.dt_s, rel=1e-9)
    for _ in range(500):
        n.step(Mode.OFFBOARD, vehicle.state, target, WEIGHT_N)
        target = n.attitude_target.copy()
    assert 2.0 * math.atan2(target[3], target[0]) == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize(
    ("setpoint", "rises"),
    [
        (PointSetpoint(Vector3(0.0, 0.0, -2.0)), True),
        (PointSetpoint(Vector3(5.0, 0.0, 0.0)), False),
        (PointSetpoint(velocity_ned_m_s=Vector3(0.0, 0.0, -0.5)), True),
        (PointSetpoint(velocity_ned_m_s=Vector3(1.0, 0.0, 0.0)), False),
        (PointSetpoint(Vector3(0.0, 0.0, NAN), STILL, Vector3(0.0, 0.0, -1.0)), False),
        (PointSetpoint(acceleration_ned_m_s2=Vector3(0.0, 0.0, -1.0)), True),
        (AttitudeSetpoint(Quaternion(1.0, 0.0, 0.0, 0.0), STILL, 0.6), True),
        (AttitudeSetpoint(Quaternion(1.0, 0.0, 0.0, 0.0), STILL, 0.1), False),
    ],
)
def test_what_makes_a_standing_vehicle_take_off(setpoint: OffboardSetpoint, rises: bool) -> None:
    vehicle = PerfectVehicle()
    assert not vehicle.navigator.wants_to_rise(Mode.OFFBOARD, 0.0)
    send(vehicle, setpoint)
    assert vehicle.navigator.wants_to_rise(Mode.OFFBOARD, 0.0) is rises


number = st.one_of(
    st.just(NAN), st.floats(-20.0, 20.0), st.floats(width=32), st.sampled_from([0.0, 1e7, -1e7, 3e38])
)
vector = st.builds(Vector3, number, number, number)
point = st.builds(PointSetpoint, vector, vector, vector, number, number)
unit = st.floats(-1.0, 1.0)


@settings(max_examples=150)
@given(
    st.lists(st.tuples(point, st.integers(1, 60)), min_size=1, max_size=6),
    st.builds(Sticks, unit, unit, unit, unit),
    st.sampled_from([Mode.OFFBOARD, Mode.POSITION]),
)
def test_no_stream_breaks_the_reference_or_its_limits(
    stream: list[tuple[PointSetpoint, int]], sticks: Sticks, mode: Mode
) -> None:
    vehicle = in_offboard(stream[0][0])
    vehicle.navigator.set_sticks(sticks)
    vehicle.enter(mode)
    p = vehicle.navigator.params
    for setpoint, ticks in stream:
        send(vehicle, setpoint)
        for _ in range(ticks):
            before = vehicle.navigator.setpoint.copy()
            vehicle.tick()
            s = vehicle.navigator.setpoint
            assert np.isfinite(s).all()
            # the velocity loop overshoots by 1 % at most
            assert math.hypot(s[3], s[4]) <= 1.02 * p.max_speed_m_s
            assert -1.02 * p.climb_speed_m_s <= s[5] <= 1.02 * p.descent_speed_m_s
            assert math.hypot(s[6], s[7]) <= p.acceleration_m_s2 * 1.0001
            assert abs(s[8]) <= p.vertical_acceleration_m_s2 * 1.0001
            jerk = (s[6:9] - before[6:9]) / vehicle.dt_s
            assert math.hypot(jerk[0], jerk[1]) <= p.jerk_m_s3 * 1.0001
            assert abs(s[10]) <= max(p.yaw_rate_rad_s, p.manual_yaw_rate_rad_s) * 1.0001

"""The reference trajectory: limits, arrival, straight legs, no overshoot, and turns with a direction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightstack.core.array_items import as_tuple, store
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray
from flightstack.guidance.params import guidance_params
from flightstack.guidance.trajectory import (
    KP,
    Goal,
    Trajectory,
    TrajectoryLimits,
    approach_speed,
    setpoint_of,
    trajectory_step,
)
from flightstack.params.behaviour import Behaviour

DT = 0.01
X, Y, Z, VX, VY, VZ, AX, AY, AZ, YAW, YAW_RATE = range(11)
DEFAULT_LIMITS = TrajectoryLimits(3.0, 3.0, 20.0)
AT_REST = Trajectory(*[0.0] * 11)

properties = settings(max_examples=60)
places = st.tuples(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0), st.floats(-30.0, 30.0))
# the whole range that the parameters allow, in the form that guidance uses
limit_sets = st.builds(
    lambda flat, upright, jerk: limits_of(MPC_ACC_HOR=flat, MPC_ACC_UP_MAX=upright, MPC_JERK_AUTO=jerk),
    st.floats(0.5, 4.5), st.floats(0.5, 5.0), st.floats(1.0, 80.0),
)  # fmt: skip


def limits_of(**params: float) -> TrajectoryLimits:
    behaviour = Behaviour()
    for name, value in params.items():
        behaviour = behaviour.updated(name, value)
    p = guidance_params(behaviour, 1.0)
    return TrajectoryLimits(p.acceleration_m_s2, p.vertical_acceleration_m_s2, p.jerk_m_s3)


def goal(x=0.0, y=0.0, z=0.0, yaw=0.0, speed=4.0, climb=2.5, descent=1.5, yaw_rate=1.05, counted=0.0) -> Goal:
    return Goal(x, y, z, yaw, speed, climb, descent, yaw_rate, counted)


@compiled
def _fly(rows: FloatArray, start: Trajectory, aim: Goal, limits: TrajectoryLimits, dt_s: float) -> None:
    t = start
    for index in range(rows.shape[0]):
        t = trajectory_step(t, aim, limits, dt_s)
        store(rows[index], t)


def fly(
    aim: Goal, seconds: float, limits: TrajectoryLimits = DEFAULT_LIMITS, start=AT_REST, dt=DT
) -> np.ndarray:
    """Rows of the trajectory, shape (ticks, 11)."""
    rows = np.zeros((round(seconds / dt), 11))
    _fly(rows, start, aim, limits, dt)
    return rows


@properties
@given(places, st.floats(1.0, 12.0), limit_sets)
def test_a_leg_from_rest_is_straight_keeps_the_limits_and_ends_at_the_goal_without_overshoot(
    place: tuple[float, float, float], speed: float, limits: TrajectoryLimits
) -> None:
    x, y, z = place
    distance = math.hypot(x, y)
    rows = fly(goal(x, y, z, speed=speed), 130.0, limits)
    # speed settles through a double pole and exceeds its limit by 0.24 % at most in the whole range of limits
    assert np.hypot(rows[:, VX], rows[:, VY]).max() <= speed * 1.004
    assert -2.5 * 1.004 <= rows[:, VZ].min() <= rows[:, VZ].max() <= 1.5 * 1.004
    assert np.hypot(rows[:, AX], rows[:, AY]).max() <= limits.acceleration_m_s2 * (1 + 1e-9)
    assert np.abs(rows[:, AZ]).max() <= limits.vertical_acceleration_m_s2 * (1 + 1e-9)
    jerk = np.diff(rows[:, AX : AZ + 1], axis=0) / DT
    assert np.hypot(jerk[:, 0], jerk[:, 1]).max() <= limits.jerk_m_s3 * (1 + 1e-9)
    assert np.abs(jerk[:, 2]).max() <= limits.jerk_m_s3 * (1 + 1e-9)
    # the distance of any point from the line is rounding: 1e-13 m seen
    assert np.abs(rows[:, X] * y - rows[:, Y] * x).max() <= 1e-9 * max(1.0, distance)
    if distance > 0.01:
        assert ((rows[:, X] * x + rows[:, Y] * y) / distance).max() <= distance + 2e-6  # 5.5e-7 m seen
    assert (rows[:, Z] * math.copysign(1.0, z)).max() <= abs(z) + 2e-6  # 2.5e-7 m seen
    assert np.abs(rows[-1, :3] - place).max() < 1e-6
    assert np.abs(rows[-1, VX : AZ + 1]).max() < 1e-6


@properties
@given(places, places, st.tuples(*[st.floats(-4.0, 4.0)] * 2), st.floats(-1.5, 1.5))
def test_it_arrives_from_any_motion(place, start, velocity, sink: float) -> None:
    moving = AT_REST._replace(x=start[0], y=start[1], z=start[2], vx=velocity[0], vy=velocity[1], vz=sink)
    rows = fly(goal(*place), 150.0, start=moving)
    assert np.abs(rows[-1, :3] - place).max() < 1e-6
    assert np.hypot(rows[:, AX], rows[:, AY]).max() <= 3.0 * (1 + 1e-9)


def test_position_velocity_and_acceleration_belong_together() -> None:
    """What is fed forward is the derivative of what is tracked."""
    rows = fly(goal(12.0, -7.0, -4.0, yaw=1.0), 10.0)
    for lower, upper in ((X, VX), (Y, VY), (Z, VZ), (VX, AX), (VY, AY), (VZ, AZ), (YAW, YAW_RATE)):
        assert np.allclose(np.diff(rows[:, lower]) / DT, rows[1:, upper], rtol=0.0, atol=1e-11)


def test_the_way_is_flown_at_the_speed_asked_for() -> None:
    rows = fly(goal(60.0, 80.0, speed=5.0), 30.0)
    assert np.hypot(rows[:, VX], rows[:, VY]).max() == pytest.approx(5.0, rel=3e-3)
    assert fly(goal(z=-50.0), 15.0)[:, VZ].min() == pytest.approx(-2.5, rel=3e-3)
    assert fly(goal(z=50.0), 15.0)[:, VZ].max() == pytest.approx(1.5, rel=3e-3)


@given(st.floats(0.0, 500.0), st.floats(0.1, 12.0), st.floats(0.5, 5.0))
@properties
def test_approach_speed_rises_from_the_goal_without_a_jump(
    distance: float, top: float, acceleration: float
) -> None:
    here, farther = (
        approach_speed(distance, top, acceleration),
        approach_speed(distance + 1e-6, top, acceleration),
    )
    assert 0.0 <= here <= top
    assert here - 1e-12 <= farther <= here + 1.01e-6 * KP


# ---------------------------------------------------------------------- heading


@pytest.mark.parametrize("target", [0.5, -0.5, 3.0, -3.0, math.pi])
def test_the_heading_turns_the_short_way_and_stops(target: float) -> None:
    rows = fly(goal(yaw=target), 10.0)
    assert math.remainder(rows[-1, YAW] - target, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    # ζ 0.87 overshoots by 0.4 % of what is left when the limits end: 0.006 rad seen
    assert np.abs(np.cumsum(rows[:, YAW_RATE]) * DT).max() < abs(target) + 0.01
    assert np.abs(rows[:, YAW_RATE]).max() <= 1.05 + 1e-9
    assert np.abs(np.diff(rows[:, YAW_RATE])).max() <= 6.0 * DT + 1e-12


def test_the_short_way_leads_across_south() -> None:
    rows = fly(goal(yaw=-3.0), 5.0, start=AT_REST._replace(yaw_rad=3.0))
    assert np.sum(rows[:, YAW_RATE]) * DT == pytest.approx(2 * math.pi - 6.0, abs=1e-3)
    assert np.abs(rows[:, YAW]).max() <= math.pi


@pytest.mark.parametrize("turn", [2 * math.pi, -2 * math.pi, 1.5 * math.pi, -1.5 * math.pi, 0.3, 7.0])
def test_a_counted_turn_is_made_whole_and_in_its_direction(turn: float) -> None:
    start = AT_REST._replace(yaw_rad=2.5)
    rows = fly(goal(yaw=2.5 + turn, counted=1.0), 15.0, start=start)
    assert np.sum(rows[:, YAW_RATE]) * DT == pytest.approx(turn, abs=1e-6)
    assert (rows[:, YAW_RATE] * math.copysign(1.0, turn)).min() > -0.02  # the overshoot's way back
    for row in rows:
        yaw = setpoint_of(Trajectory(*row)).yaw_rad
        assert -math.pi <= yaw <= math.pi
        assert math.remainder(yaw - row[YAW], 2 * math.pi) == pytest.approx(0.0, abs=1e-12)


def test_after_a_counted_turn_the_heading_is_an_angle_again() -> None:
    turned = Trajectory(*fly(goal(yaw=9.0, counted=1.0), 20.0)[-1])
    rows = fly(goal(yaw=9.0 - 2 * math.pi), 1.0, start=turned)
    assert np.abs(rows[:, YAW]).max() <= math.pi
    assert np.abs(rows[:, YAW_RATE]).max() < 1e-6


def test_setpoint_carries_the_whole_state() -> None:
    t = Trajectory(*[float(index) / 10 for index in range(11)])
    s = setpoint_of(t)
    flat = (*s.position_ned_m, *s.velocity_ned_m_s, *s.acceleration_ned_m_s2, s.yaw_rad, s.yaw_rate_rad_s)
    assert flat == pytest.approx(t, abs=1e-15)
    assert as_tuple(np.array(flat), 3) == t[:3]

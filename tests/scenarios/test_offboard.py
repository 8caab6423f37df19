"""A companion flies the vehicle: by places, velocities, a trajectory, attitudes and rates; and falls silent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.mavlink.dialect import mavlink
from tests.support.refusals import refused
from tests.support.streams import attitude, body_rates, hover_thrust, level, local_point, stream
from tests.support.truth import World

REJECTED = 1
CORNERS = ((6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0))


def in_offboard(**world_options: object) -> World:
    """Take off in OFFBOARD to 4 m, as a companion does: stream, select, arm."""
    world = World(**world_options)  # type: ignore[arg-type]
    above = local_point((0.0, 0.0, -4.0))
    stream(world, above, 0.1)
    world.set_mode("OFFBOARD")
    world.arm()
    stream(world, above, 8.0)
    assert not world.state.landed
    return world


def test_offboard_needs_a_stream_in_flight() -> None:
    world = World()
    world.arm()
    world.takeoff(2.0)
    world.run_until("mode == 'HOLD'")
    with refused(REJECTED, "no offboard setpoints"):
        world.set_mode("OFFBOARD")
    stream(world, local_point((0.0, 0.0, -2.0)), 0.2)
    world.set_mode("OFFBOARD")
    assert world.state.mode == "OFFBOARD"
    world.set_mode("HOLD")
    world.run_for(2.0)  # the stream was there, and is no more
    with refused(REJECTED, "no offboard setpoints"):
        world.set_mode("OFFBOARD")


def test_a_stream_in_another_mode_is_only_remembered() -> None:
    world = World()
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'")
    stream(world, local_point((30.0, 0.0, -3.0)), 3.0)
    assert world.state.mode == "HOLD"
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.05


@pytest.mark.parametrize(
    ("air", "within_m"),
    [({}, 0.002), ({"wind": (3.0, 0.0, 0.0), "drag": True}, 0.02)],  # 0.00007 m and 0.0096 m seen
)
def test_a_square_by_places(air: dict[str, object], within_m: float) -> None:
    world = in_offboard(**air)
    for north, east in CORNERS:
        stream(world, local_point((north, east, -4.0)), 8.0)
        assert math.dist(world.state.position_ned_m, (north, east, -4.0)) < within_m


def test_a_square_by_velocities() -> None:
    """Legs by time alone: starts, turns and the stop differ in how long they take, and do not quite cancel."""
    world = in_offboard()
    began = world.state.position_ned_m
    for north, east in ((1.5, 0.0), (0.0, 1.5), (-1.5, 0.0), (0.0, -1.5)):
        stream(world, local_point(velocity=(north, east, 0.0)), 4.0)
        assert world.state.velocity_ned_m_s == pytest.approx([north, east, 0.0], abs=0.003)  # 0.0003 seen
    stream(world, local_point(velocity=(0.0, 0.0, 0.0)), 5.0)
    assert np.linalg.norm(world.state.velocity_ned_m_s) < 0.02
    assert math.dist(world.state.position_ned_m, began) < 0.3  # 0.198 m seen


def test_a_velocity_in_the_body_frame_goes_where_the_vehicle_looks() -> None:
    world = in_offboard()
    stream(world, local_point((0.0, 0.0, -4.0), yaw=math.pi / 2), 6.0)
    forward = local_point(velocity=(1.0, 0.0, 0.0), frame=mavlink.MAV_FRAME_BODY_NED, yaw_rate=0.0)
    stream(world, forward, 4.0)
    assert world.state.velocity_ned_m_s == pytest.approx([0.0, 1.0, 0.0], abs=0.05)


def test_a_circle_is_followed_by_place_velocity_and_acceleration() -> None:
    world = in_offboard()
    radius, turn = 4.0, 0.5

    def circle(time_s: float):  # type: ignore[no-untyped-def]
        a = turn * time_s
        s, c, v, w = math.sin(a), math.cos(a), radius * turn, radius * turn**2
        return local_point((radius * s, radius * (1.0 - c), -4.0), (v * c, v * s, 0.0), (-w * s, w * c, 0.0))

    stream(world, circle, 8.0)
    began_s, errors = world.time_s - 8.0, []
    for _ in range(400):
        world.gcs.send(circle(world.time_s - began_s))
        world.run_for(0.02)
        angle = turn * (world.time_s - began_s)
        place = (radius * math.sin(angle), radius * (1.0 - math.cos(angle)), -4.0)
        errors.append(float(math.dist(world.state.position_ned_m, place)))
    assert max(errors) < 0.05  # 0.026 m seen


def test_attitudes_hover_and_the_way_out_is_smooth() -> None:
    world = in_offboard()
    before = world.state.position_ned_m
    stream(world, attitude(level(), hover_thrust(world)), 4.0)
    assert (
        math.dist(world.state.position_ned_m, before) < 0.01
    )  # 0.0004 m seen: nothing but the trim holds it
    tilted = (math.cos(0.05), 0.0, -math.sin(0.05), 0.0)
    stream(world, attitude(tilted, hover_thrust(world) / math.cos(0.1)), 2.0)
    assert world.state.velocity_ned_m_s.x > 1.0
    fast = world.state.velocity_ned_m_s
    world.set_mode("HOLD")
    steepest, change = 0.0, 0.0
    for _ in range(400):
        world.run_for(0.01)
        up = 1.0 - 2.0 * float(np.sum(world.engine.simulator.frame.state[7:9] ** 2))
        steepest = max(steepest, math.acos(min(1.0, up)))
        change = max(change, float(math.dist(world.state.velocity_ned_m_s, fast)))
        fast = world.state.velocity_ned_m_s
    assert steepest < 0.35  # 0.277 rad seen: it brakes with at most 3 m/s²
    assert change < 0.04  # m/s in 10 ms; 0.028 seen
    world.run_for(4.0)
    assert np.linalg.norm(world.state.velocity_ned_m_s) < 0.02


def test_body_rates_turn_the_vehicle() -> None:
    world = in_offboard()
    stream(world, body_rates((0.0, 0.0, 0.3), hover_thrust(world)), 4.0)
    q = world.engine.simulator.frame.state[6:10]
    assert 2.0 * math.atan2(q[3], q[0]) == pytest.approx(1.2, abs=0.03)  # 0.009 rad seen


def test_little_thrust_on_the_ground_does_not_fly_and_a_descent_lands() -> None:
    world = World()
    stream(world, attitude(level(), 0.1), 0.1)
    world.set_mode("OFFBOARD")
    world.arm()
    stream(world, attitude(level(), 0.1), 2.0)
    assert world.state.landed
    stream(world, local_point((0.0, 0.0, -2.0)), 5.0)
    assert not world.state.landed
    down = local_point(velocity=(0.0, 0.0, 0.5))
    for _ in range(600):
        world.gcs.send(down)
        world.run_for(0.02)
    assert not world.state.armed
    assert abs(world.state.altitude_m) < 0.01


def test_a_lost_stream_does_not_leave_the_vehicle_to_its_last_velocity() -> None:
    world = in_offboard()
    stream(world, local_point(velocity=(2.0, 0.0, 0.0)), 4.0)
    silent_s, north = world.time_s, float(world.state.north_m)
    world.run_until("mode != 'OFFBOARD'", 10.0)
    assert world.time_s - silent_s == pytest.approx(1.0, abs=0.05)  # COM_OF_LOSS_T
    farthest = north
    for _ in range(50):
        world.run_for(0.1)
        farthest = max(farthest, float(world.state.north_m))
    assert farthest - north < 5.0  # 1 s at 2 m/s, and braking


def test_setpoints_that_make_no_sense_are_refused_once() -> None:
    world = in_offboard()
    before = world.state.position_ned_m
    stream(world, local_point((5.0, math.nan, -4.0)), 0.4)
    refused = [text for text in world.texts if "Setpoint refused" in text]
    assert refused == ["Setpoint refused: the position has only one of its horizontal parts"]
    assert math.dist(world.state.position_ned_m, before) < 0.02


def test_nothing_that_is_streamed_breaks_the_flight() -> None:
    """Random masks, frames and numbers, NaN, infinite and huge ones among them, 50 times a second."""
    world = in_offboard(params={"MPC_XY_VEL_MAX": 6})  # with the rotor check: from limit to limit is no fault
    random = np.random.default_rng(3)
    odd = (math.nan, math.inf, -math.inf, 3e38, -3e38, 0.0)
    held_on, steepest, fastest = 0, 0.0, 0.0
    hover = local_point((0.0, 0.0, -15.0))
    for step in range(1500):
        numbers = [
            float(random.choice(odd)) if random.random() < 0.1 else float(x) for x in random.normal(0, 8, 11)
        ]
        frame, mask = int(random.choice((1, 7, 8, 9, 12))), int(random.integers(0, 4096))
        world.gcs.send(mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *numbers))
        if step % 25 == 0 or world.state.altitude_m < 8.0:  # well above the ground
            world.gcs.send(hover)
        world.run_for(0.02)
        held_on += world.state.mode == "OFFBOARD"
        q = world.engine.simulator.frame.state[6:10]
        steepest = max(steepest, math.acos(1.0 - 2.0 * float(q[1] ** 2 + q[2] ** 2)))
        fastest = max(fastest, float(np.linalg.norm(world.state.velocity_ned_m_s[:2])))
    assert held_on == 1500, world.texts
    assert fastest < 6.6  # 10 % above what the reference may do
    assert steepest < math.radians(47.0)  # MPC_TILTMAX_AIR and what the attitude loop overshoots
    world.set_mode("HOLD")
    world.run_for(8.0)
    assert np.linalg.norm(world.state.velocity_ned_m_s) < 0.02

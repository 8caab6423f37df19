"""Modes, refusals and automatic disarming, as an operator meets them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.commander.transitions import Event
from flightstack.mavlink.dialect import mavlink
from flightstack.testing import RefusedError
from tests.support.plan_items import item
from tests.support.refusals import refused
from tests.support.truth import World

REJECTED, DENIED, UNSUPPORTED = 1, 2, 3


@pytest.fixture
def hovering() -> World:
    world = World()
    world.arm()
    world.takeoff(4.0)
    world.run_until("mode == 'HOLD'")
    return world


def test_takeoff_climbs_to_the_altitude_and_holds(hovering: World) -> None:
    hovering.run_for(5.0)
    assert math.dist(hovering.state.position_ned_m, (0.0, 0.0, -4.0)) < 0.02
    assert np.linalg.norm(hovering.state.velocity_ned_m_s) < 0.02


def test_takeoff_without_altitude_uses_the_parameter() -> None:
    world = World(params={"MIS_TAKEOFF_ALT": 1.5})
    world.takeoff()
    world.arm()
    world.run_until("mode == 'HOLD'")
    world.run_for(4.0)
    assert world.state.altitude_m == pytest.approx(1.5, abs=0.02)


def test_land_ends_on_the_ground_and_disarms(hovering: World) -> None:
    hovering.land()
    hovering.run_until("not armed")
    assert abs(hovering.state.altitude_m) < 0.01
    assert hovering.state.mode == "HOLD"


def test_return_climbs_comes_home_and_lands() -> None:
    world = World(params={"RTL_RETURN_ALT": 8})
    world.upload([item(22, z=3.0), item(16, north=30.0, z=3.0), item(19, north=30.0, z=3.0, p1=60.0)])
    world.arm()
    world.start_mission()
    world.run_until(lambda _: world.reached[-1:] == [1])
    world.rtl()
    highest = 0.0
    while world.state.armed:
        world.run_for(0.1)
        highest = max(highest, world.state.altitude_m)
    assert highest == pytest.approx(8.0, abs=0.1)
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.1


def test_hold_stops_ahead_and_the_mission_goes_on_where_it_was(hovering: World) -> None:
    hovering.upload("square.plan")
    hovering.set_mode("MISSION")
    hovering.run_until(lambda _: 1 in hovering.reached)
    hovering.run_for(1.0)
    fast = hovering.state.velocity_ned_m_s
    assert np.linalg.norm(fast) > 1.0
    hovering.set_mode("HOLD")
    before = hovering.state.position_ned_m
    hovering.run_for(6.0)
    assert np.linalg.norm(hovering.state.velocity_ned_m_s) < 0.02
    # it stops ahead and does not come back: the way it went on is along its velocity
    assert np.dot(np.subtract(hovering.state.position_ned_m, before), fast) > 0.0
    hovering.set_mode("MISSION")
    hovering.run_until("not armed")
    assert hovering.reached == [0, 1, 2, 3, 4, 5]


def test_a_finished_mission_holds_where_it_ends() -> None:
    world = World()
    world.upload([item(22, z=2.0), item(16, north=5.0, z=2.0)])
    world.arm()
    world.start_mission()
    world.run_until("mode == 'HOLD'")
    world.run_for(5.0)
    assert world.state.armed
    assert math.dist(world.state.position_ned_m, (5.0, 0.0, -2.0)) < 0.05


def test_without_takeoff_the_vehicle_disarms_itself() -> None:
    world = World(params={"COM_DISARM_PRFLT": 5})
    world.arm()
    world.run_for(4.9)
    assert world.state.armed
    world.run_until("not armed", 1.0)


@pytest.mark.parametrize(
    ("story", "result", "reason"),
    [
        (lambda w: w.land(), REJECTED, "the vehicle is disarmed"),
        (lambda w: w.rtl(), REJECTED, "the vehicle is disarmed"),
        (lambda w: w.command(mavlink.MAV_CMD_MISSION_START), REJECTED, "no mission is loaded"),
        (lambda w: w.takeoff(0.1), REJECTED, "is too low"),
        (lambda w: w.takeoff(math.inf), DENIED, "not a number"),
        (lambda w: w.command(176, 1, 9, 9), DENIED, "no such mode"),
        (lambda w: w.command(176, math.nan, 4, 4), DENIED, "0 to 255"),
        (lambda w: w.command(400, 7), DENIED, "must be 0 (disarm) or 1 (arm)"),
        (lambda w: w.command(400, math.nan), DENIED, "must be 0 (disarm) or 1 (arm)"),
    ],
)
def test_refusals_say_why(story, result: int, reason: str) -> None:  # type: ignore[no-untyped-def]
    world = World()
    with refused(result, reason):
        story(world)
    assert not world.state.armed


def test_a_command_that_is_not_known_is_unsupported() -> None:
    with refused(UNSUPPORTED):
        World().command(31010, 1, 2, 3)


def test_disarming_in_the_air_needs_force(hovering: World) -> None:
    with refused(REJECTED, "the vehicle is in the air"):
        hovering.disarm()
    assert hovering.state.armed
    hovering.disarm(force=True)
    assert not hovering.state.armed
    hovering.run_for(0.2)
    assert float(np.abs(hovering.engine.stack.now.row[31:39]).max()) == 0.0


def test_a_second_takeoff_in_the_air_is_refused(hovering: World) -> None:
    with refused(REJECTED, "the vehicle is in the air"):
        hovering.takeoff(10.0)


def test_a_mission_that_begins_with_a_landing_does_not_start_on_the_ground() -> None:
    world = World()
    world.upload([item(21, z=0.0), item(16, north=5.0, z=3.0)])
    with refused(REJECTED, "continues with a landing"):
        world.command(mavlink.MAV_CMD_MISSION_START)


def test_a_tilted_vehicle_does_not_arm() -> None:
    world = World()
    world.engine.simulator.frame.state[6:10] = (math.cos(0.4), math.sin(0.4), 0.0, 0.0)
    world.engine.stack.simulator.state[:] = world.engine.simulator.frame.state
    with refused(REJECTED, "tilted by more than 30 degrees"):
        world.arm()


def test_a_refused_upload_leaves_the_mission_and_names_the_item() -> None:
    world = World()
    world.upload("square.plan")
    before = world.download()
    with pytest.raises(RefusedError, match="item 1"):
        world.upload([item(22, z=3.0), item(16, north=20_000.0, z=3.0)])
    assert world.download() == before


def test_a_state_that_is_not_finite_holds_the_rotors_and_is_reported(hovering: World) -> None:
    row = hovering.engine.stack.now.row.copy()
    for _ in range(10):  # two outer ticks: one sees the status of the loops of the one before
        hovering.engine.stack.simulator.state[11] = math.nan
        commands = hovering.engine.stack.autopilot.tick(hovering.engine.stack.simulator.time_us)
        assert np.array_equal(commands, row[31:39])
    hovering.run_for(0.05)
    assert any("not finite" in text for text in hovering.texts)


def test_reboot_is_denied_from_the_start_of_a_takeoff() -> None:
    world = World()
    world.arm()
    assert world.engine.stack.parts.requests.request(Event.SELECT_TAKEOFF) is None
    reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
    assert world.engine.stack.now.landed
    with refused(mavlink.MAV_RESULT_DENIED, "the vehicle is taking off"):
        world.command(reboot, 1.0)
    assert not world.engine.stack.ground.vehicle.reboot_requested

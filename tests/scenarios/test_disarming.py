"""When an armed vehicle is disarmed by time: never in a takeoff or while a mission waits, but always if it stays."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.testing import RefusedError, State
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.simulator import Simulator
from tests.support.plan_items import item
from tests.support.truth import World

OFF_GROUND_M = 0.15
"""Height at which the land detector says that the vehicle is in the air."""


def until_off_the_ground(world: World, limit_s: float = 60.0) -> None:
    """Fly until the land detector says takeoff, armed all the way."""

    def is_off(state: State) -> bool:
        assert state.armed, (state, world.texts)
        return not state.landed

    world.run_until(is_off, limit_s)


def offboard(world: World, **setpoint: float) -> None:
    """Stream a setpoint of position or velocity, and fly by it."""
    values = [setpoint.get(name, math.nan) for name in ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az")]
    world.gcs.streams["offboard"] = lambda: mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0, *values, math.nan, math.nan
    )
    world.run_for(0.2)
    world.set_mode("OFFBOARD")


def sticks(world: World, throttle: int) -> None:
    world.gcs.streams["sticks"] = lambda: mavlink.MAVLink_manual_control_message(1, 0, 0, throttle, 0, 0)


def laden(world: World, share: float) -> None:
    """Hang a payload of a share of the weight under the vehicle: a constant force, which guidance does not know."""
    vehicle = world.engine.stack.vehicle
    disturbance = Disturbance(force_ned_n=(0.0, 0.0, share * vehicle.weight_n))  # type: ignore[arg-type]
    world.engine.simulator = Simulator(vehicle, "rigid", PlantOptions(disturbance=disturbance, seed=1))
    world.engine.simulator.set_interval_us(world.engine.stack.rates.interval_us)


def test_a_takeoff_in_the_last_moment_is_not_cut() -> None:
    world = World(params={"COM_DISARM_PRFLT": 5})
    world.arm()
    world.run_for(4.95)
    world.takeoff(2.5)
    until_off_the_ground(world)


@pytest.mark.parametrize("time_out_s", [1, 5])
def test_a_slow_takeoff_is_not_cut(time_out_s: int) -> None:
    world = World(params={"COM_DISARM_PRFLT": time_out_s, "MPC_TKO_SPEED": 0.1})
    world.arm()
    world.run_for(0.9)
    world.takeoff(2.5)
    until_off_the_ground(world)


@pytest.mark.parametrize("climb_m_s", [0.01, 0.05])
def test_a_slow_offboard_climb_is_not_cut(climb_m_s: float) -> None:
    world = World(params={"COM_DISARM_PRFLT": 1})
    offboard(world, vx=0.0, vy=0.0, vz=-climb_m_s)
    world.arm()
    until_off_the_ground(world)


def test_a_vehicle_that_hovers_low_is_not_disarmed() -> None:
    world = World(params={"COM_DISARM_PRFLT": 2, "POS_Z_I": 0})
    laden(world, 0.03)
    offboard(world, x=0.0, y=0.0, z=-0.16)
    world.arm()
    world.run_for(10.0)
    assert world.state.armed
    assert 0.1 < world.state.altitude_m < OFF_GROUND_M


def test_a_throttle_that_rises_slowly_is_not_cut() -> None:
    world = World(vehicle="x_quad", params={"COM_DISARM_PRFLT": 3})
    sticks(world, 500)
    world.run_for(0.1)
    world.set_mode("POSITION")
    world.arm()
    world.run_for(2.9)
    sticks(world, 800)
    until_off_the_ground(world)


def test_a_payload_that_is_lifted_slowly_is_not_cut() -> None:
    world = World(vehicle="x_quad", params={"COM_DISARM_PRFLT": 2, "MPC_TKO_SPEED": 0.2})
    laden(world, 0.5)
    world.arm()
    world.run_for(1.9)
    world.takeoff(2.5)
    until_off_the_ground(world)


@pytest.mark.parametrize("wait_s", [4.0, 40.0])
def test_a_mission_that_waits_is_not_disarmed(wait_s: float) -> None:
    world = World(params={"COM_DISARM_PRFLT": 3})
    world.upload([item(93, p1=wait_s), item(22, z=3.0), item(21)])
    world.arm()
    world.start_mission()
    until_off_the_ground(world)
    assert world.time_s > wait_s
    world.run_until("not armed")
    assert world.reached == [0, 1, 2]


def test_a_mission_waits_on_the_ground_between_two_flights() -> None:
    world = World(params={"COM_DISARM_PRFLT": 3})
    world.upload([item(22, z=2.0), item(21), item(93, p1=10.0), item(22, z=2.0), item(21)])
    world.arm()
    world.start_mission()
    world.run_until("not armed")
    assert world.reached == [0, 1, 2, 3, 4]


def test_a_delay_counts_from_arming() -> None:
    world = World(params={"COM_DISARM_PRFLT": 3})
    world.upload([item(93, p1=8.0), item(22, z=3.0), item(21)])
    world.set_mode("MISSION")
    world.run_for(6.0)
    world.arm()
    armed_s = world.time_s
    until_off_the_ground(world)
    assert world.time_s - armed_s > 8.0


@pytest.mark.parametrize("limit_s", [2, 5])
def test_a_vehicle_too_heavy_to_take_off_is_disarmed(limit_s: int) -> None:
    world = World(vehicle="x_quad", params={"COM_DISARM_PRFLT": limit_s})
    laden(world, 5.0)
    world.arm()
    world.takeoff(2.5)
    world.run_until("not armed", limit_s + 6.0)
    world.run_for(0.1)
    assert "Disarmed: no takeoff" in world.texts


def test_a_mission_that_is_too_heavy_to_take_off_is_disarmed() -> None:
    world = World(vehicle="x_quad", params={"COM_DISARM_PRFLT": 3})
    laden(world, 5.0)
    world.upload([item(93, p1=5.0), item(22, z=3.0), item(21)])
    world.arm()
    world.start_mission()
    world.run_until("not armed", 5.0 + 3.0 + 6.0)
    world.run_for(0.1)
    assert "Disarmed: no takeoff" in world.texts


def test_a_mission_that_waits_for_ever_does_not_start() -> None:
    world = World()
    loop = replace(item(177, p1=0.0), param2=-1.0)
    world.upload([item(93, p1=5.0), loop, item(22, z=3.0)])
    world.arm()
    with pytest.raises(RefusedError, match="continues with a landing or a return"):
        world.start_mission()
    world.run_until("not armed", 31.0)


def test_a_time_out_of_zero_is_off() -> None:
    world = World(params={"COM_DISARM_PRFLT": 0, "COM_DISARM_LAND": 0})
    world.arm()
    world.run_for(40.0)
    assert world.state.armed
    world.takeoff(2.0)
    world.run_until("mode == 'HOLD'")
    world.land()
    world.run_until("landed")
    world.run_for(5.0)
    assert world.state.armed

"""What keeps a vehicle on the ground, as its operator meets it: sticks, ground stations, and reboots."""

from __future__ import annotations

import pytest

from flightstack.core.enums import Mode
from flightstack.mavlink.dialect import mavlink
from flightstack.process.assembly import transfer_state
from tests.support.failsafe_faults import cut_ground_station
from tests.support.refusals import refused
from tests.support.truth import World

DENIED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
CENTRE = 500


def with_throttle(mode: Mode, throttle: int) -> World:
    """A disarmed vehicle in a mode that is flown by sticks, whose throttle stands at 0 to 1000."""
    world = World(vehicle="x_quad")
    world.gcs.streams["sticks"] = lambda: mavlink.MAVLink_manual_control_message(1, 0, 0, throttle, 0, 0)
    world.run_for(0.1)
    world.set_mode(mode)
    return world


@pytest.mark.parametrize("mode", [Mode.POSITION, Mode.ALTITUDE])
@pytest.mark.parametrize("throttle", [1000, 650])
def test_a_throttle_that_is_up_keeps_the_vehicle_from_arming(mode: Mode, throttle: int) -> None:
    world = with_throttle(mode, throttle)
    with refused(DENIED, "the throttle is above the centre"):
        world.arm()
    world.run_for(3.0)
    assert not world.state.armed
    assert world.state.altitude_m < 0.05


@pytest.mark.parametrize("throttle", [0, CENTRE, 590])
def test_a_throttle_at_the_centre_or_below_arms_and_stays_on_the_ground(throttle: int) -> None:
    world = with_throttle(Mode.POSITION, throttle)
    world.arm()
    world.run_for(2.0)
    assert world.state.altitude_m < 0.05


def test_sticks_matter_only_in_modes_that_fly_by_them() -> None:
    world = with_throttle(Mode.POSITION, 1000)
    world.set_mode("HOLD")
    world.arm()


def test_no_ground_station_no_flight_if_its_loss_has_an_action() -> None:
    world = World(vehicle="x_quad", params={"NAV_DLL_ACT": 2})
    cut_ground_station(world)
    with refused(DENIED, "no ground station was heard"):
        world.arm()
    world.fault("link restore")
    world.run_for(1.1)
    world.arm()


def test_without_an_action_nobody_needs_to_be_heard() -> None:
    world = World(vehicle="x_quad", params={"NAV_DLL_ACT": 0})
    cut_ground_station(world)
    world.arm()


def test_an_action_that_is_chosen_in_the_air_needs_a_ground_station_too() -> None:
    world = World(vehicle="x_quad", params={"NAV_DLL_ACT": 0, "COM_FAIL_ACT_T": 0})
    cut_ground_station(world)
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'", 20.0)
    assert world.engine.stack.params.set("NAV_DLL_ACT", 3) is None
    world.run_until("mode == 'LAND'", 1.0)


def test_a_reboot_does_not_find_a_lost_ground_station_again() -> None:
    lost = World(vehicle="x_quad", params={"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5})
    lost.run_for(0.1)
    cut_ground_station(lost)
    lost.run_until(lambda _: lost.engine.stack.parts.failsafes.links.gcs_lost, 8.0)
    world = World(vehicle="x_quad", params={"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5})
    cut_ground_station(world)
    transfer_state(lost.engine.stack, world.engine.stack)
    with refused(DENIED, "ground station"):
        world.arm()


def test_a_vehicle_that_was_stopped_in_the_air_arms_as_one_that_stands() -> None:
    world = World()
    world.arm()
    world.takeoff(2.5)
    world.run_until("mode == 'HOLD'")
    world.disarm(force=True)
    world.run_for(5.0)  # it falls, jumps, and lies still
    world.texts.clear()
    world.arm()
    world.run_for(2.0)
    assert world.state.armed
    assert world.texts == ["Armed"]
    world.takeoff(2.5)
    world.run_until("altitude_m > 2.4")


@pytest.mark.parametrize("after_s", [0.05, 0.3, 1.0])
def test_a_falling_vehicle_does_not_arm(after_s: float) -> None:
    world = World()
    world.arm()
    world.takeoff(25.0)
    world.run_until("mode == 'HOLD'")
    world.disarm(force=True)
    world.run_for(after_s)
    assert world.state.altitude_m > 15.0
    with refused(DENIED, "the vehicle is falling or rising"):
        world.arm()
    world.run_for(10.0)
    world.arm()

"""What keeps a vehicle on the ground, as its operator meets it: sticks, ground stations, and reboots."""

from __future__ import annotations

import pytest

from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.mavlink.dialect import mavlink
from flightstack.process.assembly import transfer_state
from tests.support.world import World

DENIED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
CENTRE = 500


def with_throttle(mode: Mode, throttle: int) -> World:
    """A disarmed vehicle in a mode that is flown by sticks, whose throttle stands at 0 to 1000."""
    world = World(vehicle="x_quad")
    world.streams["sticks"] = lambda: mavlink.MAVLink_manual_control_message(1, 0, 0, throttle, 0, 0)
    world.run(0.1)
    custom = CUSTOM_MODE[mode]
    assert world.command(mavlink.MAV_CMD_DO_SET_MODE, 1, custom >> 16 & 0xFF, custom >> 24) == 0
    return world


@pytest.mark.parametrize("mode", [Mode.POSITION, Mode.ALTITUDE])
@pytest.mark.parametrize("throttle", [1000, 650])
def test_a_throttle_that_is_up_keeps_the_vehicle_from_arming(mode: Mode, throttle: int) -> None:
    world = with_throttle(mode, throttle)
    assert world.arm() == DENIED
    world.run(3.0)
    assert not world.armed
    assert world.altitude < 0.05
    assert any("the throttle is above the centre" in text for text in world.texts), world.texts


@pytest.mark.parametrize("throttle", [0, CENTRE, 590])
def test_a_throttle_at_the_centre_or_below_arms_and_stays_on_the_ground(throttle: int) -> None:
    world = with_throttle(Mode.POSITION, throttle)
    assert world.arm() == 0
    world.run(2.0)
    assert world.altitude < 0.05


def test_sticks_matter_only_in_modes_that_fly_by_them() -> None:
    world = with_throttle(Mode.POSITION, 1000)
    assert world.hold() == 0
    assert world.arm() == 0


def test_no_ground_station_no_flight_if_its_loss_has_an_action() -> None:
    world = World(vehicle="x_quad", params=["NAV_DLL_ACT=2"])
    world.sends_heartbeats = False
    assert world.arm() == DENIED
    world.run(0.1)
    assert any("no ground station was heard" in text for text in world.texts), world.texts
    world.sends_heartbeats = True
    assert world.arm() == 0


def test_without_an_action_nobody_needs_to_be_heard() -> None:
    world = World(vehicle="x_quad", params=["NAV_DLL_ACT=0"])
    world.sends_heartbeats = False
    assert world.arm() == 0


def test_an_action_that_is_chosen_in_the_air_needs_a_ground_station_too() -> None:
    world = World(vehicle="x_quad", params=["NAV_DLL_ACT=0", "COM_FAIL_ACT_T=0"])
    world.sends_heartbeats = False
    assert world.arm() == 0
    assert world.takeoff(3.0) == 0
    world.until(lambda: world.mode is Mode.HOLD, 20.0)
    assert world.stack.params.set("NAV_DLL_ACT", 3) is None
    world.until(lambda: world.mode is Mode.LAND, 1.0)


def test_a_reboot_does_not_find_a_lost_ground_station_again() -> None:
    lost = World(vehicle="x_quad", params=["NAV_DLL_ACT=2", "COM_DL_LOSS_T=5"])
    lost.run(0.1)
    lost.sends_heartbeats = False
    lost.until(lambda: lost.stack.parts.failsafes.links.gcs_lost, 8.0)
    world = World(vehicle="x_quad", params=["NAV_DLL_ACT=2", "COM_DL_LOSS_T=5"])
    world.sends_heartbeats = False
    transfer_state(lost.stack, world.stack)
    assert world.arm() == DENIED
    world.run(0.1)
    assert any("ground station" in text for text in world.texts), world.texts


def test_a_vehicle_that_was_stopped_in_the_air_arms_as_one_that_stands() -> None:
    world = World()
    assert world.arm() == 0
    assert world.takeoff(2.5) == 0
    world.until(lambda: world.mode is Mode.HOLD)
    assert world.disarm(force=True) == 0
    world.run(5.0)  # it falls, jumps, and lies still
    world.texts.clear()
    assert world.arm() == 0
    world.run(2.0)
    assert world.armed
    assert world.texts == ["Armed"]
    assert world.takeoff(2.5) == 0
    world.until(lambda: world.altitude > 2.4)


@pytest.mark.parametrize("after_s", [0.05, 0.3, 1.0])
def test_a_falling_vehicle_does_not_arm(after_s: float) -> None:
    world = World()
    assert world.arm() == 0
    assert world.takeoff(25.0) == 0
    world.until(lambda: world.mode is Mode.HOLD)
    assert world.disarm(force=True) == 0
    world.run(after_s)
    assert world.altitude > 15.0
    assert world.arm() == DENIED
    world.run(0.1)
    assert any("the vehicle is falling or rising" in text for text in world.texts), world.texts
    world.run(10.0)
    assert world.arm() == 0

"""Any mode may be selected while disarmed, as with PX4; arming then says what is missing."""

from __future__ import annotations

import math

import pytest

from flightstack.core.enums import CUSTOM_MODE, Mode
from flightstack.mavlink.dialect import mavlink
from tests.support.plan_items import item
from tests.support.refusals import refused
from tests.support.truth import World

SELECTABLE = [mode for mode in Mode if mode is not Mode.TERMINATION]
REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
ARMS_WITH = {
    Mode.HOLD: "",
    Mode.TAKEOFF: "",
    Mode.MISSION: "no mission is loaded",
    Mode.RETURN: "return mode cannot take off: select another mode first",
    Mode.LAND: "land mode cannot take off: select another mode first",
    Mode.POSITION: "no manual control is received",
    Mode.ALTITUDE: "no manual control is received",
    Mode.OFFBOARD: "no offboard setpoints are received",
}
"""What arming says in each mode of a vehicle that stands there with nothing but its state; empty: it arms."""


@pytest.mark.parametrize("mode", SELECTABLE)
def test_do_set_mode_takes_any_mode_and_arming_says_what_is_missing(mode: Mode) -> None:
    world = World()
    world.run_for(0.5)
    world.set_mode(mode)
    world.run_for(1.1)
    assert world.state.mode == mode.name
    assert world.gcs.received["HEARTBEAT"].custom_mode == CUSTOM_MODE[mode]
    prearm = (
        world.gcs.received["SYS_STATUS"].onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    )
    missing = ARMS_WITH[mode]
    assert bool(prearm) is not bool(missing)
    if missing:
        with refused(REJECTED, missing):
            world.arm()
    else:
        world.arm()
        world.run_for(0.1)
        assert "Armed" in world.texts
    assert world.state.armed is not bool(missing)


@pytest.mark.parametrize("mode", SELECTABLE)
def test_set_mode_takes_any_mode(mode: Mode) -> None:
    world = World()
    world.gcs.send(mavlink.MAVLink_set_mode_message(1, 1, CUSTOM_MODE[mode]))
    world.run_for(0.1)
    assert world.state.mode == mode.name
    world.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_CURRENT_MODE)
    now = world.gcs.received["CURRENT_MODE"]
    assert (now.custom_mode, now.intended_custom_mode) == (CUSTOM_MODE[mode], CUSTOM_MODE[mode])


@pytest.mark.parametrize("mode", SELECTABLE)
def test_a_mode_may_be_selected_before_there_is_a_state(mode: Mode) -> None:
    world = World()
    world.engine.stack.now.has_state = False
    world.engine.stack.simulator.state[:] = math.nan
    world.set_mode(mode)
    assert world.state.mode == mode.name
    with refused(REJECTED, "no valid position and attitude yet"):
        world.arm()


def test_a_mode_arms_as_soon_as_its_stream_is_there() -> None:
    world = World(vehicle="x_quad")
    world.set_mode("POSITION")
    with refused(REJECTED, "no manual control"):
        world.arm()
    world.gcs.streams["sticks"] = lambda: mavlink.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0)
    world.run_for(0.2)
    world.arm()
    assert world.state.mode == "POSITION"


def test_a_mission_may_come_after_its_mode() -> None:
    world = World()
    world.set_mode("MISSION")
    with refused(REJECTED, "no mission is loaded"):
        world.arm()
    world.upload([item(22, z=2.0), item(21)])
    world.arm()
    world.run_until("not armed")
    assert world.reached == [0, 1]


def test_a_mission_that_lands_first_does_not_arm() -> None:
    world = World()
    world.upload([item(21), item(16, north=5.0, z=3.0)])
    world.set_mode("MISSION")
    with refused(REJECTED, "continues with a landing"):
        world.arm()


def test_a_failsafe_of_the_last_flight_denies_no_mode() -> None:
    world = World(params={"COM_OBL_RC_ACT": 4, "COM_OF_LOSS_T": 0.3})
    values = (0.0, 0.0, -3.0, *[math.nan] * 8)
    world.gcs.streams["setpoint"] = lambda: mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0, *values
    )
    world.run_for(0.2)
    world.set_mode("OFFBOARD")
    world.arm()
    world.run_until("altitude_m > 2.0")
    del world.gcs.streams["setpoint"]
    world.run_until("not armed")
    assert any("Offboard setpoints lost" in text for text in world.texts), world.texts
    world.set_mode("OFFBOARD")
    world.set_mode("OFFBOARD")


def test_termination_is_no_mode_to_select() -> None:
    with refused(mavlink.MAV_RESULT_DENIED, "no such mode"):
        World().set_mode("TERMINATION")

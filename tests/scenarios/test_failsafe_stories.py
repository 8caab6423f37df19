"""Failsafes as an operator meets them: what is said, what can be overridden, and what comes together."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from pyulog import ULog

from flightstack.commander.failsafe import Action, Failsafe
from flightstack.core.enums import Mode
from flightstack.mavlink.dialect import mavlink
from tests.support.failsafe_faults import blow_away, breach_fence
from tests.support.failsafe_phases import QUICK, hold, landing, mission
from tests.support.streams import sticks
from tests.support.world import World, item


def flying(*params: str, **options: object) -> World:
    world = World(vehicle="x_quad", params=[*QUICK, *params], **options)  # type: ignore[arg-type]
    hold(world, lambda: None)
    return world


def lose_ground_station(world: World, limit_s: float = 8.0) -> None:
    world.sends_heartbeats = False
    world.until(lambda: world.stack.parts.failsafes.links.gcs_lost, limit_s)
    world.run(0.05)


@pytest.mark.parametrize(
    ("value", "end"),
    [
        (0, Mode.HOLD),
        (1, Mode.HOLD),
        (2, Mode.RETURN),
        (3, Mode.LAND),
        (5, Mode.TERMINATION),
        (6, None),
    ],
)
def test_each_value_of_nav_dll_act(value: int, end: Mode | None) -> None:
    world = flying(f"NAV_DLL_ACT={value}", "COM_DL_LOSS_T=5")
    lose_ground_station(world)
    world.run(1.0)
    if end is None:
        assert not world.armed
    else:
        assert world.mode is end


def test_the_wait_is_announced_and_the_return_follows() -> None:
    world = flying("NAV_DLL_ACT=2", "COM_DL_LOSS_T=5", "COM_FAIL_ACT_T=3")
    world.upload([item(22, z=6.0), item(16, north=200.0, z=6.0)])
    assert world.resume_mission() == 0
    lose_ground_station(world)
    assert world.mode is Mode.HOLD
    began_s = world.time_s
    world.until(lambda: world.mode is Mode.RETURN, 5.0)
    assert world.time_s - began_s == pytest.approx(3.0, abs=0.1)
    world.run(0.1)
    said = [text for text in world.texts if "ground station" in text.lower()]
    assert said == [
        "Ground station lost: holding, returning in 3 s",
        "Failsafe: returning (ground station lost)",
    ]


def test_a_ground_station_that_comes_back_in_time_finds_the_vehicle_holding() -> None:
    world = flying("NAV_DLL_ACT=2", "COM_DL_LOSS_T=5", "COM_FAIL_ACT_T=3")
    lose_ground_station(world)
    world.sends_heartbeats = True
    world.run(10.0)
    assert world.mode is Mode.HOLD
    assert "Ground station is back" in world.texts


def test_a_user_takes_over_and_is_left_alone() -> None:
    world = flying("COM_LOW_BAT_ACT=3")
    world.inject("battery:level=0.06")
    world.until(lambda: world.mode is Mode.RETURN, 3.0)
    assert world.hold() == 0
    world.run(3.0)
    assert world.mode is Mode.HOLD
    world.inject("battery:level=0.04")  # worse: that is a new one
    world.until(lambda: world.mode is Mode.LAND, 3.0)


def test_a_return_becomes_a_landing_as_the_battery_empties() -> None:
    world = flying("COM_LOW_BAT_ACT=3", "NAV_DLL_ACT=2", "COM_DL_LOSS_T=5", "RTL_RETURN_ALT=30")
    lose_ground_station(world)
    world.until(lambda: world.mode is Mode.RETURN, 3.0)
    world.inject("battery:level=0.04")
    world.until(lambda: world.mode is Mode.LAND, 1.0)  # who returns is not made to wait
    world.until_disarmed(40.0)
    world.run(0.1)
    assert world.position[0] > 5.0
    assert world.stack.parts.failsafes.active == ()


def test_a_breach_far_from_the_setpoint_lands() -> None:
    """The fence says return; but who cannot hold a place cannot go home."""
    world = flying("GF_ACTION=3", "FS_POS_ERR_T=0.05", "COM_FAIL_ACT_T=0")
    blow_away(world)
    breach_fence(world)
    world.until(lambda: world.mode is Mode.LAND, 0.2)
    assert {Failsafe.FENCE, Failsafe.POSITION_ERROR} == set(world.stack.parts.failsafes.active)


@pytest.mark.parametrize(
    ("value", "mode"),
    [(0, Mode.POSITION), (1, Mode.ALTITUDE), (3, Mode.RETURN), (4, Mode.LAND), (5, Mode.HOLD), (6, Mode.TERMINATION)],
)  # fmt: skip
def test_each_value_of_com_obl_rc_act_with_sticks(value: int, mode: Mode) -> None:
    world = flying(f"COM_OBL_RC_ACT={value}", "COM_OF_LOSS_T=0.2", "COM_RC_LOSS_T=5")
    north, east, down = world.position.tolist()
    world.streams["sticks"] = sticks
    world.streams["setpoint"] = lambda: mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0b110111111000, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0
    )
    world.run(0.2)
    assert world.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6, 0) == 0
    world.run(0.2)
    assert world.mode is Mode.OFFBOARD
    del world.streams["setpoint"]
    world.run(1.0)
    assert world.mode is mode


# ---------------------------------------------------------------------- states


def test_a_frozen_state_is_noticed_and_survived() -> None:
    """The rotors hold their speeds while nothing is known, and the mission goes on after that."""
    world = World(vehicle="x_quad", params=[*QUICK, "FS_STALE_T=0.1", "FS_BLIND_T=2"])
    mission(world, lambda: None)
    now_s = world.simulator.time_us * 1e-6
    world.inject(f"state:freeze@{now_s:.3f}-{now_s + 0.3:.3f}")
    world.run(0.15)
    assert world.stack.parts.failsafes.decision.action is Action.BLIND
    held = world.stack.now.row[31:39].copy()
    world.run(0.1)
    assert np.array_equal(world.stack.now.row[31:39], held)
    world.run(3.0)
    assert world.mode is Mode.MISSION
    assert "State is frozen or missing: rotors hold their speeds" in world.texts
    assert "State is fresh again" in world.texts
    assert abs(world.altitude - 6.0) < 0.5  # 0.2 m seen: it fell 1.4 m and is still settling


def test_a_frozen_state_ends_the_flight_in_time() -> None:
    world = World(vehicle="x_quad", params=[*QUICK, "FS_STALE_T=0.1", "FS_BLIND_T=1"])
    mission(world, lambda: None)
    world.inject("state:freeze")
    world.until(lambda: world.mode is Mode.TERMINATION, 1.2)


def test_in_a_long_calm_a_state_may_stay_the_same() -> None:
    """What does not move need not change; a freeze is noticed when the vehicle should be moving."""
    world = flying()
    world.run(45.0)
    assert np.abs(world.velocity).max() < 1e-9
    world.inject("state:freeze")
    world.run(0.7)
    assert not any("frozen" in text for text in world.texts)


def test_a_standing_vehicle_is_not_frozen() -> None:
    world = World(vehicle="x_quad", params=["COM_DISARM_PRFLT=-1"])
    assert world.arm() == 0
    world.run(20.0)
    assert world.armed


@pytest.mark.parametrize("vehicle", ["x_quad", "paper_quad"])
def test_wind_and_gusts_are_no_fault(vehicle: str) -> None:
    """No detector triggers in a hard flight; the largest errors seen are 0.6 of the limits."""
    world = World(vehicle=vehicle, drag=vehicle == "paper_quad", wind=(6.0, 3.0, 0.0), gust=1.5, seed=3)
    world.upload("square.plan")
    assert world.start_mission() == 0
    world.until_disarmed(200.0)
    assert not any(
        rule in text for text in world.texts for rule in ("beyond", "far from", "rotor", "Failsafe")
    )


# ---------------------------------------------------------------------- termination


def test_a_commanded_termination_is_final() -> None:
    world = flying()
    assert world.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1) == 0
    world.run(3.0)
    assert world.mode is Mode.TERMINATION
    assert not world.armed
    assert world.altitude < 0.5
    assert world.arm() == 1
    assert world.takeoff(3.0) == 1
    assert "Flight terminated: commanded" in world.texts
    assert any("reboot" in text for text in world.texts)
    assert world.received["HEARTBEAT"].custom_mode == 10 << 16


@pytest.mark.parametrize("value", [0.0, math.nan, 0.5])
def test_a_termination_needs_its_one(value: float) -> None:
    world = flying()
    assert world.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, value) == 2
    assert world.armed


# ---------------------------------------------------------------------- arming, log


def test_arming_is_refused_with_every_reason_and_shown_in_sys_status() -> None:
    world = World(vehicle="x_quad", params=["GF_ACTION=2"])
    world.run(0.3)
    bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert world.received["SYS_STATUS"].onboard_control_sensors_health & bit
    breach_fence(world)
    world.inject("battery:level=0.1")
    world.run(1.5)
    assert not world.received["SYS_STATUS"].onboard_control_sensors_health & bit
    assert world.arm() == 1
    world.run(0.05)
    (text,) = [text for text in world.texts if "battery" in text]
    assert "the battery is low: 10% left" in text
    assert "outside the geofence" in text


def test_the_log_tells_of_the_failsafe() -> None:
    world = flying("COM_LOW_BAT_ACT=3")
    world.inject("battery:level=0.06")
    world.until_disarmed(40.0)
    log = ULog(io.BytesIO(world.log))
    (status,) = [data for data in log.data_list if data.name == "vehicle_status"]
    assert status.data["failsafe"].max() == 1
    messages = [message.message for message in log.logged_messages]
    assert "Failsafe: returning (battery level is critical)" in messages


def test_the_same_failsafe_gives_the_same_log() -> None:
    def fly() -> bytes:
        world = flying("COM_LOW_BAT_ACT=3", gust=1.0, wind=(2.0, 0.0, 0.0))
        world.inject("battery:level=0.04")
        world.until_disarmed(40.0)
        return world.log

    assert fly() == fly()


def test_a_failsafe_in_a_landing_lets_it_end() -> None:
    world = World(vehicle="x_quad", params=[*QUICK, "COM_LOW_BAT_ACT=3", "GF_ACTION=3"])
    landing(world, lambda: None)
    world.inject("battery:level=0.06")
    breach_fence(world)
    world.until_disarmed(30.0)
    assert world.position[0] > 5.0


def test_a_landing_in_wind_does_not_lean_on_the_ground() -> None:
    """Contact is detected 0.4 s after the touch here, and the vehicle is level 0.3 s later: the lean is for the air."""
    world = World(vehicle="x_quad", wind=(5.0, 0.0, 0.0), gust=0.5, seed=2)
    assert world.arm() == 0
    assert world.takeoff(3.0) == 0
    world.until(lambda: world.mode is Mode.HOLD, 20.0)
    assert world.land() == 0
    world.until(lambda: world.altitude < 0.03, 30.0)
    touched_s = world.time_s
    world.run(0.5)
    while not world.landed:
        world.run(0.01)
        q = world.stack.now.attitude_target
        assert max(abs(q[1]), abs(q[2])) < 0.01  # 0.006 seen
        assert world.time_s - touched_s < 1.5  # 0.8 s seen
    assert max(abs(q[1]), abs(q[2])) < 1e-3  # 2e-4 seen
    assert abs(world.altitude) < 0.01


def test_an_empty_battery_stops_the_rotors_and_nobody_says_that_they_follow_again() -> None:
    world = World()
    world.arm()
    world.takeoff(20.0)
    world.until(lambda: world.mode is Mode.HOLD)
    world.inject("battery:level=0")
    world.run(1.5)  # falling still
    assert world.altitude > 2.0
    assert any("A rotor does not follow its command" in text for text in world.texts), world.texts
    world.run(4.0)
    assert not any("All rotors follow" in text for text in world.texts), world.texts

"""Failsafes as an operator meets them: what is said, what can be overridden, and what comes together."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping

import numpy as np
import pytest
from pyulog import ULog

from flightstack.commander.failsafe import Action, Failsafe
from flightstack.core.enums import Mode
from flightstack.mavlink.dialect import mavlink
from tests.support.failsafe_faults import blow_away, breach_fence, cut_ground_station
from tests.support.failsafe_phases import QUICK, hold, landing, mission
from tests.support.plan_items import item
from tests.support.refusals import refused
from tests.support.streams import sticks
from tests.support.truth import World

REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def flying(air: Mapping[str, object] = {}, **params: float) -> World:
    world = World(vehicle="x_quad", params={**QUICK, **params}, **air)
    hold(world, lambda: None)
    return world


def lose_ground_station(world: World, limit_s: float = 8.0) -> None:
    cut_ground_station(world)
    world.run_until(lambda _: world.engine.stack.parts.failsafes.links.gcs_lost, limit_s)
    world.run_for(0.05)


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
    world = flying(NAV_DLL_ACT=value, COM_DL_LOSS_T=5)
    lose_ground_station(world)
    world.run_for(1.0)
    if end is None:
        assert not world.state.armed
    else:
        assert world.state.mode == end.name


def test_the_wait_is_announced_and_the_return_follows() -> None:
    world = flying(NAV_DLL_ACT=2, COM_DL_LOSS_T=5, COM_FAIL_ACT_T=3)
    world.upload([item(22, z=6.0), item(16, north=200.0, z=6.0)])
    world.set_mode("MISSION")
    lose_ground_station(world)
    assert world.state.mode == "HOLD"
    began_s = world.time_s
    world.run_until("mode == 'RETURN'", 5.0)
    assert world.time_s - began_s == pytest.approx(3.0, abs=0.1)
    world.run_for(0.1)
    said = [text for text in world.texts if "ground station" in text.lower()]
    assert said == [
        "Ground station lost: holding, returning in 3 s",
        "Failsafe: returning (ground station lost)",
    ]


def test_a_ground_station_that_comes_back_in_time_finds_the_vehicle_holding() -> None:
    world = flying(NAV_DLL_ACT=2, COM_DL_LOSS_T=5, COM_FAIL_ACT_T=3)
    lose_ground_station(world)
    world.fault("link restore")
    world.run_for(10.0)
    assert world.state.mode == "HOLD"
    assert "Ground station is back" in world.texts


def test_a_user_takes_over_and_is_left_alone() -> None:
    world = flying(COM_LOW_BAT_ACT=3)
    world.fault("battery:level=0.06")
    world.run_until("mode == 'RETURN'", 3.0)
    world.set_mode("HOLD")
    world.run_for(3.0)
    assert world.state.mode == "HOLD"
    world.fault("battery:level=0.04")  # worse: that is a new one
    world.run_until("mode == 'LAND'", 3.0)


def test_a_return_becomes_a_landing_as_the_battery_empties() -> None:
    world = flying(COM_LOW_BAT_ACT=3, NAV_DLL_ACT=2, COM_DL_LOSS_T=5, RTL_RETURN_ALT=30)
    lose_ground_station(world)
    world.run_until("mode == 'RETURN'", 3.0)
    world.fault("battery:level=0.04")
    world.run_until("mode == 'LAND'", 1.0)  # who returns is not made to wait
    world.run_until("not armed", 40.0)
    world.run_for(0.1)
    assert world.state.north_m > 5.0
    assert world.engine.stack.parts.failsafes.active == ()


def test_a_breach_far_from_the_setpoint_lands() -> None:
    """The fence says return; but who cannot hold a place cannot go home."""
    world = flying(GF_ACTION=3, FS_POS_ERR_T=0.05, COM_FAIL_ACT_T=0)
    blow_away(world)
    breach_fence(world)
    world.run_until("mode == 'LAND'", 0.2)
    assert {Failsafe.FENCE, Failsafe.POSITION_ERROR} == set(world.engine.stack.parts.failsafes.active)


@pytest.mark.parametrize(
    ("value", "mode"),
    [(0, Mode.POSITION), (1, Mode.ALTITUDE), (3, Mode.RETURN), (4, Mode.LAND), (5, Mode.HOLD), (6, Mode.TERMINATION)],
)  # fmt: skip
def test_each_value_of_com_obl_rc_act_with_sticks(value: int, mode: Mode) -> None:
    world = flying(COM_OBL_RC_ACT=value, COM_OF_LOSS_T=0.2, COM_RC_LOSS_T=5)
    north, east, down = world.state.position_ned_m
    world.gcs.streams["sticks"] = sticks
    world.gcs.streams["setpoint"] = lambda: mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 1, 0b110111111000, north, east, down, 0, 0, 0, 0, 0, 0, 0, 0
    )
    world.run_for(0.2)
    world.set_mode("OFFBOARD")
    world.run_for(0.2)
    assert world.state.mode == "OFFBOARD"
    del world.gcs.streams["setpoint"]
    world.run_for(1.0)
    assert world.state.mode == mode.name


# ---------------------------------------------------------------------- states


def test_a_frozen_state_is_noticed_and_survived() -> None:
    """The rotors hold their speeds while nothing is known, and the mission goes on after that."""
    world = World(vehicle="x_quad", params={**QUICK, "FS_STALE_T": 0.1, "FS_BLIND_T": 2})
    mission(world, lambda: None)
    world.fault("state:freeze", for_s=0.3)
    world.run_for(0.15)
    assert world.engine.stack.parts.failsafes.decision.action is Action.BLIND
    held = world.engine.stack.now.row[31:39].copy()
    world.run_for(0.1)
    assert np.array_equal(world.engine.stack.now.row[31:39], held)
    world.run_for(3.0)
    assert world.state.mode == "MISSION"
    assert "State is frozen or missing: rotors hold their speeds" in world.texts
    assert "State is fresh again" in world.texts
    assert abs(world.state.altitude_m - 6.0) < 0.5  # 0.2 m seen: it fell 1.4 m and is still settling


def test_a_frozen_state_ends_the_flight_in_time() -> None:
    world = World(vehicle="x_quad", params={**QUICK, "FS_STALE_T": 0.1, "FS_BLIND_T": 1})
    mission(world, lambda: None)
    world.fault("state:freeze")
    world.run_until("mode == 'TERMINATION'", 1.2)


def test_in_a_long_calm_a_state_may_stay_the_same() -> None:
    """What does not move need not change; a freeze is noticed when the vehicle should be moving."""
    world = flying()
    world.run_for(45.0)
    assert np.abs(world.state.velocity_ned_m_s).max() < 1e-9
    world.fault("state:freeze")
    world.run_for(0.7)
    assert not any("frozen" in text for text in world.texts)


def test_a_standing_vehicle_is_not_frozen() -> None:
    world = World(vehicle="x_quad", params={"COM_DISARM_PRFLT": -1})
    world.arm()
    world.run_for(20.0)
    assert world.state.armed


@pytest.mark.parametrize("vehicle", ["x_quad", "paper_quad"])
def test_wind_and_gusts_are_no_fault(vehicle: str) -> None:
    """No detector triggers in a hard flight; the largest errors seen are 0.6 of the limits."""
    world = World(vehicle=vehicle, drag=vehicle == "paper_quad", wind=(6.0, 3.0, 0.0), gust=1.5, seed=3)
    world.upload("square.plan")
    world.arm()
    world.start_mission()
    world.run_until("not armed", 200.0)
    assert not any(
        rule in text for text in world.texts for rule in ("beyond", "far from", "rotor", "Failsafe")
    )


# ---------------------------------------------------------------------- termination


def test_a_commanded_termination_is_final() -> None:
    world = flying()
    world.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1)
    world.run_for(3.0)
    assert world.state.mode == "TERMINATION"
    assert not world.state.armed
    assert world.state.altitude_m < 0.5
    with refused(REJECTED, "reboot"):
        world.arm()
    with refused(REJECTED):
        world.takeoff(3.0)
    assert "Flight terminated: commanded" in world.texts
    assert world.gcs.received["HEARTBEAT"].custom_mode == 10 << 16


@pytest.mark.parametrize("value", [0.0, math.nan, 0.5])
def test_a_termination_needs_its_one(value: float) -> None:
    world = flying()
    with refused(mavlink.MAV_RESULT_DENIED):
        world.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, value)
    assert world.state.armed


# ---------------------------------------------------------------------- arming, log


def test_arming_is_refused_with_every_reason_and_shown_in_sys_status() -> None:
    world = World(vehicle="x_quad", params={"GF_ACTION": 2})
    world.run_for(0.3)
    bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert world.gcs.received["SYS_STATUS"].onboard_control_sensors_health & bit
    breach_fence(world)
    world.fault("battery:level=0.1")
    world.run_for(1.5)
    assert not world.gcs.received["SYS_STATUS"].onboard_control_sensors_health & bit
    with refused(REJECTED):
        world.arm()
    world.run_for(0.05)
    (text,) = [text for text in world.texts if "battery" in text]
    assert "the battery is low: 10% left" in text
    assert "outside the geofence" in text


def test_the_log_tells_of_the_failsafe() -> None:
    world = flying(COM_LOW_BAT_ACT=3)
    world.fault("battery:level=0.06")
    world.run_until("not armed", 40.0)
    log = ULog(io.BytesIO(world.flight().log.content))
    (status,) = [data for data in log.data_list if data.name == "vehicle_status"]
    assert status.data["failsafe"].max() == 1
    messages = [message.message for message in log.logged_messages]
    assert "Failsafe: returning (battery level is critical)" in messages


def test_the_same_failsafe_gives_the_same_log() -> None:
    def fly() -> bytes:
        world = flying({"gust": 1.0, "wind": (2.0, 0.0)}, COM_LOW_BAT_ACT=3)
        world.fault("battery:level=0.04")
        world.run_until("not armed", 40.0)
        return world.flight().log.content

    assert fly() == fly()


def test_a_failsafe_in_a_landing_lets_it_end() -> None:
    world = World(vehicle="x_quad", params={**QUICK, "COM_LOW_BAT_ACT": 3, "GF_ACTION": 3})
    landing(world, lambda: None)
    world.fault("battery:level=0.06")
    breach_fence(world)
    world.run_until("not armed", 30.0)
    assert world.state.north_m > 5.0


def test_a_landing_in_wind_does_not_lean_on_the_ground() -> None:
    """Contact is detected 0.4 s after the touch here, and the vehicle is level 0.3 s later: the lean is for the air."""
    world = World(vehicle="x_quad", wind=(5.0, 0.0, 0.0), gust=0.5, seed=2)
    world.arm()
    world.takeoff(3.0)
    world.run_until("mode == 'HOLD'", 20.0)
    world.land()
    world.run_until("altitude_m < 0.03", 30.0)
    touched_s = world.time_s
    world.run_for(0.5)
    while not world.state.landed:
        world.run_for(0.01)
        q = world.engine.stack.now.attitude_target
        assert max(abs(q[1]), abs(q[2])) < 0.01  # 0.006 seen
        assert world.time_s - touched_s < 1.5  # 0.8 s seen
    assert max(abs(q[1]), abs(q[2])) < 1e-3  # 2e-4 seen
    assert abs(world.state.altitude_m) < 0.01


def test_an_empty_battery_stops_the_rotors_and_nobody_says_that_they_follow_again() -> None:
    world = World()
    world.arm()
    world.takeoff(20.0)
    world.run_until("mode == 'HOLD'")
    world.fault("battery:level=0")
    world.run_for(1.5)  # falling still
    assert world.state.altitude_m > 2.0
    assert any("A rotor does not follow its command" in text for text in world.texts), world.texts
    world.run_for(4.0)
    assert not any("All rotors follow" in text for text in world.texts), world.texts

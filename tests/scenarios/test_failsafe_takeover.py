"""Who may take the vehicle back from a failsafe: a person who decides so, no program that repeats itself."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.commander.failsafe import Action, Failsafe
from flightstack.core.enums import Mode
from flightstack.plan import MissionType
from flightstack.testing import RefusedError
from tests.support.failsafe_faults import blow_away, cut_ground_station, inject, tip_over
from tests.support.fence_breaches import (
    BRAKING,
    RADIUS,
    farthest_until,
    fly_goto,
    fly_mission,
    fly_offboard,
    fly_sticks,
    hovering,
    until_breach,
)
from tests.support.plan_items import circle, item
from tests.support.refusals import refused
from tests.support.streams import go_to
from tests.support.truth import World

REJECTED = 1


def insist(world: World, seconds: float, every_s: float = 0.5) -> list[bool]:
    """Select OFFBOARD repeatedly, as companions do; return whether the flying vehicle accepted each time."""
    answers, began_s = [], world.time_s
    for number in range(1, round(seconds / every_s) + 1):
        flies = world.state.armed  # a disarmed vehicle takes any mode
        try:
            world.set_mode("OFFBOARD")
        except RefusedError:
            accepted = False
        else:
            accepted = True
        answers += [accepted] if flies else []
        world.run_for(began_s + number * every_s - world.time_s)
    return answers


@pytest.mark.parametrize(("every_s", "delay"), [(0.5, 0.5), (0.5, 5.0), (5.0, 5.0)])
def test_a_companion_that_repeats_offboard_does_not_undo_the_fence(every_s: float, delay: float) -> None:
    world = hovering(GF_ACTION=5, COM_FAIL_ACT_T=delay)
    world.run_for(0.1)
    until_breach(world, fly_offboard)
    answers = insist(world, 20.0, every_s)
    assert not any(answers)
    assert world.state.mode == "LAND" or not world.state.armed
    assert world.state.north_m < RADIUS + BRAKING
    assert any("ask again" in text for text in world.texts), world.texts


def test_a_companion_does_not_get_its_mode_back_once_the_return_is_inside() -> None:
    world = hovering(GF_ACTION=3)
    until_breach(world, fly_offboard)
    farthest_until(world, lambda _: any(insist(world, 0.5)) or not world.state.armed)
    assert not world.state.armed
    assert np.linalg.norm(world.state.position_ned_m[:2]) < 0.6


def test_a_program_that_repeats_its_goto_does_not_undo_the_fence() -> None:
    world = hovering(GF_ACTION=2)
    go_to(world, 60.0, 0.0, 6.0)
    world.run_for(1.0)
    wall = [circle((30.0, 0.0), 10.0, inclusion=False)]
    world.upload(wall, MissionType.FENCE)
    for _ in range(30):
        with pytest.raises(RefusedError, match="geofence"):
            go_to(world, 60.0, 0.0, 6.0)
        world.run_for(1.0)
    assert world.state.mode == "HOLD"
    assert world.state.north_m < 20.0 + BRAKING


def test_a_pilot_takes_over_after_the_wait_and_the_fence_acts_again_farther_out() -> None:
    world = hovering(GF_ACTION=2, MPC_VEL_MANUAL=4, COM_FAIL_ACT_T=5)
    until_breach(world, fly_sticks)
    world.run_for(1.0)
    with refused(REJECTED, "ask again in 10 s"):
        world.set_mode("POSITION")  # the stick is still forward
    world.run_for(11.0)
    world.set_mode("POSITION")
    world.run_for(0.1)
    assert world.state.mode == "POSITION"
    far = farthest_until(world, lambda state: state.mode == "HOLD", 10.0)
    assert far < RADIUS + BRAKING + 6.0
    world.run_for(0.1)
    assert sum(text.startswith("Geofence breached") for text in world.texts) == 2


def test_another_mode_is_a_users_choice_at_once() -> None:
    world = hovering(GF_ACTION=3, COM_FAIL_ACT_T=5)
    until_breach(world, fly_mission)
    world.run_for(1.0)
    world.set_mode("HOLD")
    world.run_for(8.0)
    assert world.state.mode == "HOLD"  # the return never came
    go_to(world, 0.0, 0.0, 6.0)
    world.run_until("north_m < 5.0", 30.0)


def test_an_emergency_landing_is_not_for_discussion() -> None:
    world = hovering(COM_LOW_BAT_ACT=3)
    fly_offboard(world)
    world.run_for(1.0)
    inject("battery:level=0.04")(world)
    world.run_until("mode != 'OFFBOARD'", 2.0)
    assert not any(insist(world, 1.0))
    with refused(REJECTED, "battery level is dangerously low: landing"):
        world.set_mode("HOLD")
    world.land()
    world.run_until("not armed", 30.0)
    assert world.state.altitude_m < 0.05


def test_nobody_prolongs_blindness() -> None:
    """Modes are refused while no state can be flown by, and the rotors stop in time."""
    world = hovering(FS_BLIND_T=1)
    world.run_for(0.5)
    inject("state:nan")(world)
    world.run_for(0.5)
    assert world.engine.stack.parts.failsafes.decision.action is Action.BLIND
    with refused(REJECTED, "no valid position"):
        world.set_mode("HOLD")
    with refused(REJECTED, "no valid position"):
        world.land()
    world.run_until("mode == 'TERMINATION'", 1.0)


def test_a_cleared_mission_is_no_users_choice() -> None:
    world = hovering(GF_ACTION=1)
    until_breach(world, fly_mission)
    world.upload([])
    assert world.state.mode == "HOLD"
    assert world.engine.stack.parts.failsafes.overridden == ()
    assert Failsafe.FENCE in world.engine.stack.parts.failsafes.active


def test_a_companion_comes_back_after_its_link() -> None:
    """A stream that was lost and is back may be flown again at once."""
    world = hovering(COM_OBL_RC_ACT=5, COM_OF_LOSS_T=0.3)
    fly_offboard(world)
    world.run_for(1.0)
    stream = world.gcs.streams.pop("setpoint")
    world.run_until("mode == 'HOLD'", 2.0)
    with refused(REJECTED, "offboard setpoints lost"):
        world.set_mode("OFFBOARD")
    world.gcs.streams["setpoint"] = stream
    world.run_for(0.3)
    world.set_mode("OFFBOARD")


def test_a_lost_ground_station_stops_a_goto() -> None:
    world = hovering(NAV_DLL_ACT=1, COM_DL_LOSS_T=5, COM_FAIL_ACT_T=5)
    fly_goto(world)
    world.run_for(2.0)
    cut_ground_station(world)
    world.run_until(lambda _: Failsafe.GCS_LOST in world.engine.stack.parts.failsafes.active, 8.0)
    north = world.state.north_m
    world.run_for(8.0)
    assert np.abs(world.state.velocity_ned_m_s).max() < 0.05
    assert world.state.north_m < north + BRAKING


def test_a_wait_stops_a_goto_before_it_returns() -> None:
    world = hovering(COM_LOW_BAT_ACT=3, COM_FAIL_ACT_T=5)
    fly_goto(world)
    world.run_for(3.0)
    inject("battery:level=0.06")(world)
    north = world.state.north_m
    world.run_for(4.5)
    assert world.state.mode == "HOLD"
    assert world.state.north_m < north + BRAKING + 1.0
    world.run_until("mode == 'RETURN'", 1.0)


# ---------------------------------------------------------------------- other values of the parameters


@pytest.mark.parametrize(
    ("value", "end"),
    [(1, Mode.HOLD), (2, Mode.RETURN), (3, Mode.LAND), (5, Mode.TERMINATION), (6, None)],
)
def test_each_value_of_nav_rcl_act(value: int, end: Mode | None) -> None:
    world = hovering(NAV_RCL_ACT=value, COM_RC_LOSS_T=0.5)
    fly_sticks(world)
    world.run_for(2.0)
    del world.gcs.streams["sticks"]
    world.run_for(2.0)
    assert not world.state.armed if end is None else world.state.mode == end.name
    if end in (Mode.RETURN, Mode.LAND):
        world.run_until("not armed", 40.0)
        assert (float(np.linalg.norm(world.state.position_ned_m[:2])) < 0.6) == (end is Mode.RETURN)
    elif end is Mode.HOLD:
        world.run_for(4.0)
        assert np.abs(world.state.velocity_ned_m_s).max() < 0.05


@pytest.mark.parametrize(
    ("value", "end"),
    [(0, Mode.HOLD), (2, Mode.LAND), (4, Mode.TERMINATION)],
)
def test_each_value_of_fs_pos_act(value: int, end: Mode) -> None:
    world = hovering(FS_POS_ACT=value, FS_POS_ERR_T=0.1)
    world.run_for(1.0)
    blow_away(world)
    world.run_for(0.5)
    assert world.state.mode == end.name
    assert any(text.startswith("Position is far from its setpoint") for text in world.texts)
    if end is Mode.LAND:
        world.run_until("not armed", 40.0)
        assert 25.0 < world.state.east_m < 35.0


@pytest.mark.parametrize(
    ("value", "end"),
    [(0, Mode.MISSION), (2, Mode.LAND), (4, Mode.TERMINATION)],
)
def test_each_value_of_fs_att_act(value: int, end: Mode) -> None:
    world = hovering(FS_ATT_ACT=value, FD_FAIL_R_TTRI=0.02)
    world.upload([item(22, z=30.0), item(16, north=200.0, z=30.0)])
    world.set_mode("MISSION")
    world.run_until("north_m > 3.0", 40.0)
    tip_over(world)
    world.run_for(0.1)
    assert world.state.mode == end.name
    assert any(text.startswith("Attitude is beyond its limits") for text in world.texts), world.texts
    if end is not Mode.TERMINATION:  # it rights itself, and does what was chosen
        world.run_for(6.0)
        q = world.engine.simulator.frame.state[6:10]
        assert 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2) > 0.95
        assert world.state.mode == end.name


def test_arming_forgets_what_was_taken() -> None:
    world = hovering(GF_ACTION=5)
    until_breach(world, fly_offboard)
    insist(world, 2.0)
    world.gcs.streams.clear()
    world.run_until("not armed", 40.0)
    world.upload([], MissionType.FENCE)
    world.arm()
    world.takeoff(6.0)
    world.run_until("mode == 'HOLD'", 15.0)
    fly_offboard(world)
    assert world.state.mode == "OFFBOARD"

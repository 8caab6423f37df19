"""Who may take the vehicle back from a failsafe: a person who decides so, no program that repeats itself."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.commander.failsafe import Action, Failsafe
from flightstack.core.enums import Mode
from flightstack.plan import MissionType
from gcs_cli.clients.mission_client import Done
from tests.support.failsafe_faults import blow_away, inject, tip_over
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
from tests.support.fences import circle
from tests.support.streams import go_to, select
from tests.support.world import World, item

ACCEPTED, REJECTED = 0, 1


def insist(world: World, seconds: float, every_s: float = 0.5) -> list[int | None]:
    """Ask for OFFBOARD again and again, as companions do; return the answers that a flying vehicle gave."""
    answers = []
    for _ in range(round(seconds / every_s)):
        flies = world.armed  # a disarmed vehicle takes any mode
        answer = select(world, 6)
        answers += [answer] if flies else []
        world.run(every_s)
    return answers


@pytest.mark.parametrize(("every_s", "delay"), [(0.5, 0.5), (0.5, 5.0), (5.0, 5.0)])
def test_a_companion_that_repeats_offboard_does_not_undo_the_fence(every_s: float, delay: float) -> None:
    world = hovering("GF_ACTION=5", f"COM_FAIL_ACT_T={delay}")
    world.run(0.1)
    until_breach(world, fly_offboard)
    answers = insist(world, 20.0, every_s)
    assert ACCEPTED not in answers
    assert world.mode is Mode.LAND or not world.armed
    assert world.position[0] < RADIUS + BRAKING
    assert any("ask again" in text for text in world.texts), world.texts


def test_a_companion_does_not_get_its_mode_back_once_the_return_is_inside() -> None:
    world = hovering("GF_ACTION=3")
    until_breach(world, fly_offboard)
    farthest_until(world, lambda: insist(world, 0.5) == [ACCEPTED] or not world.armed)
    assert not world.armed
    assert np.linalg.norm(world.position[:2]) < 0.6


def test_a_program_that_repeats_its_goto_does_not_undo_the_fence() -> None:
    world = hovering("GF_ACTION=2")
    assert go_to(world, 60.0, 0.0, 6.0) == ACCEPTED
    world.run(1.0)
    wall = [circle((30.0, 0.0), 10.0, inclusion=False)]
    assert isinstance(world.upload(wall, MissionType.FENCE), Done)
    for _ in range(30):
        go_to(world, 60.0, 0.0, 6.0)
        world.run(1.0)
    assert world.mode is Mode.HOLD
    assert world.position[0] < 20.0 + BRAKING


def test_a_pilot_takes_over_after_the_wait_and_the_fence_acts_again_farther_out() -> None:
    world = hovering("GF_ACTION=2", "MPC_VEL_MANUAL=4", "COM_FAIL_ACT_T=5")
    until_breach(world, fly_sticks)
    world.run(1.0)
    assert select(world, 3) == REJECTED  # the stick is still forward
    world.run(11.0)
    assert select(world, 3) == ACCEPTED
    world.run(0.1)
    assert world.mode is Mode.POSITION
    far = farthest_until(world, lambda: world.mode is Mode.HOLD, 10.0)
    assert far < RADIUS + BRAKING + 6.0
    world.run(0.1)
    assert sum(text.startswith("Geofence breached") for text in world.texts) == 2


def test_another_mode_is_a_users_choice_at_once() -> None:
    world = hovering("GF_ACTION=3", "COM_FAIL_ACT_T=5")
    until_breach(world, fly_mission)
    world.run(1.0)
    assert world.hold() == ACCEPTED
    world.run(8.0)
    assert world.mode is Mode.HOLD  # the return never came
    assert go_to(world, 0.0, 0.0, 6.0) == ACCEPTED
    world.until(lambda: world.position[0] < 5.0, 30.0)


def test_an_emergency_landing_is_not_for_discussion() -> None:
    world = hovering("COM_LOW_BAT_ACT=3")
    fly_offboard(world)
    world.run(1.0)
    inject("battery:level=0.04")(world)
    world.until(lambda: world.mode is not Mode.OFFBOARD, 2.0)
    assert ACCEPTED not in insist(world, 1.0)
    assert world.hold() == REJECTED
    world.run(0.1)
    assert any(text.endswith("battery level is dangerously low: landing") for text in world.texts), (
        world.texts
    )
    assert world.land() == ACCEPTED
    world.until_disarmed(30.0)
    assert world.altitude < 0.05


def test_nobody_prolongs_blindness() -> None:
    """Modes may be chosen while nothing can be flown by; the rotors stop in time all the same."""
    world = hovering("FS_BLIND_T=1")
    world.run(0.5)
    inject("state:nan")(world)
    world.run(0.5)
    assert world.stack.parts.failsafes.decision.action is Action.BLIND
    world.hold()
    world.land()
    world.until(lambda: world.mode is Mode.TERMINATION, 1.0)


def test_a_cleared_mission_is_no_users_choice() -> None:
    world = hovering("GF_ACTION=1")
    until_breach(world, fly_mission)
    world.upload([])
    assert world.mode is Mode.HOLD
    assert world.stack.parts.failsafes.overridden == ()
    assert Failsafe.FENCE in world.stack.parts.failsafes.active


def test_a_companion_comes_back_after_its_link() -> None:
    """A stream that was lost and is back may be flown again at once."""
    world = hovering("COM_OBL_RC_ACT=5", "COM_OF_LOSS_T=0.3")
    fly_offboard(world)
    world.run(1.0)
    stream = world.streams.pop("setpoint")
    world.until(lambda: world.mode is Mode.HOLD, 2.0)
    assert select(world, 6) == REJECTED
    world.streams["setpoint"] = stream
    world.run(0.3)
    assert select(world, 6) == ACCEPTED


def test_a_lost_ground_station_stops_a_goto() -> None:
    world = hovering("NAV_DLL_ACT=1", "COM_DL_LOSS_T=5", "COM_FAIL_ACT_T=5")
    fly_goto(world)
    world.run(2.0)
    world.sends_heartbeats = False
    world.until(lambda: Failsafe.GCS_LOST in world.stack.parts.failsafes.active, 8.0)
    north = world.position[0]
    world.run(8.0)
    assert np.abs(world.velocity).max() < 0.05
    assert world.position[0] < north + BRAKING


def test_a_wait_stops_a_goto_before_it_returns() -> None:
    world = hovering("COM_LOW_BAT_ACT=3", "COM_FAIL_ACT_T=5")
    fly_goto(world)
    world.run(3.0)
    inject("battery:level=0.06")(world)
    north = world.position[0]
    world.run(4.5)
    assert world.mode is Mode.HOLD
    assert world.position[0] < north + BRAKING + 1.0
    world.until(lambda: world.mode is Mode.RETURN, 1.0)


# ---------------------------------------------------------------------- other values of the parameters


@pytest.mark.parametrize(
    ("value", "end"),
    [(1, Mode.HOLD), (2, Mode.RETURN), (3, Mode.LAND), (5, Mode.TERMINATION), (6, None)],
)
def test_each_value_of_nav_rcl_act(value: int, end: Mode | None) -> None:
    world = hovering(f"NAV_RCL_ACT={value}", "COM_RC_LOSS_T=0.5")
    fly_sticks(world)
    world.run(2.0)
    del world.streams["sticks"]
    world.run(2.0)
    assert not world.armed if end is None else world.mode is end
    if end in (Mode.RETURN, Mode.LAND):
        world.until_disarmed(40.0)
        assert (float(np.linalg.norm(world.position[:2])) < 0.6) == (end is Mode.RETURN)
    elif end is Mode.HOLD:
        world.run(4.0)
        assert np.abs(world.velocity).max() < 0.05


@pytest.mark.parametrize(
    ("value", "end"),
    [(0, Mode.HOLD), (2, Mode.LAND), (4, Mode.TERMINATION)],
)
def test_each_value_of_fs_pos_act(value: int, end: Mode) -> None:
    world = hovering(f"FS_POS_ACT={value}", "FS_POS_ERR_T=0.1")
    world.run(1.0)
    blow_away(world)
    world.run(0.5)
    assert world.mode is end
    assert any(text.startswith("Position is far from its setpoint") for text in world.texts)
    if end is Mode.LAND:
        world.until_disarmed(40.0)
        assert 25.0 < world.position[1] < 35.0


@pytest.mark.parametrize(
    ("value", "end"),
    [(0, Mode.MISSION), (2, Mode.LAND), (4, Mode.TERMINATION)],
)
def test_each_value_of_fs_att_act(value: int, end: Mode) -> None:
    world = hovering(f"FS_ATT_ACT={value}", "FD_FAIL_R_TTRI=0.02")
    world.upload([item(22, z=30.0), item(16, north=200.0, z=30.0)])
    assert world.resume_mission() == ACCEPTED
    world.until(lambda: world.position[0] > 3.0, 40.0)
    tip_over(world)
    world.run(0.1)
    assert world.mode is end
    assert any(text.startswith("Attitude is beyond its limits") for text in world.texts), world.texts
    if end is not Mode.TERMINATION:  # it rights itself, and does what was chosen
        world.run(6.0)
        q = world.simulator.frame.state[6:10]
        assert 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2) > 0.95
        assert world.mode is end


def test_arming_forgets_what_was_taken() -> None:
    world = hovering("GF_ACTION=5")
    until_breach(world, fly_offboard)
    insist(world, 2.0)
    world.streams.clear()
    world.until_disarmed(40.0)
    assert isinstance(world.upload([], MissionType.FENCE), Done)
    assert world.arm() == ACCEPTED, world.texts
    assert world.takeoff(6.0) == ACCEPTED
    world.until(lambda: world.mode is Mode.HOLD, 15.0)
    fly_offboard(world)
    assert world.mode is Mode.OFFBOARD

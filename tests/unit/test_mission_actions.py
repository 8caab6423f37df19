"""Pause, resume and jump: what is sent to each autopilot, and when they are done."""

from __future__ import annotations

from typing import Any

import pytest

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.link import Address, Link
from gcs_cli.actions.action import Action, NotReadyError
from gcs_cli.actions.in_flight import hold, start_mission
from gcs_cli.actions.in_mission import jump, pause, resume
from gcs_cli.actions.run import ActionRun
from gcs_cli.autopilots.autopilot import Role
from gcs_cli.clients.command_client import MESSAGE_TRIES
from gcs_cli.vehicle.view_types import MISSION_COMPLETE, Identity, Mission, Vector, VehicleView

PX4 = Identity(1, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4)
ARDUPILOT = PX4._replace(autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)


def view_in(role: Role, identity: Identity = PX4, *, armed: bool = True) -> VehicleView:
    """A standing vehicle in the mode of a role."""
    view = VehicleView(identity=identity, armed=armed, velocity_ned_m_s=Vector(0.0, 0.0, 0.0))
    mode = view.autopilot.role_mode(role, view.vehicle_type)
    assert mode is not None
    return view._replace(custom_mode=mode, mode=view.autopilot.mode_name(view.vehicle_type, mode))


@pytest.mark.parametrize("identity", [PX4, ARDUPILOT])
@pytest.mark.parametrize(("action", "before", "after"), [
    (pause(), Role.MISSION, Role.HOLD),
    (resume(), Role.HOLD, Role.MISSION),
])  # fmt: skip
def test_pause_and_resume_change_the_mode(
    identity: Identity, action: Action, before: Role, after: Role
) -> None:
    start, end = view_in(before, identity), view_in(after, identity)
    (step,) = action.plan(start)
    assert step.command == start.autopilot.select_mode(end.custom_mode)
    assert step.effect is not None
    assert (step.effect(start), step.effect(end)) == (False, True)


def test_jump_is_done_when_the_vehicle_reports_the_item() -> None:
    for identity, number in ((PX4, 3), (ARDUPILOT, 4)):
        view = view_in(Role.MISSION, identity)
        (step,) = jump(3).plan(view)
        assert step.command.params == (float(number),)
        assert step.effect is not None
        assert not step.effect(view)
        assert step.effect(view._replace(mission=Mission(current=3)))


def jump_messages(current_after: int) -> int:
    """Return how often jump(3) sends MISSION_SET_CURRENT before the vehicle reports ``current_after``, and later."""
    before = view_in(Role.MISSION)
    views = [before._replace(mission=Mission(current=1))]
    own = Address(255, 190)
    run = ActionRun(jump(3), lambda: views[0], 0.0, own)
    assert [message.get_type() for message in run.poll(0.0)] == ["COMMAND_LONG"]
    ack = mavlink.MAVLink_command_ack_message(
        mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, mavlink.MAV_RESULT_UNSUPPORTED, 0, 0, *own
    )
    (received,) = Link(*own).decode(Link(1, 1).encode(ack))
    run.receive(received, 0.0)
    sent = []
    for tenth in range(100):
        sent += run.poll(tenth / 10)
        views[0] = before._replace(mission=Mission(current=current_after))
    return [message.get_type() for message in sent].count("MISSION_SET_CURRENT")


def test_jump_repeats_its_message_a_few_times() -> None:
    assert jump_messages(current_after=1) == MESSAGE_TRIES


def test_jump_past_an_item_that_is_no_waypoint_is_not_repeated() -> None:
    assert jump_messages(current_after=4) == 1


@pytest.mark.parametrize(
    ("action", "view", "reason"),
    [
        (pause(), view_in(Role.HOLD), "does not fly a mission: it is in mode HOLD"),
        (pause(), view_in(Role.MISSION, armed=False), "it is disarmed"),
        (resume(), view_in(Role.HOLD, armed=False), "use `gcs mission start`"),
    ],
)
def test_pause_and_resume_need_a_mission_in_flight(action: Action, view: VehicleView, reason: str) -> None:
    with pytest.raises(NotReadyError, match=reason):
        action.plan(view)


def test_a_complete_mission_is_started_again_not_resumed() -> None:
    view = view_in(Role.HOLD)
    view = view._replace(mission=view.mission._replace(state=MISSION_COMPLETE))
    with pytest.raises(NotReadyError, match="the mission is complete: `gcs mission start` flies it again"):
        resume().plan(view)


@pytest.mark.parametrize("state", [
    {"mission": Mission(current=0, total=2)},
    {"mission": Mission(current=1, total=2, state=MISSION_COMPLETE)},
    {"can_arm": False},
    {"armed": True},
])  # fmt: skip
def test_start_advises_a_jump_only_where_the_current_item_can_be_the_reason(state: dict[str, Any]) -> None:
    late = view_in(Role.HOLD, armed=False)._replace(mission=Mission(current=1, total=2))
    assert "`gcs mission jump 0`" in start_mission().plan(late)[-1].advice
    assert not start_mission().plan(late._replace(**state))[-1].advice


def test_hold_needs_a_known_speed() -> None:
    (step,) = hold().plan(view_in(Role.HOLD))
    assert step.effect is not None
    assert step.effect(view_in(Role.HOLD))
    assert not step.effect(view_in(Role.HOLD)._replace(velocity_ned_m_s=None))

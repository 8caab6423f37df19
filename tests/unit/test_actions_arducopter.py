"""Actions on ArduCopter: altitudes above home, BRAKE for a hold, arming in GUIDED, and the effects that it reports."""

from __future__ import annotations

import pytest

from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions import in_flight, in_mission, on_vehicle
from gcs_cli.actions.action import Action
from gcs_cli.actions.conditions import parse_condition
from gcs_cli.actions.run import ActionRun, Outcome, Result
from gcs_cli.link.session import Session
from gcs_cli.vehicle.view_types import VehicleView
from tests.support.fake_arducopter import AUTO, BRAKE, GUIDED, LOITER, RELATIVE, STABILIZE, FakeArduCopter

PEER = ("10.0.0.1", 14550)
STEP_S, LIMIT_S = 0.05, 200.0


class Rig:
    """A session and the vehicle in memory, in simulated time."""

    def __init__(self, vehicle: FakeArduCopter | None = None, boot_s: float = 2.0) -> None:
        self.vehicle = vehicle or FakeArduCopter()
        self.session = Session()
        self.now_s = 0.0
        self.run_for(boot_s)

    @property
    def view(self) -> VehicleView:
        return self.session.view

    def step(self) -> None:
        self.now_s += STEP_S
        for frame in self.session.poll(self.now_s):
            self.vehicle.receive(frame)
        for frame in self.vehicle.advance(self.now_s):
            self.session.receive(frame, PEER, self.now_s)

    def run_for(self, time_s: float) -> None:
        for _ in range(round(time_s / STEP_S)):
            self.step()

    def perform(self, action: Action, *, waits: bool = True) -> Result:
        run = ActionRun(action, lambda: self.view, self.now_s, self.session.own, waits=waits)
        self.session.use(run)
        end_s = self.now_s + LIMIT_S
        while run.result is None and self.now_s < end_s:
            self.step()
        self.session.use(None)
        assert run.result is not None
        return run.result

    def flying(self) -> Rig:
        assert self.perform(in_flight.takeoff(10.0)).ok
        self.vehicle.commands.clear()
        return self


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_streams_are_requested_from_ardupilot(rig: Rig) -> None:
    assert rig.view.attitude is not None
    assert rig.view.geo is not None
    assert rig.view.time_s is not None


def test_streams_are_requested_again_after_a_reboot(rig: Rig) -> None:
    rig.run_for(20.0)
    assert rig.perform(on_vehicle.reboot())[:2] == (Outcome.DONE, "rebooted")
    before_s = rig.view.time_s
    rig.run_for(5.0)
    assert (rig.view.time_s or 0.0) > (before_s or 0.0) + 3.0


def test_takeoff_goes_to_an_altitude_above_home_armed_in_guided(rig: Rig) -> None:
    result = rig.perform(in_flight.takeoff(6.0))
    assert result[:2] == (Outcome.DONE, "at 6 m")
    assert rig.vehicle.commands[-1] == (mavlink.MAV_CMD_NAV_TAKEOFF, RELATIVE)
    rig.run_for(20.0)
    assert (rig.vehicle.mode, rig.vehicle.altitude_m) == (GUIDED, pytest.approx(6.0))


def test_takeoff_without_an_altitude_is_not_sent(rig: Rig) -> None:
    result = rig.perform(in_flight.takeoff())
    assert result[:2] == (
        Outcome.IMPOSSIBLE,
        "takeoff: ArduPilot has no default altitude: give one with --alt",
    )
    assert not rig.vehicle.armed


def test_takeoff_that_is_not_flown_is_not_reported_as_done() -> None:
    rig = Rig(FakeArduCopter(ignores_takeoff=True))
    result = rig.perform(in_flight.takeoff(6.0))
    assert result.outcome is Outcome.NOT_SEEN
    assert result.sentence == (
        "takeoff: the vehicle acknowledged, but is not at that altitude and has not moved for 15 s"
    )


def test_refused_arming_gives_the_vehicles_reason(rig: Rig) -> None:
    rig.vehicle.has_position = False
    assert rig.perform(on_vehicle.arm())[:2] == (Outcome.REFUSED, "arming refused: Need Position Estimate")


def test_ready_follows_the_prearm_check(rig: Rig) -> None:
    ready = parse_condition("ready")
    assert ready.holds(rig.view)
    rig.vehicle.has_position = False
    rig.run_for(1.0)
    assert not ready.holds(rig.view)


def test_hold_selects_brake_and_says_so_when_it_stands(rig: Rig) -> None:
    rig.flying()
    assert rig.perform(in_flight.hold())[:2] == (Outcome.DONE, "holding the position")
    assert rig.vehicle.mode == BRAKE


def test_goto_is_a_command_int_above_home(rig: Rig) -> None:
    rig.flying()
    result = rig.perform(in_flight.goto(47.3979, 8.5456, 15.0))
    assert result.outcome is Outcome.DONE
    assert rig.vehicle.commands == [(mavlink.MAV_CMD_DO_REPOSITION, RELATIVE)]
    assert (rig.vehicle.altitude_m, rig.vehicle.north_m) == (
        pytest.approx(15.0),
        pytest.approx(17.6, abs=1.0),
    )


def test_goto_without_an_altitude_keeps_the_present_one(rig: Rig) -> None:
    rig.flying()
    assert rig.perform(in_flight.goto(47.3979, 8.5456)).ok
    assert rig.vehicle.altitude_m == pytest.approx(10.0, abs=0.5)


def test_goto_of_a_disarmed_vehicle_is_not_sent(rig: Rig) -> None:
    result = rig.perform(in_flight.goto(47.3979, 8.5456, 15.0))
    assert result[:2] == (Outcome.REFUSED, "goto: the vehicle is disarmed: take off first")
    assert rig.vehicle.mode == STABILIZE


def test_yaw_selects_guided_first_and_ends_at_the_heading(rig: Rig) -> None:
    rig.flying()
    rig.perform(in_flight.hold())
    assert rig.perform(in_flight.yaw(90.0))[:2] == (Outcome.DONE, "pointing to 90 degrees")
    assert rig.vehicle.mode == GUIDED
    assert rig.vehicle.heading_deg == pytest.approx(90.0, abs=3.1)


def test_speed_is_refused_outside_its_modes_and_has_no_default(rig: Rig) -> None:
    rig.flying()
    assert rig.perform(in_flight.speed(3.0)).outcome is Outcome.ACKNOWLEDGED
    assert rig.perform(in_flight.speed(None)).outcome is Outcome.IMPOSSIBLE
    rig.perform(in_flight.hold())
    assert rig.perform(in_flight.speed(3.0)).sentence == (
        "speed refused: not possible in mode BRAKE, only in AUTO, GUIDED, RTL"
    )


@pytest.mark.parametrize("action", [in_flight.land(), in_flight.return_to_launch()], ids=["land", "rtl"])
def test_landings_end_when_the_vehicle_has_disarmed(rig: Rig, action: Action) -> None:
    rig.flying()
    result = rig.perform(action)
    assert result.outcome is Outcome.DONE
    assert not rig.vehicle.armed
    assert result.elapsed_s == pytest.approx(4.5, abs=1.0)  # 10 m at 2.5 m/s, and a heartbeat


def test_an_action_ends_when_another_mode_takes_over(rig: Rig) -> None:
    rig.flying()
    action = in_flight.land()
    run = ActionRun(action, lambda: rig.view, rig.now_s, rig.session.own)
    rig.session.use(run)
    rig.run_for(1.5)
    rig.vehicle.mode = LOITER
    rig.run_for(1.5)
    assert run.result is not None
    assert run.result[:2] == (Outcome.ENDED, "land: the vehicle changed to mode LOITER")


def test_mission_start_arms_in_guided_because_auto_is_not_armable(rig: Rig) -> None:
    assert rig.perform(in_flight.start_mission())[:2] == (Outcome.DONE, "mission started")
    assert (rig.vehicle.mode, rig.vehicle.armed) == (AUTO, True)


def test_mission_start_of_a_vehicle_that_cannot_arm_is_refused(rig: Rig) -> None:
    rig.vehicle.has_position = False
    result = rig.perform(in_flight.start_mission())
    assert result.outcome is Outcome.REFUSED
    assert not rig.vehicle.armed


def test_set_home_ends_when_the_vehicle_reports_it(rig: Rig) -> None:
    assert rig.perform(on_vehicle.set_home())[:2] == (Outcome.DONE, "home is the present position")
    assert rig.view.home is not None


def test_termination_ends_when_the_vehicle_has_disarmed(rig: Rig) -> None:
    rig.flying()
    assert rig.perform(on_vehicle.terminate())[:2] == (Outcome.DONE, "flight terminated")


def test_without_waiting_an_action_ends_with_the_acknowledgement(rig: Rig) -> None:
    result = rig.perform(in_flight.takeoff(6.0), waits=False)
    assert result[:2] == (Outcome.ACKNOWLEDGED, "taking off to 6 m")
    assert rig.vehicle.altitude_m < 1.0


def test_injection_is_refused_with_the_answer(rig: Rig) -> None:
    result = rig.perform(on_vehicle.inject_failure("motor", "off", 1))
    assert result[:2] == (
        Outcome.REFUSED,
        "failure injection refused: the vehicle answered MAV_RESULT_UNSUPPORTED",
    )
    assert rig.perform(on_vehicle.inject_failure("wing", "off")).outcome is Outcome.IMPOSSIBLE


def test_modes_are_named_by_arducopters_names(rig: Rig) -> None:
    assert rig.view.mode == "STABILIZE"
    assert rig.perform(on_vehicle.select_mode("alt-hold"))[:2] == (Outcome.DONE, "mode alt-hold")
    assert rig.view.mode == "ALT_HOLD"


def test_reboot_soon_after_boot_waits_until_its_restart_can_be_seen() -> None:
    """Its first message after the restart came at 1.2 s, later than the last one before: no restart was seen."""
    rig = Rig(boot_s=0.8)
    rig.vehicle.streams_after_boot = True
    assert rig.perform(on_vehicle.reboot())[:2] == (Outcome.DONE, "rebooted")


def test_reboot_waits_for_the_time_of_a_vehicle_heard_only_by_its_heartbeat() -> None:
    """With the first heartbeat alone, no time heard counted as a clock that stands: it ended before the restart."""
    rig = Rig(boot_s=STEP_S)
    rig.vehicle.streams_after_boot = True
    assert (rig.view.identity is not None, rig.view.time_s) == (True, None)
    result = rig.perform(on_vehicle.reboot())
    assert result[:2] == (Outcome.DONE, "rebooted")
    assert rig.view.restarts == 1


def test_reboot_of_a_vehicle_without_a_clock_says_that_its_restart_is_not_seen() -> None:
    rig = Rig(FakeArduCopter(has_streams=False))
    assert rig.perform(on_vehicle.reboot())[:2] == (
        Outcome.ACKNOWLEDGED,
        "accepted: rebooting; its clock does not run, so that its restart is not seen",
    )
    assert [command for command, _ in rig.vehicle.commands] == [mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN]


def test_reboot_without_an_answer_is_sent_once(rig: Rig) -> None:
    rig.vehicle.unanswered = {mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN}
    rig.run_for(20.0)
    rig.vehicle.commands.clear()
    assert rig.perform(on_vehicle.reboot())[:2] == (Outcome.DONE, "rebooted")
    rig.run_for(10.0)
    assert rig.vehicle.commands == [(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, None)]


def test_hold_is_not_done_while_the_vehicle_moves(rig: Rig) -> None:
    rig.flying()
    for velocity in ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)):
        rig.vehicle.velocity_ned_m_s = velocity
        rig.run_for(1.0)
        assert rig.perform(in_flight.hold()).outcome is Outcome.NOT_SEEN


def test_takeoff_is_not_done_on_ground_above_the_altitude() -> None:
    rig = Rig(FakeArduCopter(ignores_takeoff=True))
    rig.vehicle.rise_of_ground_m = 10.0
    rig.run_for(1.0)
    assert rig.view.relative_altitude_m == 10.0
    assert rig.perform(in_flight.takeoff(6.0)).outcome is Outcome.NOT_SEEN


def test_takeoff_in_the_air_is_not_sent(rig: Rig) -> None:
    rig.flying()
    result = rig.perform(in_flight.takeoff(5.0))
    assert result[:2] == (
        Outcome.REFUSED,
        "takeoff: the vehicle is in the air: give the new altitude to goto",
    )
    assert rig.vehicle.commands == []


@pytest.mark.parametrize("action", [in_flight.land(), in_flight.return_to_launch()], ids=["land", "rtl"])
def test_landings_end_when_the_vehicle_disarms_in_the_air(rig: Rig, action: Action) -> None:
    rig.flying()
    run = ActionRun(action, lambda: rig.view, rig.now_s, rig.session.own)
    rig.session.use(run)
    rig.run_for(1.5)
    rig.vehicle.armed = False
    rig.run_for(5.0)
    assert run.result is not None
    assert run.result[:2] == (Outcome.ENDED, f"{action.name}: the vehicle disarmed in the air")


def test_landing_is_done_if_the_landed_state_follows_the_disarm(rig: Rig) -> None:
    """ArduCopter disarms at touchdown, and EXTENDED_SYS_STATE comes up to 0.5 s after the heartbeat."""
    rig.flying()
    run = ActionRun(in_flight.land(), lambda: rig.view, rig.now_s, rig.session.own)
    rig.session.use(run)
    rig.run_for(1.5)
    rig.vehicle.armed = False
    rig.run_for(1.05)
    assert (rig.view.armed, rig.view.on_ground, run.result) == (False, False, None)
    rig.vehicle.altitude_m = 0.0
    rig.run_for(0.5)
    assert run.result is not None
    assert run.result.outcome is Outcome.DONE


def test_landing_is_done_if_the_reports_of_its_end_were_lost(rig: Rig) -> None:
    """A receiver loses 3 s of telemetry after the disarm; the next datagram has the clock, not the landed state."""
    rig.flying()
    run = ActionRun(in_flight.land(), lambda: rig.view, rig.now_s, rig.session.own)
    rig.session.use(run)
    rig.run_for(1.5)
    rig.vehicle.armed = False
    rig.run_for(1.05)
    rig.vehicle.altitude_m = 0.0
    rig.now_s += 3.0
    rig.vehicle.advance(rig.now_s)
    rig.now_s += 0.3
    for frame in rig.vehicle.advance(rig.now_s):
        rig.session.receive(frame, PEER, rig.now_s)
        rig.session.poll(rig.now_s)
    assert run.result is not None
    assert run.result[:2] == (Outcome.DONE, "landed and disarmed")


def test_jump_is_a_message_to_a_vehicle_without_the_command(rig: Rig) -> None:
    rig.vehicle.unsupported.add(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT)
    assert rig.perform(in_mission.jump(2))[:2] == (Outcome.DONE, "item 2 is the current one")
    assert rig.vehicle.current_item == 3
    assert rig.perform(in_mission.jump(0))[:2] == (Outcome.DONE, "item 0 is the current one")
    assert rig.vehicle.current_item == 1
    assert rig.perform(in_mission.jump(2)).ok
    result = rig.perform(in_mission.jump(9))
    assert result[:2] == (Outcome.REFUSED, "mission jump refused: item is not in the list")
    assert rig.vehicle.current_item == 3


def test_mode_numbers_select_modes_that_the_vehicle_has(rig: Rig) -> None:
    assert rig.perform(on_vehicle.select_mode("4"))[:2] == (Outcome.DONE, "mode 4")
    assert rig.view.mode == "GUIDED"
    assert rig.perform(on_vehicle.select_mode("99")).outcome is Outcome.IMPOSSIBLE

"""The ground station's flight state machine against a scripted vehicle, in memory and in simulated time."""

from __future__ import annotations

import pytest

from flightstack.plan import RALLY_POINT, FenceCommand, Frame, MissionItem, MissionType
from gcs_cli.errors import DONE, FAILED, NO_ANSWER
from gcs_cli.fly.flight import Phase
from gcs_cli.fly.flight_watch import STALL_S
from gcs_cli.fly.fly_display import phase_words
from gcs_cli.report.flight_outcome import Code, Outcome, outcome_of
from gcs_cli.vehicle.view_types import StatusText, VehicleView
from tests.support.fake_vehicle import ARM, RETURN, SHUT_DOWN, START, FakeVehicle
from tests.support.flight_story import STEP_S, TAKEOFF, WAYPOINT, Story

CIRCLE = MissionItem(FenceCommand.CIRCLE_INCLUSION, Frame.GLOBAL, param1=50.0, x=473977420, y=85455940)
RALLY = MissionItem(RALLY_POINT, Frame.GLOBAL_RELATIVE_ALT, x=473977420, y=85455940, z=5.0)


def test_a_mission_is_flown_to_its_end() -> None:
    story = Story(FakeVehicle()).run()
    assert (story.outcome, story.code) == (Code.COMPLETED, DONE)
    assert [item.command for item in story.vehicle.items] == [22, 16, 21]
    assert story.orders == [ARM, START, SHUT_DOWN]
    assert story.flight.shut_down_accepted
    assert story.flight.flown_s == pytest.approx(15.0)
    assert story.flight.began_s is not None
    assert story.flight.ended_s is not None
    assert story.flight.began_s < story.flight.ended_s < story.now_s


def test_geofence_and_rally_points_go_before_the_mission_that_is_checked_against_them() -> None:
    story = Story(FakeVehicle(), fence=(CIRCLE,), rally=(RALLY, RALLY)).run(until=Phase.UPLOAD)
    assert story.flight.upload_progress == (0, 6)
    story.run()
    assert story.outcome is Code.COMPLETED
    plans = story.vehicle.plans
    assert [item.command for item in plans[MissionType.FENCE]] == [CIRCLE.command]
    assert [item.command for item in plans[MissionType.RALLY]] == [RALLY_POINT] * 2
    assert [item.command for item in plans[MissionType.MISSION]] == [22, 16, 21]
    counts = [name for name in story.vehicle.heard if name == "MISSION_COUNT"]
    assert len(counts) == 3
    assert story.vehicle.uploaded == [MissionType.FENCE, MissionType.RALLY, MissionType.MISSION]
    assert story.flight.upload_progress == (6, 6)


@pytest.mark.parametrize(
    ("kind", "name"),
    [(MissionType.FENCE, "geofence"), (MissionType.RALLY, "list of rally points")],
)
def test_a_refused_part_of_the_plan_is_named(kind: MissionType, name: str) -> None:
    prefixes = {"geofence": "Geofence refused: ", "list of rally points": "List of rally points refused: "}
    vehicle = FakeVehicle(refused_type=kind, mission_refusal=prefixes[name] + "it leaves out home")
    story = Story(vehicle, fence=(CIRCLE,), rally=(RALLY,)).run()
    assert (story.reason, story.code) == (f"the vehicle refused the {name}: it leaves out home", FAILED)
    assert MissionType.MISSION not in story.vehicle.uploaded
    assert story.orders == [SHUT_DOWN]


def test_no_vehicle() -> None:
    story = Story(FakeVehicle(unsent={"HEARTBEAT"}), connect_s=3.0).run()
    assert story.reason.startswith(
        "no vehicle answered within 3 s: flightstack has not started; compiling its loops"
    )
    assert "see flightstack.log" in story.reason
    assert story.code == NO_ANSWER
    assert story.outcome is Code.NO_VEHICLE
    assert not story.orders


def test_refused_mission_tells_the_vehicles_reason_and_the_item() -> None:
    vehicle = FakeVehicle(
        mission_result=8,
        mission_refusal="Mission refused: item 1 (NAV_WAYPOINT): the acceptance radius is -1",
    )
    story = Story(vehicle).run()
    assert (
        story.reason == "the vehicle refused the mission: item 1 (NAV_WAYPOINT): the acceptance radius is -1"
    )
    assert (story.code, story.orders) == (FAILED, [SHUT_DOWN])


def test_refused_mission_without_a_word_tells_the_result() -> None:
    story = Story(FakeVehicle(mission_result=4)).run()
    assert "MAV_MISSION_NO_SPACE" in story.reason
    assert story.code == FAILED


@pytest.mark.parametrize(
    ("command", "text"),
    [(ARM, "the vehicle refused to arm: "), (START, "the vehicle refused to start the mission: ")],
)
def test_refused_command_tells_the_vehicles_reason(command: int, text: str) -> None:
    story = Story(FakeVehicle(refusals={command: "Command refused: the battery is low"})).run()
    assert (story.reason, story.code) == (text + "the battery is low", FAILED)
    assert story.outcome is Code.REFUSED
    assert story.orders[-1] == SHUT_DOWN


@pytest.mark.parametrize(("ignored", "said"), [("MISSION_COUNT", "upload"), (ARM, "COMPONENT_ARM_DISARM")])
def test_a_vehicle_that_does_not_answer(ignored: object, said: str) -> None:
    story = Story(FakeVehicle(ignored={ignored})).run()
    assert said in story.reason
    assert story.code == NO_ANSWER


def test_arming_waits_for_the_first_state() -> None:
    story = Story(FakeVehicle(healthy_after_s=4.0)).run()
    assert story.code == DONE
    assert story.orders.count(ARM) == 1
    assert story.phases.count(Phase.READY) == 1


def test_a_vehicle_that_never_gets_ready() -> None:
    story = Story(FakeVehicle(healthy_after_s=1e9), connect_s=8.0).run()
    assert story.reason.startswith(
        "the vehicle has no position and attitude after 8 s: sim-bridge has sent no state"
    )
    assert "see sim-bridge.log" in story.reason
    assert story.code == NO_ANSWER
    assert ARM not in story.orders


@pytest.mark.parametrize(
    "unsent",
    [
        {"MISSION_ITEM_REACHED"},
        {"STATUSTEXT", "MISSION_ITEM_REACHED", "EXTENDED_SYS_STATE", "LOCAL_POSITION_NED"},
        {"MISSION_CURRENT", "EXTENDED_SYS_STATE"},
        {"MISSION_ITEM_REACHED", "ATTITUDE", "FS_LOOP_TIMING"},
    ],
)
def test_no_single_message_is_needed_to_see_the_end(unsent: set[str]) -> None:
    story = Story(FakeVehicle(unsent=unsent)).run()
    assert story.outcome is Code.COMPLETED


def test_landing_at_the_last_item_counts_when_only_the_item_is_known() -> None:
    vehicle = FakeVehicle(stop_at_item=2, unsent={"MISSION_ITEM_REACHED"})
    assert Story(vehicle).run().outcome is Code.COMPLETED


@pytest.mark.parametrize(
    ("texts", "shown"),
    [
        ([(4, "a")], ": a"),
        ([(2, "a"), (4, "b"), (4, "c"), (4, "d")], ": a; c; d"),
        ([(4, "a"), (0, "b"), (2, "c"), (4, "d"), (6, "e")], ": b; c; d"),
        ([(4, "a"), (4, "b"), (4, "c"), (4, "d")], ": b; c; d"),
        ([(6, "a")], ""),
    ],
    ids=["one", "first critical", "emergency among the newest", "no critical", "none"],
)
def test_a_lost_flight_is_explained_by_its_first_critical_text(
    texts: list[tuple[int, str]], shown: str
) -> None:
    said = tuple(StatusText(number, *text, 0.0, None) for number, text in enumerate(texts))
    outcome = outcome_of(VehicleView(texts=said), ())
    assert outcome.reason == f"the vehicle disarmed, before the mission was done{shown}"


def test_a_text_from_before_the_arming_is_no_cause() -> None:
    texts = [
        (2, "old"),
        (6, "Armed"),
        (2, "other"),
        (6, "Disarmed"),
        (6, "Armed"),
        (4, "a"),
        (4, "b"),
        (4, "c"),
    ]
    said = tuple(StatusText(number, *text, 0.0, None) for number, text in enumerate(texts))
    assert outcome_of(VehicleView(texts=said), ()).reason.endswith(": a; b; c")
    late = (*said, StatusText(8, 2, "d", 0.0, None), StatusText(9, 4, "e", 0.0, None))
    assert outcome_of(VehicleView(texts=late), ()).reason.endswith(": c; d; e")


def test_disarming_on_the_way_is_a_failure_with_the_vehicles_last_warning() -> None:
    story = Story(FakeVehicle(stop_at_item=1)).run()
    assert (
        story.reason
        == "the vehicle disarmed at item 1 (last 2), before the mission was done: Rotor 3 is gone"
    )
    assert story.code == FAILED
    assert story.outcome is Code.INCOMPLETE


def test_a_lost_vehicle_is_noticed_within_six_seconds() -> None:
    story = Story(FakeVehicle(stop_at_item=1, at_stop="silence")).run(most_s=10.0)
    assert "the vehicle was lost at t = " in story.reason
    assert story.code == FAILED
    assert story.outcome is Code.VEHICLE_LOST
    assert story.flight.view.silent_s(story.now_s) == pytest.approx(5.0, abs=2.1 * STEP_S)
    assert not story.flight.shut_down_accepted


def test_a_vehicle_that_shuts_down_in_flight() -> None:
    story = Story(FakeVehicle(stop_at_item=1, at_stop="power off")).run()
    assert "the flight stack shut down" in story.reason
    assert story.code == FAILED
    assert story.outcome is Code.PROCESS_ENDED


def test_simulated_time_that_stands_still_ends_the_flight() -> None:
    vehicle = FakeVehicle(stop_at_item=1, at_stop="hover", simulated_s_per_item=1e-9)
    story = Story(vehicle, connect_s=1.0).run(until=Phase.FLY)
    vehicle.time_s = 2.0  # a step that is answered, and then no other one
    began_s = story.now_s
    story.run(most_s=STALL_S + 5.0)
    assert story.code == FAILED
    assert story.outcome is Code.STALLED
    assert story.reason == (
        "simulated time stood still for 10 s at t = 2.0 s: sim-bridge does not answer: see sim-bridge.log"
    )
    assert story.now_s - began_s == pytest.approx(STALL_S, abs=1.5)


def test_the_first_step_may_take_as_long_as_the_vehicle_may_to_begin() -> None:
    """In it the simulator compiles what only some flights need."""
    vehicle = FakeVehicle(stop_at_item=1, at_stop="hover", simulated_s_per_item=1e-9)
    story = Story(vehicle, connect_s=40.0).run(until=Phase.FLY)
    began_s = story.now_s
    assert phase_words(story.flight) == "MISSION"
    while story.now_s < began_s + 30.0:
        story.now_s += STEP_S
        story.flight.step(story.now_s)  # nothing is heard: the flight stack may be the one that compiles
    assert story.flight.phase is Phase.FLY
    story.run(most_s=15.0)
    assert story.now_s - began_s == pytest.approx(40.0, abs=1.5)
    assert story.reason.startswith(
        "simulated time stood still for 40 s at t = 0.0 s: sim-bridge has not answered the first step; compiling its"
    )


def test_a_vehicle_that_is_silent_in_the_first_step_for_too_long_is_lost() -> None:
    vehicle = FakeVehicle(stop_at_item=1, at_stop="hover", simulated_s_per_item=1e-9)
    story = Story(vehicle, connect_s=40.0).run(until=Phase.FLY)
    vehicle.silent = True
    story.run(most_s=45.0)
    assert story.reason == (
        "the vehicle was lost at t = 0.0 s: no heartbeat for 40 s while flying: see flightstack.log"
    )


def test_the_limit_counts_simulated_time() -> None:
    story = Story(FakeVehicle(stop_at_item=1, at_stop="hover"), limit_s=120.0).run()
    assert (
        story.reason == "the mission was not done after 120 s of simulated time (--limit) at item 1 (last 2)"
    )
    assert story.code == FAILED
    assert story.outcome is Code.TIMEOUT
    assert story.orders[-1] == SHUT_DOWN
    assert story.now_s - 100.0 < 10.0  # wall time: 5 s of simulated time pass in each step of 0.05 s


def test_a_plan_that_ends_in_the_air_is_brought_home() -> None:
    story = Story(FakeVehicle(ends_in_air=True), items=(TAKEOFF, WAYPOINT)).run()
    assert story.orders == [ARM, START, RETURN, SHUT_DOWN]
    assert story.flight.returned_by_us
    assert story.outcome is Code.COMPLETED


def test_a_refused_return_ends_the_flight() -> None:
    vehicle = FakeVehicle(ends_in_air=True, refusals={RETURN: "Command refused: no home"})
    story = Story(vehicle, items=(TAKEOFF, WAYPOINT)).run()
    assert story.reason == "the mission is complete, but the vehicle refused to return: no home"


@pytest.mark.parametrize("phase", [Phase.UPLOAD, Phase.ARM, Phase.FLY])
def test_an_interruption_shuts_the_vehicle_down(phase: Phase) -> None:
    story = Story(FakeVehicle(stop_at_item=1, at_stop="hover")).run(until=phase)
    story.flight.abort(Outcome(Code.INTERRUPTED, "interrupted"), story.now_s)
    story.run(most_s=4.0)
    assert (story.reason, story.orders[-1]) == ("interrupted", SHUT_DOWN)


def test_a_vehicle_that_is_gone_is_not_waited_for() -> None:
    story = Story(FakeVehicle()).run(until=Phase.FLY)
    gone = Outcome(Code.PROCESS_ENDED, "flightstack ended with code 1")
    story.flight.abort(gone, story.now_s, vehicle_is_gone=True)
    assert story.flight.is_over


def test_a_vehicle_that_ignores_the_shut_down_does_not_hold_us() -> None:
    story = Story(FakeVehicle(ignored={SHUT_DOWN})).run(most_s=30.0)
    assert story.outcome is Code.COMPLETED
    assert not story.flight.shut_down_accepted

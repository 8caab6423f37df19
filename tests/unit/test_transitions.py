"""The table of modes and arming, exhaustively: every event in every status, with every set of facts."""

from __future__ import annotations

import itertools

import pytest

from flightstack.commander.transitions import (
    RULES,
    TERMINATED,
    Event,
    Facts,
    Need,
    Status,
    is_met,
    transition,
)
from flightstack.core.enums import CUSTOM_MODE, MODE_OF_CUSTOM, NAVIGATION_STATE, Mode

ALL_FACTS = [Facts(*values) for values in itertools.product((False, True), repeat=len(Facts._fields))]
ALL_STATUSES = [Status(armed, mode) for armed in (False, True) for mode in Mode]
EVERYTHING = list(itertools.product(ALL_STATUSES, ALL_FACTS, Event))

READY = Facts(
    state_is_valid=True,
    position_is_known=True,
    upright=True,
    landed=True,
    has_mission=True,
    mission_takes_off=True,
    manual_fresh=True,
    offboard_fresh=True,
)
IN_AIR = READY._replace(landed=False)
STANDING, FLYING = Status(), Status(True, Mode.HOLD)


def flying(mode: Mode) -> Status:
    return Status(True, mode)


def test_every_combination_has_one_outcome_and_a_refusal_changes_nothing() -> None:
    assert len(EVERYTHING) == 2 * len(Mode) * 2 ** len(Facts._fields) * len(Event)
    for status, facts, event in EVERYTHING:
        after, refusal = transition(status, facts, event)
        assert isinstance(after, Status)
        if refusal is not None:
            assert refusal
            assert after == status


def test_only_arm_arms() -> None:
    for status, facts, event in EVERYTHING:
        if not status.armed and transition(status, facts, event).status.armed:
            assert event is Event.ARM
            assert facts.state_is_valid
            assert facts.upright


def test_in_the_air_only_force_disarms() -> None:
    disarmed_by = {
        event
        for status, facts, event in EVERYTHING
        if status.armed and not facts.landed and not transition(status, facts, event).status.armed
    }
    assert disarmed_by == {Event.FORCE_DISARM, Event.TERMINATE}


def test_force_disarm_always_disarms_who_flies() -> None:
    for status, facts in itertools.product(ALL_STATUSES, ALL_FACTS):
        if status.mode is not Mode.TERMINATION:
            after, refusal = transition(status, facts, Event.FORCE_DISARM)
            assert (after, refusal) == (Status(False, Mode.HOLD), None)


def test_termination_is_always_possible_and_never_ends() -> None:
    ended = Status(False, Mode.TERMINATION)
    for status, facts, event in EVERYTHING:
        if event is Event.TERMINATE:
            assert transition(status, facts, event) == (ended, None)
        elif status.mode is Mode.TERMINATION:
            assert transition(status, facts, event) == (status, TERMINATED)


def test_a_disarmed_vehicle_that_was_disarmed_waits_in_hold() -> None:
    """Whatever it was flying: the next arming begins with nothing selected."""
    for status, facts, event in EVERYTHING:
        after, refusal = transition(status, facts, event)
        if status.armed and refusal is None and not after.armed:
            assert after.mode is (Mode.TERMINATION if event is Event.TERMINATE else Mode.HOLD)


def test_modes_change_only_to_where_the_event_leads() -> None:
    leads_to = {
        Event.SELECT_TAKEOFF: Mode.TAKEOFF,
        Event.SELECT_MISSION: Mode.MISSION,
        Event.SELECT_HOLD: Mode.HOLD,
        Event.SELECT_RETURN: Mode.RETURN,
        Event.SELECT_LAND: Mode.LAND,
        Event.SELECT_POSITION: Mode.POSITION,
        Event.SELECT_ALTITUDE: Mode.ALTITUDE,
        Event.SELECT_OFFBOARD: Mode.OFFBOARD,
        Event.TERMINATE: Mode.TERMINATION,
        Event.TAKEOFF_REACHED: Mode.HOLD,
        Event.MISSION_FINISHED: Mode.HOLD,
        Event.MISSION_ASKS_RETURN: Mode.RETURN,
        Event.DISARM: Mode.HOLD,
        Event.FORCE_DISARM: Mode.HOLD,
        Event.LANDED_LONG_ENOUGH: Mode.HOLD,
        Event.NO_TAKEOFF: Mode.HOLD,
    }
    for status, facts, event in EVERYTHING:
        after, refusal = transition(status, facts, event)
        if refusal is None:
            assert after.mode is leads_to.get(event, status.mode)


def test_a_disarmed_vehicle_takes_any_mode() -> None:
    for status, facts, event in EVERYTHING:
        if not status.armed and event.name.startswith("SELECT"):
            expected = TERMINATED if status.mode is Mode.TERMINATION else None
            assert transition(status, facts, event).refusal == expected


def test_without_a_valid_state_nothing_flies() -> None:
    for status, facts, event in EVERYTHING:
        if status.armed and not facts.state_is_valid and event.name.startswith("SELECT"):
            assert transition(status, facts, event).refusal in (Need.STATE.value, TERMINATED)


REFUSALS = [
    (Need.STATE, STANDING, READY._replace(state_is_valid=False), Event.ARM),
    (Need.STATE, FLYING, IN_AIR._replace(state_is_valid=False), Event.SELECT_HOLD),
    (Need.POSITION, FLYING, IN_AIR._replace(position_is_known=False), Event.SELECT_HOLD),
    (Need.UPRIGHT, STANDING, READY._replace(upright=False), Event.ARM),
    (Need.ON_GROUND, FLYING, IN_AIR, Event.DISARM),
    (Need.ON_GROUND, FLYING, IN_AIR, Event.SELECT_TAKEOFF),
    (Need.ON_GROUND, FLYING, IN_AIR, Event.LANDED_LONG_ENOUGH),
    (Need.ON_GROUND, FLYING, IN_AIR, Event.NO_TAKEOFF),
    (Need.IN_AIR, FLYING, READY, Event.SELECT_LAND),
    (Need.IN_AIR, FLYING, READY, Event.SELECT_RETURN),
    (Need.ARMED, Status(False, Mode.TAKEOFF), READY, Event.TAKEOFF_REACHED),
    (Need.ARMED, Status(False, Mode.MISSION), READY, Event.MISSION_ASKS_RETURN),
    (Need.MISSION, FLYING, READY._replace(has_mission=False), Event.SELECT_MISSION),
    (Need.TAKES_OFF, FLYING, READY._replace(mission_takes_off=False), Event.SELECT_MISSION),
    (Need.MANUAL_STREAM, FLYING, IN_AIR._replace(manual_fresh=False), Event.SELECT_POSITION),
    (Need.MANUAL_STREAM, FLYING, IN_AIR._replace(manual_fresh=False), Event.SELECT_ALTITUDE),
    (Need.OFFBOARD_STREAM, FLYING, IN_AIR._replace(offboard_fresh=False), Event.SELECT_OFFBOARD),
]


@pytest.mark.parametrize(("need", "status", "facts", "event"), REFUSALS)
def test_each_need_refuses_with_its_sentence(need: Need, status: Status, facts: Facts, event: Event) -> None:
    assert transition(status, facts, event) == (status, need.value)


def test_every_need_is_used_and_tested() -> None:
    used = {need for rule in RULES for need in rule.needs}
    assert used == set(Need) == {need for need, *_ in REFUSALS}


@pytest.mark.parametrize(
    ("status", "facts", "event", "after"),
    [
        (STANDING, READY, Event.ARM, FLYING),
        (Status(False, Mode.MISSION), READY, Event.ARM, flying(Mode.MISSION)),
        (FLYING, READY, Event.DISARM, STANDING),
        (STANDING, READY, Event.SELECT_TAKEOFF, Status(False, Mode.TAKEOFF)),
        (STANDING, READY, Event.SELECT_MISSION, Status(False, Mode.MISSION)),
        (
            FLYING,
            IN_AIR._replace(mission_takes_off=False),
            Event.SELECT_MISSION,
            flying(Mode.MISSION),
        ),
        (flying(Mode.MISSION), IN_AIR, Event.SELECT_HOLD, FLYING),
        (flying(Mode.MISSION), IN_AIR, Event.SELECT_RETURN, flying(Mode.RETURN)),
        (flying(Mode.RETURN), IN_AIR, Event.SELECT_LAND, flying(Mode.LAND)),
        (flying(Mode.TAKEOFF), IN_AIR, Event.TAKEOFF_REACHED, FLYING),
        (flying(Mode.MISSION), IN_AIR, Event.MISSION_FINISHED, FLYING),
        (flying(Mode.MISSION), IN_AIR, Event.MISSION_ASKS_RETURN, flying(Mode.RETURN)),
        (flying(Mode.LAND), READY, Event.LANDED_LONG_ENOUGH, STANDING),
        (FLYING, READY, Event.NO_TAKEOFF, STANDING),
        (FLYING, IN_AIR, Event.SELECT_POSITION, flying(Mode.POSITION)),
        (FLYING, IN_AIR, Event.SELECT_ALTITUDE, flying(Mode.ALTITUDE)),
        (FLYING, IN_AIR, Event.SELECT_OFFBOARD, flying(Mode.OFFBOARD)),
        (STANDING, READY, Event.SELECT_OFFBOARD, Status(False, Mode.OFFBOARD)),
        (FLYING, IN_AIR, Event.TERMINATE, Status(False, Mode.TERMINATION)),
    ],
)
def test_the_way_of_a_flight(status: Status, facts: Facts, event: Event, after: Status) -> None:
    assert transition(status, facts, event) == (after, None)


@pytest.mark.parametrize("event", [Event.TAKEOFF_REACHED, Event.MISSION_FINISHED, Event.MISSION_ASKS_RETURN])
def test_ends_of_a_mode_mean_nothing_in_another(event: Event) -> None:
    after, refusal = transition(flying(Mode.LAND), IN_AIR, event)
    assert after == flying(Mode.LAND)
    assert refusal == "not possible in mode land"


def test_every_event_has_a_rule_and_one_rule_for_each_mode() -> None:
    for event, mode in itertools.product(Event, Mode):
        matching = [rule for rule in RULES if rule.event is event and mode in rule.modes]
        assert len(matching) <= 1
        assert any(rule.event is event for rule in RULES)


def test_needs_are_facts() -> None:
    assert is_met(Need.ON_GROUND, STANDING, IN_AIR)  # a disarmed vehicle is no flying one
    assert not is_met(Need.IN_AIR, STANDING, IN_AIR)


def test_modes_have_px4s_numbers() -> None:
    """Main mode AUTO (4) with sub modes TAKEOFF 2, LOITER 3, MISSION 4, RTL 5, LAND 6, as PX4 packs them."""
    automatic = {Mode.TAKEOFF: 2, Mode.HOLD: 3, Mode.MISSION: 4, Mode.RETURN: 5, Mode.LAND: 6}
    others = {Mode.ALTITUDE: 2, Mode.POSITION: 3, Mode.OFFBOARD: 6, Mode.TERMINATION: 10}
    expected = {mode: 4 << 16 | sub << 24 for mode, sub in automatic.items()}
    assert expected | {mode: main << 16 for mode, main in others.items()} == CUSTOM_MODE
    assert {number: mode for mode, number in CUSTOM_MODE.items()} == MODE_OF_CUSTOM
    assert NAVIGATION_STATE.keys() == CUSTOM_MODE.keys() == set(Mode)

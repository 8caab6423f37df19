"""User takeover: mode requests after a failsafe has ended the mode."""

from __future__ import annotations

import pytest

from flightstack.commander.failsafe import (
    DOES_ALREADY,
    RULES,
    STEERS,
    Action,
    Failsafe,
    Phase,
    action_of,
    conflicts_with,
)
from flightstack.commander.failsafe_step import Entry, Memory, override, restart
from flightstack.commander.user_takeover import REPETITION_S, UserTakeover, conflicting_failsafes
from flightstack.params.behaviour import Behaviour, with_assignments

FENCE_LANDS = with_assignments(Behaviour(), ["GF_ACTION=5", "COM_FAIL_ACT_T=5", "COM_LOW_BAT_ACT=3"])
NEVER = {
    Failsafe.NOT_FINITE,
    Failsafe.IMU_FAULT,
    Failsafe.STATE_STALE,
    Failsafe.ATTITUDE,
    Failsafe.BATTERY_EMERGENCY,
}


class TakeoverCase:
    """A fence that has ended OFFBOARD at second 0."""

    def __init__(self, *active: Failsafe) -> None:
        self.user_takeover = UserTakeover()
        self.memory = Memory({failsafe: Entry(0) for failsafe in active or (Failsafe.FENCE,)})
        self.user_takeover.record(Phase.OFFBOARD, next(iter(self.memory.entries)))

    def ask(self, at_s: float, phase: Phase = Phase.OFFBOARD) -> str | None:
        return self.user_takeover.refusal(self.memory, phase, round(at_s * 1e6), FENCE_LANDS)


def test_the_table_says_what_nobody_may_override() -> None:
    assert {rule.failsafe for rule in RULES if not rule.allows_takeover} == NEVER


@pytest.mark.parametrize("every_s", [0.1, 0.5, 2.0, 5.0, REPETITION_S - 0.1])
def test_who_repeats_himself_is_never_given_the_mode(every_s: float) -> None:
    case = TakeoverCase()
    assert all(case.ask(every_s * count) for count in range(100))


def test_who_asks_again_after_a_pause_is_given_the_mode() -> None:
    case = TakeoverCase()
    assert case.ask(1.0) == "geofence breached: select another mode first, or ask again in 10 s"
    assert case.ask(1.0 + REPETITION_S) is None


def test_the_first_request_waits_for_the_time_to_react() -> None:
    assert TakeoverCase().ask(4.9) is not None
    assert TakeoverCase().ask(5.1) is None


def test_another_mode_is_given_at_once_and_then_every_mode() -> None:
    case = TakeoverCase()
    assert case.ask(0.1) is not None
    assert case.ask(0.2, Phase.HOLD) is None
    case.user_takeover.clear()
    case.memory = override(case.memory, conflicting_failsafes(case.memory, Phase.HOLD, FENCE_LANDS))
    assert case.ask(0.3) is None


def test_a_repetition_gets_nothing_after_the_end_of_the_breach_either() -> None:
    case = TakeoverCase()
    case.ask(8.0)
    case.memory = Memory()
    assert case.ask(9.0) is not None
    assert case.ask(9.0 + REPETITION_S) is None


def test_a_link_that_is_back_gives_its_mode_back() -> None:
    case = TakeoverCase(Failsafe.GCS_LOST)
    case.ask(1.0)
    case.memory = Memory()
    assert case.ask(1.5) is None


def test_a_new_flight_forgets() -> None:
    case = TakeoverCase()
    case.ask(8.0)
    case.user_takeover.begin_flight()
    case.memory = Memory()
    assert case.ask(8.1) is None


def test_an_emergency_landing_refuses_all_but_to_land() -> None:
    case = TakeoverCase(Failsafe.BATTERY_EMERGENCY)
    for phase in (Phase.HOLD, Phase.GOTO, Phase.MISSION, Phase.MANUAL, Phase.OFFBOARD, Phase.RETURN):
        assert case.ask(100.0, phase) == "battery level is dangerously low: landing"
    assert case.ask(100.0, Phase.LAND) is None


def test_what_stops_the_rotors_is_no_ones_to_override() -> None:
    """A choice of mode then changes nothing about it, so that it need not be refused."""
    behaviour = with_assignments(Behaviour(), ["GF_ACTION=4", "COM_ACT_FAIL_ACT=4", "FS_ATT_ACT=4"])
    for failsafe in (
        Failsafe.FENCE,
        Failsafe.ROTOR,
        Failsafe.ATTITUDE,
        Failsafe.STATE_STALE,
        Failsafe.NOT_FINITE,
    ):
        memory = Memory({failsafe: Entry(0)})
        for phase in Phase:
            assert conflicting_failsafes(memory, phase, behaviour) == ()
        assert not override(memory, ()).entries[failsafe].overridden


@pytest.mark.parametrize("phase", list(Phase), ids=lambda phase: phase.name.lower())
def test_only_a_lesser_flight_stands_against_a_failsafe(phase: Phase) -> None:
    for rule in RULES:
        action = action_of(rule.failsafe, FENCE_LANDS)
        wants_more = action in STEERS and action > DOES_ALREADY.get(phase, Action.NONE)
        assert conflicts_with(rule.failsafe, phase, FENCE_LANDS) is (wants_more and phase in rule.phases)


def test_only_what_stood_against_the_choice_is_overridden_and_can_begin_anew() -> None:
    memory = override(Memory({Failsafe.FENCE: Entry(7), Failsafe.GCS_LOST: Entry(9)}), (Failsafe.FENCE,))
    assert memory.entries == {Failsafe.FENCE: Entry(7, True), Failsafe.GCS_LOST: Entry(9)}
    assert restart(memory, Failsafe.FENCE).entries == {Failsafe.GCS_LOST: Entry(9)}

"""The table of failsafes, exhaustively: every one, every pair, in every phase, with every value of its parameter."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from flightstack.commander.failsafe import (
    DOES_ALREADY,
    NOTHING,
    PRIORITY,
    RULE_OF,
    RULES,
    Action,
    Decision,
    Demand,
    Failsafe,
    Phase,
    action_of,
    decide,
    phase_of,
)
from flightstack.core.enums import Mode
from flightstack.params.behaviour import FIELDS, SPECS, Behaviour

DEFAULTS = Behaviour()
PARAMETER = {attribute: name for name, attribute in FIELDS.items()}
AIRBORNE = [phase for phase in Phase if phase not in (Phase.DISARMED, Phase.STANDING)]
POSITION_FAULTS = {Failsafe.POSITION_LOST, Failsafe.POSITION_ERROR}
"""Failsafes without which a vehicle cannot hold its position."""
DEMANDS = [Demand(failsafe, action) for failsafe in Failsafe for action in Action]


def decide_for(*demands: Demand, phase: Phase = Phase.MISSION, sticks: bool = True) -> Decision:
    return decide(demands, phase, sticks, DEFAULTS)


def test_the_order_of_priority_is_that_of_the_table() -> None:
    assert [rule.failsafe for rule in RULES] == list(Failsafe)
    assert sorted(Failsafe, key=lambda f: -PRIORITY[f]) == list(Failsafe)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.failsafe.name.lower())
def test_each_value_that_a_parameter_may_have_has_an_action(rule) -> None:  # type: ignore[no-untyped-def]
    if not rule.parameter:
        assert list(rule.actions) == [0]
        return
    choices = {value for value, _ in SPECS[PARAMETER[rule.parameter]].choices}
    assert choices
    assert choices <= set(rule.actions)


ACTIONS_OF_PX4 = {
    # name: {value: action}, from PX4's parameter reference
    "NAV_DLL_ACT": {0: "WARN", 1: "HOLD", 2: "RETURN", 3: "LAND", 5: "TERMINATE", 6: "DISARM"},
    "NAV_RCL_ACT": {1: "HOLD", 2: "RETURN", 3: "LAND", 5: "TERMINATE", 6: "DISARM"},
    "COM_OBL_RC_ACT": {
        0: "POSITION", 1: "ALTITUDE", 3: "RETURN", 4: "LAND", 5: "HOLD", 6: "TERMINATE", 7: "DISARM"
    },
    "GF_ACTION": {0: "NONE", 1: "WARN", 2: "HOLD", 3: "RETURN", 4: "TERMINATE", 5: "LAND"},
    "COM_POSCTL_NAVL": {0: "ALTITUDE", 1: "LAND"},
    "COM_ACT_FAIL_ACT": {0: "WARN", 1: "HOLD", 2: "LAND", 3: "RETURN", 4: "TERMINATE"},
}  # fmt: skip
FAILSAFE_OF = {
    "NAV_DLL_ACT": Failsafe.GCS_LOST,
    "NAV_RCL_ACT": Failsafe.MANUAL_LOST,
    "COM_OBL_RC_ACT": Failsafe.OFFBOARD_LOST,
    "GF_ACTION": Failsafe.FENCE,
    "COM_POSCTL_NAVL": Failsafe.POSITION_LOST,
    "COM_ACT_FAIL_ACT": Failsafe.ROTOR,
}


@pytest.mark.parametrize(
    ("name", "value", "action"),
    [(name, value, action) for name, actions in ACTIONS_OF_PX4.items() for value, action in actions.items()],
)
def test_values_mean_what_they_mean_in_px4(name: str, value: int, action: str) -> None:
    behaviour = DEFAULTS.updated(name, value)
    assert action_of(FAILSAFE_OF[name], behaviour) is Action[action]


@pytest.mark.parametrize(
    ("value", "critical", "emergency"),
    [(0, Action.WARN, Action.WARN), (2, Action.LAND, Action.LAND), (3, Action.RETURN, Action.LAND)],
)
def test_battery_actions_are_px4s(value: int, critical: Action, emergency: Action) -> None:
    behaviour = DEFAULTS.updated("COM_LOW_BAT_ACT", value)
    assert action_of(Failsafe.BATTERY_LOW, behaviour) is Action.WARN
    assert action_of(Failsafe.BATTERY_CRITICAL, behaviour) is critical
    assert action_of(Failsafe.BATTERY_EMERGENCY, behaviour) is emergency


def test_a_value_from_nowhere_warns() -> None:
    assert action_of(Failsafe.GCS_LOST, replace(DEFAULTS, gcs_loss_action=4)) is Action.WARN


def test_nothing_active_does_nothing_in_any_phase() -> None:
    for phase in Phase:
        assert decide_for(phase=phase) == NOTHING


def test_a_disarmed_vehicle_does_nothing() -> None:
    for demand in DEMANDS:
        assert decide_for(demand, phase=Phase.DISARMED) == NOTHING


def test_on_the_ground_every_action_is_to_disarm() -> None:
    for failsafe, action in DEMANDS:
        expected = action if action <= Action.WARN else Action.DISARM
        assert decide_for(Demand(failsafe, action), phase=Phase.STANDING).action is expected


def test_what_the_vehicle_does_already_is_left_alone() -> None:
    for phase, action in itertools.product(AIRBORNE, (Action.HOLD, Action.RETURN, Action.LAND)):
        decided = decide_for(Demand(Failsafe.BATTERY_CRITICAL, action), phase=phase).action
        assert decided is (Action.WARN if action <= DOES_ALREADY.get(phase, Action.NONE) else action)


def test_a_landing_never_becomes_a_return_or_a_hold() -> None:
    for demands in itertools.combinations(DEMANDS, 2):
        decided = decide(demands, Phase.LAND, True, DEFAULTS).action
        assert decided not in (Action.POSITION, Action.ALTITUDE, Action.HOLD, Action.RETURN, Action.LAND)


@pytest.mark.parametrize("phase", AIRBORNE, ids=lambda phase: phase.name.lower())
def test_of_every_pair_the_more_severe_action_wins(phase: Phase) -> None:
    """All pairs of failsafes with all pairs of actions; the order in which they are named does not matter."""
    for one, other in itertools.combinations(DEMANDS, 2):
        if one.failsafe is other.failsafe:
            continue
        decision = decide((one, other), phase, True, DEFAULTS)
        assert decision == decide((other, one), phase, True, DEFAULTS)
        counted = [d for d in (one, other) if phase in RULE_OF[d.failsafe].phases and d.action]
        if not counted:
            assert decision == NOTHING
            continue
        severest = max(d.action for d in counted)
        lost = any(d.failsafe in POSITION_FAULTS and d.action > Action.WARN for d in counted)
        if lost and severest in (Action.POSITION, Action.HOLD, Action.RETURN):
            severest = Action.LAND
        if lost and severest is Action.ALTITUDE and any(d.action is Action.POSITION for d in counted):
            severest = (
                Action.LAND
            )  # position mode cannot be flown: what replaces it is more than altitude mode
        done = Action.WARN < severest <= DOES_ALREADY.get(phase, Action.NONE)
        assert decision.action is (Action.WARN if done else severest)
        assert decision.cause in {d.failsafe for d in counted}


def test_among_equals_the_higher_row_is_the_cause() -> None:
    for action in (Action.WARN, Action.HOLD, Action.LAND, Action.TERMINATE):
        for one, other in itertools.combinations(Failsafe, 2):
            decision = decide_for(Demand(other, action), Demand(one, action), phase=Phase.MISSION)
            lands = {one, other} & POSITION_FAULTS and action is Action.HOLD
            assert decision == Decision(Action.LAND if lands else action, one)


def test_without_sticks_there_is_no_stick_mode() -> None:
    """What NAV_RCL_ACT says takes its place, as in PX4, and at least a hold."""
    lost = Demand(Failsafe.OFFBOARD_LOST, Action.POSITION)
    for value, expected in {1: Action.HOLD, 2: Action.RETURN, 3: Action.LAND, 5: Action.TERMINATE}.items():
        behaviour = DEFAULTS.updated("NAV_RCL_ACT", value)
        assert decide((lost,), Phase.OFFBOARD, False, behaviour).action is expected
        assert decide((lost,), Phase.OFFBOARD, True, behaviour).action is Action.POSITION


def test_a_return_that_cannot_be_flown_is_a_landing() -> None:
    far = Demand(Failsafe.POSITION_ERROR, Action.LAND)
    low = Demand(Failsafe.BATTERY_CRITICAL, Action.RETURN)
    assert decide_for(low, phase=Phase.MISSION).action is Action.RETURN
    assert decide_for(low, far, phase=Phase.MISSION).action is Action.LAND
    only_warned = Demand(Failsafe.POSITION_ERROR, Action.WARN)
    assert decide_for(low, only_warned, phase=Phase.MISSION).action is Action.RETURN


def test_without_a_state_only_the_end_is_possible() -> None:
    blind = Demand(Failsafe.STATE_STALE, Action.BLIND)
    for failsafe, action in DEMANDS:
        expected = max(action, Action.BLIND)
        assert decide_for(blind, Demand(failsafe, action), phase=Phase.MISSION).action is expected


def test_lost_links_do_not_end_a_landing() -> None:
    for failsafe in (Failsafe.GCS_LOST, Failsafe.MANUAL_LOST, Failsafe.OFFBOARD_LOST):
        assert decide_for(Demand(failsafe, Action.TERMINATE), phase=Phase.LAND) == NOTHING


def test_phases() -> None:
    assert {phase_of(False, landed, mode) for landed in (True, False) for mode in Mode} == {Phase.DISARMED}
    assert {phase_of(True, True, mode) for mode in Mode} == {Phase.STANDING}
    assert {phase_of(True, False, mode) for mode in Mode} == {*AIRBORNE, Phase.DISARMED} - {Phase.GOTO}
    assert {phase_of(True, False, mode, goes=True) for mode in Mode} == {*AIRBORNE, Phase.DISARMED} - {
        Phase.HOLD
    }
    assert phase_of(True, True, Mode.HOLD, goes=True) is Phase.STANDING
    assert phase_of(True, False, Mode.ALTITUDE) is phase_of(True, False, Mode.POSITION) is Phase.MANUAL

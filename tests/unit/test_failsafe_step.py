"""Failsafes over time: beginning, waiting, acting, overriding, ending, and what is said."""

from __future__ import annotations

import itertools

from flightstack.commander.failsafe import Action, Failsafe, Phase
from flightstack.commander.failsafe_step import (
    IDLE,
    Announcement,
    Memory,
    Situation,
    active_failsafes,
    failsafe_step,
    goes_on,
    override,
)
from flightstack.core.enums import Severity
from flightstack.params.behaviour import Behaviour, with_assignments


class Flight:
    """Steps failsafes at 10 Hz."""

    def __init__(self, *assignments: str, phase: Phase = Phase.MISSION) -> None:
        self.behaviour = with_assignments(Behaviour(), list(assignments))
        self.phase = phase
        self.memory: Memory = IDLE
        self.time_us = 0
        self.said: list[Announcement] = []

    def run(self, seconds: float, *conditions: Failsafe) -> Action:
        for _ in range(round(seconds * 10)):
            situation = Situation(self.time_us, self.phase, sticks_are_live=True)
            self.memory, said = failsafe_step(self.memory, frozenset(conditions), situation, self.behaviour)
            self.said += said
            self.time_us += 100_000
        return self.memory.decision.action


def test_a_return_waits_in_hold_and_both_are_said_once() -> None:
    flight = Flight("NAV_DLL_ACT=2")
    assert flight.run(0.1, Failsafe.GCS_LOST) is Action.HOLD
    flight.phase = Phase.HOLD
    assert flight.run(4.8, Failsafe.GCS_LOST) is Action.WARN  # it holds already
    assert flight.run(0.2, Failsafe.GCS_LOST) is Action.RETURN
    flight.phase = Phase.RETURN
    assert flight.run(5.0, Failsafe.GCS_LOST) is Action.WARN
    assert flight.said == [
        (Severity.CRITICAL, "Ground station lost: holding, returning in 5 s"),
        (Severity.CRITICAL, "Failsafe: returning (ground station lost)"),
    ]


def test_a_condition_that_ends_in_the_wait_is_over() -> None:
    flight = Flight("NAV_DLL_ACT=2")
    flight.run(2.0, Failsafe.GCS_LOST)
    assert flight.run(9.0) is Action.NONE
    assert flight.said[-1] == (Severity.NOTICE, "Ground station is back")
    assert active_failsafes(flight.memory) == ()
    assert flight.run(1.0, Failsafe.GCS_LOST) is Action.HOLD  # the wait begins anew


def test_who_returns_or_lands_is_not_made_to_wait() -> None:
    flight = Flight("COM_LOW_BAT_ACT=3", phase=Phase.RETURN)
    assert flight.run(0.1, Failsafe.BATTERY_EMERGENCY) is Action.LAND


def test_without_delay_a_failsafe_acts_at_once() -> None:
    flight = Flight("NAV_DLL_ACT=3", "COM_FAIL_ACT_T=0")
    assert flight.run(0.1, Failsafe.GCS_LOST) is Action.LAND
    assert flight.said == [(Severity.CRITICAL, "Ground station lost: landing")]


def test_a_second_failsafe_escalates_and_names_itself() -> None:
    flight = Flight("COM_LOW_BAT_ACT=3", "COM_FAIL_ACT_T=0")
    assert flight.run(1.0, Failsafe.BATTERY_LOW) is Action.WARN
    assert flight.run(1.0, Failsafe.BATTERY_LOW, Failsafe.BATTERY_CRITICAL) is Action.RETURN
    flight.phase = Phase.RETURN
    everything = (Failsafe.BATTERY_LOW, Failsafe.BATTERY_CRITICAL, Failsafe.BATTERY_EMERGENCY)
    assert flight.run(0.1, *everything) is Action.LAND
    assert flight.said == [
        (Severity.WARNING, "Battery level is low"),
        (Severity.CRITICAL, "Battery level is critical: returning"),
        (Severity.CRITICAL, "Battery level is dangerously low: landing"),
    ]
    assert active_failsafes(flight.memory) == everything[::-1]


def test_battery_levels_that_begin_or_end_together_are_told_once() -> None:
    flight = Flight("COM_LOW_BAT_ACT=0")
    everything = (Failsafe.BATTERY_LOW, Failsafe.BATTERY_CRITICAL, Failsafe.BATTERY_EMERGENCY)
    flight.run(0.1, *everything, Failsafe.GNSS_REFUSED)
    assert [text for _, text in flight.said if "Battery" in text] == ["Battery level is dangerously low"]
    assert active_failsafes(flight.memory)[0] is Failsafe.BATTERY_EMERGENCY
    flight.said.clear()
    flight.run(0.1, Failsafe.BATTERY_LOW)
    assert [text for _, text in flight.said if "Battery" in text] == ["Battery level is no longer critical"]
    flight.run(0.1)
    assert flight.said[-1] == (Severity.NOTICE, "Battery level is no longer low")


def test_a_user_overrides_what_is_active_but_not_what_comes_after() -> None:
    flight = Flight("NAV_DLL_ACT=2", "COM_LOW_BAT_ACT=3", "COM_FAIL_ACT_T=0")
    assert flight.run(0.1, Failsafe.GCS_LOST) is Action.RETURN
    flight.memory = override(
        flight.memory, active_failsafes(flight.memory)
    )  # the user selects the mission again
    assert flight.run(20.0, Failsafe.GCS_LOST) is Action.NONE
    assert active_failsafes(flight.memory) == (Failsafe.GCS_LOST,)
    assert flight.run(0.1, Failsafe.GCS_LOST, Failsafe.BATTERY_CRITICAL) is Action.RETURN


def test_after_an_override_the_same_failsafe_acts_when_it_begins_again() -> None:
    flight = Flight("NAV_DLL_ACT=2", "COM_FAIL_ACT_T=0")
    flight.run(1.0, Failsafe.GCS_LOST)
    flight.memory = override(flight.memory, active_failsafes(flight.memory))
    flight.run(1.0)
    assert flight.run(0.1, Failsafe.GCS_LOST) is Action.RETURN


def test_without_a_state_the_rotors_hold_and_then_stop() -> None:
    flight = Flight("FS_BLIND_T=2")
    assert flight.run(2.0, Failsafe.STATE_STALE) is Action.BLIND
    assert flight.run(0.1, Failsafe.STATE_STALE) is Action.TERMINATE
    assert flight.said == [
        (Severity.EMERGENCY, "State is frozen or missing: rotors hold their speeds"),
        (Severity.EMERGENCY, "Failsafe: flight terminated (state is frozen or missing)"),
    ]


def test_a_state_that_comes_back_ends_the_blindness() -> None:
    flight = Flight("FS_BLIND_T=2")
    flight.run(1.5, Failsafe.NOT_FINITE)
    assert flight.run(5.0) is Action.NONE
    assert flight.said[-1] == (Severity.NOTICE, "State and controller output are finite again")


def test_rotors_may_hold_for_ever() -> None:
    assert Flight("FS_BLIND_T=-1").run(100.0, Failsafe.NOT_FINITE) is Action.BLIND


def test_an_action_that_is_switched_off_says_nothing() -> None:
    flight = Flight("GF_ACTION=0")
    assert flight.run(1.0, Failsafe.FENCE) is Action.NONE
    assert flight.said == []


def test_a_link_without_action_is_told_of_all_the_same() -> None:
    flight = Flight("NAV_DLL_ACT=0")
    assert flight.run(1.0, Failsafe.GCS_LOST) is Action.WARN
    assert flight.said == [(Severity.WARNING, "Ground station lost")]


def test_disarming_forgets() -> None:
    flight = Flight("NAV_DLL_ACT=2")
    flight.run(1.0, Failsafe.GCS_LOST)
    flight.phase = Phase.DISARMED
    assert flight.run(1.0, Failsafe.GCS_LOST) is Action.NONE
    assert flight.memory == IDLE


def test_parameters_count_at_once() -> None:
    flight = Flight("NAV_DLL_ACT=0", "COM_FAIL_ACT_T=0")
    flight.run(1.0, Failsafe.GCS_LOST)
    flight.behaviour = flight.behaviour.updated("NAV_DLL_ACT", 3)
    assert flight.run(0.1, Failsafe.GCS_LOST) is Action.LAND


def test_a_memory_that_goes_on_stays_equal_at_any_later_time_and_has_no_action() -> None:
    """Outer ticks stay in compiled code meanwhile: no failsafe may begin to act with time alone."""
    behaviours = (
        ("NAV_DLL_ACT=2", "COM_LOW_BAT_ACT=2", "COM_FAIL_ACT_T=9"),
        ("NAV_DLL_ACT=3", "COM_LOW_BAT_ACT=3", "FS_BLIND_T=3"),
        ("NAV_DLL_ACT=0", "COM_LOW_BAT_ACT=0", "FS_BLIND_T=-1"),
    )
    phases = [phase for phase in Phase if phase is not Phase.DISARMED]
    went_on = 0
    for assignments, phase, pair in itertools.product(
        behaviours, phases, itertools.combinations(Failsafe, 2)
    ):
        behaviour = with_assignments(Behaviour(), list(assignments))
        for conditions, overridden in ((pair, ()), (pair[:1], ()), (pair, pair[:1])):
            memory: Memory = IDLE
            for time_us in (0, 1_000_000, 6_000_000, 20_000_000):
                situation = Situation(time_us, phase, sticks_are_live=True)
                before = override(memory, overridden) if time_us == 1_000_000 else memory
                memory, _ = failsafe_step(before, frozenset(conditions), situation, behaviour)
                if memory != before or not goes_on(memory, situation, behaviour):
                    continue
                went_on += 1
                assert memory.decision.action <= Action.WARN
                for later_us in (time_us + 10_000, time_us + 4_000_000, time_us + 3_600_000_000):
                    later = situation._replace(time_us=later_us)
                    assert failsafe_step(memory, frozenset(conditions), later, behaviour) == (memory, ())
    assert went_on > 4000

"""State machine of the failsafes: begin, act, be overridden, end, with announcements. Pure.

A failsafe is active while its condition holds. The end of a condition is announced and changes no mode: the vehicle
continues the failsafe's action until a user selects a mode or disarms. Selecting a mode overrides the failsafes that
conflict with it, if the table allows this (see ``user_takeover``); a failsafe that begins later acts again.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from flightstack.commander.failsafe import (
    BATTERY_FAILSAFES,
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
)
from flightstack.core.enums import Severity
from flightstack.params.behaviour import Behaviour

CAN_WAIT = (Phase.TAKEOFF, Phase.MISSION, Phase.HOLD, Phase.GOTO, Phase.MANUAL, Phase.OFFBOARD)
"""Phases in which a failsafe may hold first, so that a user has time to react."""

VERB: Mapping[Action, str] = {
    Action.POSITION: "position mode",
    Action.ALTITUDE: "altitude mode",
    Action.HOLD: "holding",
    Action.RETURN: "returning",
    Action.LAND: "landing",
    Action.BLIND: "rotors hold their speeds",
    Action.DISARM: "disarming",
    Action.TERMINATE: "flight terminated",
}


class Entry(NamedTuple):
    """An active failsafe."""

    since_us: int
    overridden: bool = False


class Memory(NamedTuple):
    """Active failsafes and the last decision."""

    entries: Mapping[Failsafe, Entry] = {}
    decision: Decision = NOTHING


class Announcement(NamedTuple):
    """A text about a failsafe, with its MAV_SEVERITY."""

    severity: int
    text: str


class Situation(NamedTuple):
    """Inputs of a step besides the conditions."""

    time_us: int
    phase: Phase
    sticks_are_live: bool


class Step(NamedTuple):
    """Outcome of one step; ``memory.decision`` is the action to carry out."""

    memory: Memory
    announcements: tuple[Announcement, ...]


IDLE = Memory()


def failsafe_step(
    memory: Memory, conditions: frozenset[Failsafe], situation: Situation, behaviour: Behaviour
) -> Step:
    """Advance by one outer tick with the present conditions."""
    if situation.phase is Phase.DISARMED or not (conditions or memory.entries):
        return Step(IDLE, ())
    time_us, phase = situation.time_us, situation.phase
    announcements: list[Announcement] = []
    kept = {failsafe: entry for failsafe, entry in memory.entries.items() if failsafe in conditions}
    ended = [failsafe for failsafe in memory.entries if failsafe not in conditions]
    for failsafe in _without_other_levels(ended, 0):
        announcements.append(Announcement(Severity.NOTICE, RULE_OF[failsafe].ends))
    begun = [rule.failsafe for rule in RULES if rule.failsafe in conditions and rule.failsafe not in kept]
    begun = [f for f in begun if action_of(f, behaviour) > Action.NONE and phase in RULE_OF[f].phases]
    entries = kept | {failsafe: Entry(time_us) for failsafe in begun}
    demands = [
        Demand(failsafe, _present_action(failsafe, entry, situation, behaviour))
        for failsafe, entry in entries.items()
        if not entry.overridden
    ]
    decision = decide(demands, phase, situation.sticks_are_live, behaviour)
    escalates = decision.action > max(Action.WARN, memory.decision.action)
    for failsafe in _without_other_levels(begun, -1):
        if not (escalates and failsafe is decision.cause):
            announcements.append(Announcement(Severity.WARNING, RULE_OF[failsafe].begins))
    if escalates:
        waited_s = (time_us - entries[decision.cause].since_us) * 1e-6 if decision.cause else 0.0
        announcements.append(_announce(decision, begun, waited_s, behaviour))
    return Step(Memory(entries, decision), tuple(announcements))


def _without_other_levels(failsafes: Sequence[Failsafe], index: int) -> list[Failsafe]:
    """Return the failsafes; of the battery's levels that of ``index`` alone, which says most."""
    levels = [level for level in BATTERY_FAILSAFES if level in failsafes]
    return [each for each in failsafes if each not in levels or each is levels[index]]


def _present_action(failsafe: Failsafe, entry: Entry, situation: Situation, behaviour: Behaviour) -> Action:
    """Return the failsafe's present action: hold before a return or landing, held rotor speeds before termination."""
    action = action_of(failsafe, behaviour)
    elapsed_s = (situation.time_us - entry.since_us) * 1e-6
    if action is Action.BLIND:
        limit_s = behaviour.blind_time_s
        return Action.TERMINATE if 0.0 <= limit_s <= elapsed_s else Action.BLIND
    if action in (Action.RETURN, Action.LAND) and _waits(failsafe, elapsed_s, situation.phase, behaviour):
        return Action.HOLD
    return action


def goes_on(memory: Memory, situation: Situation, behaviour: Behaviour) -> bool:
    """Return True if ``memory`` stays the same in further steps with equal conditions: no action begins with time."""
    if (
        memory.decision.action > Action.WARN or situation.phase is Phase.GOTO
    ):  # which ends on arrival, without an event
        return False
    return all(
        entry.overridden
        or _present_action(failsafe, entry, situation, behaviour) is action_of(failsafe, behaviour)
        for failsafe, entry in memory.entries.items()
    )


def _waits(failsafe: Failsafe, elapsed_s: float, phase: Phase, behaviour: Behaviour) -> bool:
    return RULE_OF[failsafe].holds_first and phase in CAN_WAIT and elapsed_s < behaviour.failsafe_delay_s


def _announce(
    decision: Decision, begun: Sequence[Failsafe], waited_s: float, behaviour: Behaviour
) -> Announcement:
    """Announce a failsafe's action, when it begins or when it acts after a wait."""
    assert decision.cause is not None
    begins, verb = RULE_OF[decision.cause].begins, VERB[decision.action]
    later = action_of(decision.cause, behaviour)
    if decision.action is Action.HOLD and later in (Action.RETURN, Action.LAND):
        verb += f", {VERB[later]} in {behaviour.failsafe_delay_s - waited_s:.0f} s"
    first = decision.cause in begun
    text = f"{begins}: {verb}" if first else f"Failsafe: {verb} ({begins[0].lower()}{begins[1:]})"
    return Announcement(Severity.EMERGENCY if decision.action >= Action.BLIND else Severity.CRITICAL, text)


def override(memory: Memory, overridden: Collection[Failsafe]) -> Memory:
    """Return the memory after a user has selected a mode: ``overridden`` failsafes do not act until they restart."""
    entries = {
        failsafe: entry._replace(overridden=entry.overridden or failsafe in overridden)
        for failsafe, entry in memory.entries.items()
    }
    return Memory(entries, Decision(Action.WARN, None) if entries else NOTHING)


def restart(memory: Memory, failsafe: Failsafe) -> Memory:
    """Return the memory without ``failsafe``: if its condition still holds, it begins again."""
    return memory._replace(entries={f: entry for f, entry in memory.entries.items() if f is not failsafe})


def active_failsafes(memory: Memory) -> tuple[Failsafe, ...]:
    """Return the active failsafes in order of priority, including overridden ones."""
    return tuple(sorted(memory.entries, key=lambda failsafe: -PRIORITY[failsafe]))

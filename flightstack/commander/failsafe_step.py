"""Failsafes over time: when each begins, acts, is overridden and ends, and what is said about it. Pure.

A failsafe begins with its condition and ends with it. The end of a condition is announced and undoes nothing: the
vehicle goes on with what the failsafe chose until a user selects a mode, or it is disarmed. A user who selects
a mode overrides what stands against it, if the table allows that (``takeover`` judges who is a user); whatever begins
after that acts again.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from flightstack.commander.failsafe import (
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
"""Phases in which a person or a plan flies, and may be given time to react."""

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
    """What is active, and what was decided last."""

    entries: Mapping[Failsafe, Entry] = {}
    decision: Decision = NOTHING


class Announcement(NamedTuple):
    """A text about a failsafe, with its MAV_SEVERITY."""

    severity: int
    text: str


class Situation(NamedTuple):
    """What decides beside the conditions."""

    time_us: int
    phase: Phase
    sticks_are_live: bool


class Step(NamedTuple):
    """Outcome of one step; ``memory.decision`` is what to do."""

    memory: Memory
    announcements: tuple[Announcement, ...]


IDLE = Memory()


def failsafe_step(
    memory: Memory, conditions: frozenset[Failsafe], situation: Situation, behaviour: Behaviour
) -> Step:
    """Advance by one outer tick with the conditions that hold now."""
    if situation.phase is Phase.DISARMED or not (conditions or memory.entries):
        return Step(IDLE, ())
    time_us, phase = situation.time_us, situation.phase
    said: list[Announcement] = []
    kept = {failsafe: entry for failsafe, entry in memory.entries.items() if failsafe in conditions}
    for failsafe in memory.entries:
        if failsafe not in conditions:
            said.append(Announcement(Severity.NOTICE, RULE_OF[failsafe].ends))
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
    for failsafe in begun:
        if not (escalates and failsafe is decision.cause):
            said.append(Announcement(Severity.WARNING, RULE_OF[failsafe].begins))
    if escalates:
        waited_s = (time_us - entries[decision.cause].since_us) * 1e-6 if decision.cause else 0.0
        said.append(_announce(decision, begun, waited_s, behaviour))
    return Step(Memory(entries, decision), tuple(said))


def _present_action(failsafe: Failsafe, entry: Entry, situation: Situation, behaviour: Behaviour) -> Action:
    """Return what a failsafe asks for now: hold before it returns or lands, blind before it terminates."""
    action = action_of(failsafe, behaviour)
    elapsed_s = (situation.time_us - entry.since_us) * 1e-6
    if action is Action.BLIND:
        limit_s = behaviour.blind_time_s
        return Action.TERMINATE if 0.0 <= limit_s <= elapsed_s else Action.BLIND
    if action in (Action.RETURN, Action.LAND) and _waits(failsafe, elapsed_s, situation.phase, behaviour):
        return Action.HOLD
    return action


def _waits(failsafe: Failsafe, elapsed_s: float, phase: Phase, behaviour: Behaviour) -> bool:
    return RULE_OF[failsafe].holds_first and phase in CAN_WAIT and elapsed_s < behaviour.failsafe_delay_s


def _announce(
    decision: Decision, begun: Sequence[Failsafe], waited_s: float, behaviour: Behaviour
) -> Announcement:
    """Tell what a failsafe does: with its beginning, or later when it acts after a wait."""
    assert decision.cause is not None
    begins, verb = RULE_OF[decision.cause].begins, VERB[decision.action]
    later = action_of(decision.cause, behaviour)
    if decision.action is Action.HOLD and later in (Action.RETURN, Action.LAND):
        verb += f", {VERB[later]} in {behaviour.failsafe_delay_s - waited_s:.0f} s"
    first = decision.cause in begun
    text = f"{begins}: {verb}" if first else f"Failsafe: {verb} ({begins[0].lower()}{begins[1:]})"
    return Announcement(Severity.EMERGENCY if decision.action >= Action.BLIND else Severity.CRITICAL, text)


def override(memory: Memory, overridden: Collection[Failsafe]) -> Memory:
    """Return the memory after a user has selected a mode: what stood against it acts no more until it begins anew."""
    entries = {
        failsafe: entry._replace(overridden=entry.overridden or failsafe in overridden)
        for failsafe, entry in memory.entries.items()
    }
    return Memory(entries, Decision(Action.WARN, None) if entries else NOTHING)


def renew(memory: Memory, failsafe: Failsafe) -> Memory:
    """Return the memory without a failsafe: if its condition still holds, it begins anew."""
    return memory._replace(entries={f: entry for f, entry in memory.entries.items() if f is not failsafe})


def active_failsafes(memory: Memory) -> tuple[Failsafe, ...]:
    """Return the active failsafes, overridden ones too, in order of priority."""
    return tuple(sorted(memory.entries, key=lambda failsafe: -PRIORITY[failsafe]))

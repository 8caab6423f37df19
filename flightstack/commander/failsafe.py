"""The failsafes as one table: what each is, which parameter says what it does, and who wins. Pure.

Read ``RULES`` from top to bottom: that is the order of priority, and every failsafe that there is. What an action
becomes in a phase of flight stands in ``decide``. Names and values of the parameters are PX4's wherever PX4 has
the failsafe; https://docs.px4.io/main/en/config/safety describes its behaviour.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum, IntEnum, auto
from typing import NamedTuple

from flightstack.core.enums import Mode
from flightstack.params.behaviour import Behaviour


class Action(IntEnum):
    """What a failsafe does, in order of severity: of several the most severe wins."""

    NONE = 0
    WARN = 1
    POSITION = 2
    """Give the sticks back, in position mode."""
    ALTITUDE = 3
    HOLD = 4
    RETURN = 5
    LAND = 6
    BLIND = 7
    """Hold the rotors' last good speeds: without a state nothing can be navigated."""
    DISARM = 8
    TERMINATE = 9


class Failsafe(Enum):
    """Everything that can go wrong and is watched."""

    NOT_FINITE = auto()
    STATE_STALE = auto()
    ATTITUDE = auto()
    ROTOR = auto()
    BATTERY_EMERGENCY = auto()
    FENCE = auto()
    POSITION_ERROR = auto()
    BATTERY_CRITICAL = auto()
    MANUAL_LOST = auto()
    OFFBOARD_LOST = auto()
    GCS_LOST = auto()
    BATTERY_LOW = auto()


class Phase(Enum):
    """Part of a flight, as far as failsafes tell them apart."""

    DISARMED = auto()
    STANDING = auto()
    """Armed on the ground."""
    TAKEOFF = auto()
    MISSION = auto()
    HOLD = auto()
    GOTO = auto()
    """In hold mode, on the way to another place that was named."""
    MANUAL = auto()
    OFFBOARD = auto()
    RETURN = auto()
    LAND = auto()


PHASE_OF_MODE: Mapping[Mode, Phase] = {
    Mode.HOLD: Phase.HOLD,
    Mode.TAKEOFF: Phase.TAKEOFF,
    Mode.MISSION: Phase.MISSION,
    Mode.RETURN: Phase.RETURN,
    Mode.LAND: Phase.LAND,
    Mode.POSITION: Phase.MANUAL,
    Mode.ALTITUDE: Phase.MANUAL,
    Mode.OFFBOARD: Phase.OFFBOARD,
    Mode.TERMINATION: Phase.DISARMED,
}


def phase_of(armed: bool, landed: bool, mode: Mode, goes: bool = False) -> Phase:
    """Return the phase of flight; ``goes``: in hold mode, on the way to another place."""
    if not armed:
        return Phase.DISARMED
    if goes and mode is Mode.HOLD and not landed:
        return Phase.GOTO
    return Phase.STANDING if landed else PHASE_OF_MODE[mode]


LINK_ACTIONS = {
    0: Action.WARN,
    1: Action.HOLD,
    2: Action.RETURN,
    3: Action.LAND,
    5: Action.TERMINATE,
    6: Action.DISARM,
}
OFFBOARD_ACTIONS = {
    0: Action.POSITION,
    1: Action.ALTITUDE,
    3: Action.RETURN,
    4: Action.LAND,
    5: Action.HOLD,
    6: Action.TERMINATE,
    7: Action.DISARM,
}
FENCE_ACTIONS = {
    0: Action.NONE,
    1: Action.WARN,
    2: Action.HOLD,
    3: Action.RETURN,
    4: Action.TERMINATE,
    5: Action.LAND,
}
FAULT_ACTIONS = {0: Action.WARN, 1: Action.HOLD, 2: Action.LAND, 3: Action.RETURN, 4: Action.TERMINATE}
CRITICAL_ACTIONS = {0: Action.WARN, 1: Action.RETURN, 2: Action.LAND, 3: Action.RETURN}
EMERGENCY_ACTIONS = {0: Action.WARN, 1: Action.RETURN, 2: Action.LAND, 3: Action.LAND}
WARN_ONLY = {0: Action.WARN}

FLIGHT = frozenset(Phase) - {Phase.DISARMED}
LANDING_GOES_ON = FLIGHT - {Phase.LAND}
"""A lost link does not end a landing, whatever its parameter says (PX4's rule)."""


class Rule(NamedTuple):
    """One row of the table.

    ``parameter`` is the field of ``Behaviour`` whose value chooses from ``actions``. With ``holds_first`` a
    return or a landing begins after COM_FAIL_ACT_T in hold, so that a user can take over. ``user_may``: whether a
    user may override it by selecting a mode; what stops the rotors is never overridden. ``phases`` are those in
    which the failsafe counts.
    """

    failsafe: Failsafe
    begins: str
    ends: str
    parameter: str
    actions: Mapping[int, Action]
    holds_first: bool
    user_may: bool
    phases: frozenset[Phase]


F, NOW, DELAYED = Failsafe, False, True
NOBODY, USER = False, True
# fmt: off
RULES = (
    Rule(F.NOT_FINITE, "State or controller output is not finite", "State and controller output are finite again",
         "", {0: Action.BLIND}, NOW, NOBODY, FLIGHT),
    Rule(F.STATE_STALE, "State is frozen or missing", "State is fresh again",
         "", {0: Action.BLIND}, NOW, NOBODY, FLIGHT),
    Rule(F.ATTITUDE, "Attitude is beyond its limits", "Attitude is within its limits again",
         "attitude_failure_action", FAULT_ACTIONS, NOW, NOBODY, FLIGHT),
    Rule(F.ROTOR, "A rotor does not follow its command", "All rotors follow their commands again",
         "rotor_failure_action", FAULT_ACTIONS, NOW, USER, FLIGHT),
    Rule(F.BATTERY_EMERGENCY, "Battery level is dangerously low", "Battery level has left emergency",
         "low_battery_action", EMERGENCY_ACTIONS, DELAYED, NOBODY, FLIGHT),
    Rule(F.FENCE, "Geofence breached", "Inside the geofence again",
         "fence_action", FENCE_ACTIONS, DELAYED, USER, FLIGHT),
    Rule(F.POSITION_ERROR, "Position is far from its setpoint", "Position follows its setpoint again",
         "position_error_action", FAULT_ACTIONS, NOW, USER, FLIGHT),
    Rule(F.BATTERY_CRITICAL, "Battery level is critical", "Battery level is no longer critical",
         "low_battery_action", CRITICAL_ACTIONS, DELAYED, USER, FLIGHT),
    Rule(F.MANUAL_LOST, "Manual control lost", "Manual control is back",
         "manual_loss_action", LINK_ACTIONS, DELAYED, USER, LANDING_GOES_ON),
    Rule(F.OFFBOARD_LOST, "Offboard setpoints lost", "Offboard setpoints are back",
         "offboard_loss_action", OFFBOARD_ACTIONS, NOW, USER, LANDING_GOES_ON),
    Rule(F.GCS_LOST, "Ground station lost", "Ground station is back",
         "gcs_loss_action", LINK_ACTIONS, DELAYED, USER, LANDING_GOES_ON),
    Rule(F.BATTERY_LOW, "Battery level is low", "Battery level is no longer low",
         "", WARN_ONLY, NOW, USER, FLIGHT),
)
# fmt: on
RULE_OF: Mapping[Failsafe, Rule] = {rule.failsafe: rule for rule in RULES}
PRIORITY: Mapping[Failsafe, int] = {rule.failsafe: -index for index, rule in enumerate(RULES)}

DOES_ALREADY: Mapping[Phase, Action] = {
    Phase.MANUAL: Action.ALTITUDE,
    Phase.HOLD: Action.HOLD,
    Phase.RETURN: Action.RETURN,
    Phase.LAND: Action.LAND,
}
"""What a phase amounts to: a failsafe that asks for no more changes nothing, so that actions only escalate."""

STEERS = frozenset({Action.POSITION, Action.ALTITUDE, Action.HOLD, Action.RETURN, Action.LAND})
"""Actions that fly in a mode of their own."""
LINK_FAILSAFES = frozenset({Failsafe.MANUAL_LOST, Failsafe.OFFBOARD_LOST, Failsafe.GCS_LOST})

BEYOND_REACH: Mapping[Failsafe, frozenset[Action]] = {
    Failsafe.POSITION_ERROR: frozenset({Action.POSITION, Action.HOLD, Action.RETURN}),
}
"""Actions that cannot be flown while a failsafe acts: who cannot keep a place cannot go home either."""


def action_of(failsafe: Failsafe, behaviour: Behaviour) -> Action:
    """Return what the parameters ask for; a value that the table does not have warns."""
    rule = RULE_OF[failsafe]
    value = int(getattr(behaviour, rule.parameter)) if rule.parameter else 0
    return rule.actions.get(value, Action.WARN)


def opposes(failsafe: Failsafe, phase: Phase, behaviour: Behaviour) -> bool:
    """Tell whether a failsafe, once it acts, would end a flight in ``phase`` to fly in another mode."""
    action = action_of(failsafe, behaviour)
    if action in BEYOND_REACH.get(failsafe, frozenset()):
        action = Action.LAND
    counts = phase in RULE_OF[failsafe].phases
    return counts and action in STEERS and action > DOES_ALREADY.get(phase, Action.NONE)


class Demand(NamedTuple):
    """An active failsafe and what it asks for at this moment."""

    failsafe: Failsafe
    action: Action


class Decision(NamedTuple):
    """What is to be done, and because of which failsafe (None: none is active)."""

    action: Action
    cause: Failsafe | None


NOTHING = Decision(Action.NONE, None)


def decide(demands: Iterable[Demand], phase: Phase, sticks_are_live: bool, behaviour: Behaviour) -> Decision:
    """Return the action for all that is active.

    The most severe action wins, among equals the failsafe that stands higher in the table. It is then made
    possible: without sticks there is no position mode, with the position lost no return. On the ground every
    action is to disarm. What the vehicle does already, or more than that, is left alone.
    """
    counted = [d for d in demands if phase in RULE_OF[d.failsafe].phases and d.action > Action.NONE]
    if not counted:
        return NOTHING
    impossible: set[Action] = set() if sticks_are_live else {Action.POSITION, Action.ALTITUDE}
    for demand in counted:
        if demand.action > Action.WARN:
            impossible |= BEYOND_REACH.get(demand.failsafe, frozenset())
    without_sticks = max(Action.HOLD, action_of(Failsafe.MANUAL_LOST, behaviour))
    best = max(
        (Demand(d.failsafe, _possible(d.action, impossible, without_sticks)) for d in counted),
        key=lambda d: (d.action, PRIORITY[d.failsafe]),
    )
    if best.action > Action.WARN and phase is Phase.STANDING:
        return Decision(Action.DISARM, best.failsafe)
    if Action.WARN < best.action <= DOES_ALREADY.get(phase, Action.NONE):
        return Decision(Action.WARN, best.failsafe)
    return Decision(best.action, best.failsafe)


def _possible(action: Action, impossible: set[Action], without_sticks: Action) -> Action:
    """Return ``action``, or the next more severe one that can be flown."""
    if action in (Action.POSITION, Action.ALTITUDE) and action in impossible:
        action = without_sticks
    return Action.LAND if action in impossible else action

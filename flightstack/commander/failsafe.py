"""Table of failsafes: condition, parameter of the action, priority. Pure.

``RULES`` lists all failsafes in order of priority. ``decide`` selects the action for the phase of flight. Parameters
have PX4's names and values if PX4 has the failsafe; https://docs.px4.io/main/en/config/safety describes its behaviour.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum, IntEnum, auto
from typing import NamedTuple

from flightstack.core.enums import Mode
from flightstack.params.behaviour import Behaviour


class Action(IntEnum):
    """Action of a failsafe, in order of severity: the most severe one wins."""

    NONE = 0
    WARN = 1
    POSITION = 2
    """Position mode, flown with the sticks."""
    ALTITUDE = 3
    HOLD = 4
    RETURN = 5
    LAND = 6
    BLIND = 7
    """Hold the last valid rotor speeds: guidance needs a valid state."""
    DISARM = 8
    TERMINATE = 9


class Failsafe(Enum):
    """Conditions that trigger a failsafe."""

    NOT_FINITE = auto()
    IMU_FAULT = auto()
    STATE_STALE = auto()
    ATTITUDE = auto()
    ATTITUDE_DOUBTFUL = auto()
    ROTOR = auto()
    BATTERY_EMERGENCY = auto()
    POSITION_LOST = auto()
    FENCE = auto()
    POSITION_ERROR = auto()
    BATTERY_CRITICAL = auto()
    MANUAL_LOST = auto()
    OFFBOARD_LOST = auto()
    GCS_LOST = auto()
    BATTERY_LOW = auto()
    GNSS_REFUSED = auto()


class Phase(Enum):
    """Phase of flight, as failsafes distinguish them."""

    DISARMED = auto()
    STANDING = auto()
    """Armed on the ground."""
    TAKEOFF = auto()
    MISSION = auto()
    HOLD = auto()
    GOTO = auto()
    """In hold mode, on the way to a commanded position."""
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
    """Return the phase of flight; ``goes`` is true in hold mode on the way to a commanded position."""
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
POSITION_ACTIONS = {0: Action.ALTITUDE, 1: Action.LAND}
CRITICAL_ACTIONS = {0: Action.WARN, 1: Action.RETURN, 2: Action.LAND, 3: Action.RETURN}
EMERGENCY_ACTIONS = {0: Action.WARN, 1: Action.RETURN, 2: Action.LAND, 3: Action.LAND}
WARN_ONLY = {0: Action.WARN}

FLIGHT = frozenset(Phase) - {Phase.DISARMED}
LANDING_GOES_ON = FLIGHT - {Phase.LAND}
"""A lost link does not end a landing, regardless of its parameter (PX4's rule)."""


class Rule(NamedTuple):
    """One row of the table.

    ``parameter`` is the field of ``Behaviour`` that selects from ``actions``. With ``holds_first`` a return or a
    landing begins after COM_FAIL_ACT_T in hold, so that a user can take over. ``allows_takeover`` is true if a user
    may override the failsafe by selecting a mode; an action that stops the rotors is never overridden. ``phases`` are
    those in which the failsafe applies.
    """

    failsafe: Failsafe
    begins: str
    ends: str
    parameter: str
    actions: Mapping[int, Action]
    holds_first: bool
    allows_takeover: bool
    phases: frozenset[Phase]


F, NOW, DELAYED = Failsafe, False, True
NEVER, USER = False, True
# fmt: off
RULES = (
    Rule(F.NOT_FINITE, "State or controller output is not finite", "State and controller output are finite again",
         "", {0: Action.BLIND}, NOW, NEVER, FLIGHT),
    Rule(F.IMU_FAULT, "Inertial sensor is missing or stuck", "Inertial sensor measures again",
         "", {0: Action.BLIND}, NOW, NEVER, FLIGHT),
    Rule(F.STATE_STALE, "State is frozen or missing", "State is fresh again",
         "", {0: Action.BLIND}, NOW, NEVER, FLIGHT),
    Rule(F.ATTITUDE, "Attitude is beyond its limits", "Attitude is within its limits again",
         "attitude_failure_action", FAULT_ACTIONS, NOW, NEVER, FLIGHT),
    Rule(F.ATTITUDE_DOUBTFUL, "Attitude estimate is doubtful", "Attitude estimate is good again",
         "attitude_doubt_action", FAULT_ACTIONS, NOW, USER, FLIGHT),
    Rule(F.ROTOR, "A rotor does not follow its command", "All rotors follow their commands again",
         "rotor_failure_action", FAULT_ACTIONS, NOW, USER, FLIGHT),
    Rule(F.BATTERY_EMERGENCY, "Battery level is dangerously low", "Battery level has left emergency",
         "low_battery_action", EMERGENCY_ACTIONS, DELAYED, NEVER, FLIGHT),
    Rule(F.POSITION_LOST, "Position is lost", "Position is known again",
         "position_loss_action", POSITION_ACTIONS, NOW, USER, FLIGHT),
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
    Rule(F.GNSS_REFUSED, "Spoofed GNSS suspected", "GNSS agrees with the estimate again",
         "gnss_doubt_action", FAULT_ACTIONS, NOW, USER, FLIGHT),
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
"""Action equivalent to each phase: a failsafe with this or a less severe action does not end the phase."""

STEERS = frozenset({Action.POSITION, Action.ALTITUDE, Action.HOLD, Action.RETURN, Action.LAND})
"""Actions that change the flight mode."""
BATTERY_FAILSAFES = (Failsafe.BATTERY_LOW, Failsafe.BATTERY_CRITICAL, Failsafe.BATTERY_EMERGENCY)
"""Each level has those before it."""
LINK_FAILSAFES = frozenset({Failsafe.MANUAL_LOST, Failsafe.OFFBOARD_LOST, Failsafe.GCS_LOST})

BEYOND_REACH: Mapping[Failsafe, frozenset[Action]] = {
    Failsafe.POSITION_LOST: frozenset({Action.POSITION, Action.HOLD, Action.RETURN}),
    Failsafe.POSITION_ERROR: frozenset({Action.POSITION, Action.HOLD, Action.RETURN}),
}
"""Actions that cannot be flown while a failsafe is active: a vehicle that cannot hold its position cannot return."""


def action_of(failsafe: Failsafe, behaviour: Behaviour) -> Action:
    """Return the action that the parameters select; a value that is not in the table selects a warning."""
    rule = RULE_OF[failsafe]
    value = int(getattr(behaviour, rule.parameter)) if rule.parameter else 0
    return rule.actions.get(value, Action.WARN)


def conflicts_with(failsafe: Failsafe, phase: Phase, behaviour: Behaviour) -> bool:
    """Return True if the failsafe's action would end a flight in ``phase`` for another mode."""
    action = action_of(failsafe, behaviour)
    if action in BEYOND_REACH.get(failsafe, frozenset()):
        action = Action.LAND
    applies = phase in RULE_OF[failsafe].phases
    return applies and action in STEERS and action > DOES_ALREADY.get(phase, Action.NONE)


class Demand(NamedTuple):
    """An active failsafe and its present action."""

    failsafe: Failsafe
    action: Action


class Decision(NamedTuple):
    """The action to carry out, and the failsafe that caused it (None if none is active)."""

    action: Action
    cause: Failsafe | None


NOTHING = Decision(Action.NONE, None)


def decide(demands: Iterable[Demand], phase: Phase, sticks_are_live: bool, behaviour: Behaviour) -> Decision:
    """Return the action for all active failsafes.

    The most severe action wins; among equals, the failsafe that is higher in the table. An action that cannot be flown
    is replaced first: position mode without manual control, a return without position control. On the ground every
    action above a warning disarms. In flight, an action no more severe than the present phase becomes a warning.
    """
    applicable = [d for d in demands if phase in RULE_OF[d.failsafe].phases and d.action > Action.NONE]
    if not applicable:
        return NOTHING
    impossible: set[Action] = set() if sticks_are_live else {Action.POSITION, Action.ALTITUDE}
    for demand in applicable:
        if demand.action > Action.WARN:
            impossible |= BEYOND_REACH.get(demand.failsafe, frozenset())
    without_sticks = max(Action.HOLD, action_of(Failsafe.MANUAL_LOST, behaviour))
    best = max(
        (Demand(d.failsafe, _possible(d.action, impossible, without_sticks)) for d in applicable),
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

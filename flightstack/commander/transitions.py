"""Transition table of arming and modes: each event, its conditions, and the resulting status. Pure.

``RULES`` is the complete behaviour. An unmet need refuses the event with the text of the need and changes nothing. As
in PX4, a disarmed vehicle accepts any mode.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import NamedTuple

from flightstack.core.enums import Mode


class Event(Enum):
    """Events that change mode or arming."""

    ARM = auto()
    DISARM = auto()
    FORCE_DISARM = auto()
    SELECT_TAKEOFF = auto()
    SELECT_MISSION = auto()
    SELECT_HOLD = auto()
    SELECT_RETURN = auto()
    SELECT_LAND = auto()
    SELECT_POSITION = auto()
    SELECT_ALTITUDE = auto()
    SELECT_OFFBOARD = auto()
    TAKEOFF_REACHED = auto()
    MISSION_FINISHED = auto()
    MISSION_ASKS_RETURN = auto()
    LANDED_LONG_ENOUGH = auto()
    NO_TAKEOFF = auto()
    TERMINATE = auto()


class Facts(NamedTuple):
    """State of the vehicle at an event."""

    state_is_valid: bool
    position_is_known: bool
    upright: bool
    landed: bool
    has_mission: bool
    mission_takes_off: bool
    manual_fresh: bool
    offboard_fresh: bool


class Status(NamedTuple):
    """Mode and arming."""

    armed: bool = False
    mode: Mode = Mode.HOLD


class Need(Enum):
    """A condition of a rule; the value is the refusal."""

    STATE = "no valid position and attitude yet"
    POSITION = "the position is lost"
    UPRIGHT = "the vehicle is tilted by more than 30 degrees"
    ON_GROUND = "the vehicle is in the air"
    IN_AIR = "the vehicle is on the ground"
    ARMED = "the vehicle is disarmed"
    MISSION = "no mission is loaded"
    TAKES_OFF = "the vehicle is on the ground and the mission continues with a landing or a return"
    MANUAL_STREAM = "no manual control is received"
    OFFBOARD_STREAM = "no offboard setpoints are received"


def is_met(need: Need, status: Status, facts: Facts) -> bool:
    """Return True if ``need`` is met."""
    return {
        Need.STATE: facts.state_is_valid,
        Need.POSITION: facts.position_is_known,
        Need.UPRIGHT: facts.upright,
        Need.ON_GROUND: facts.landed or not status.armed,
        Need.IN_AIR: status.armed and not facts.landed,
        Need.ARMED: status.armed,
        Need.MISSION: facts.has_mission,
        Need.TAKES_OFF: not facts.landed or facts.mission_takes_off,
        Need.MANUAL_STREAM: facts.manual_fresh,
        Need.OFFBOARD_STREAM: facts.offboard_fresh,
    }[need]


class Rule(NamedTuple):
    """One row: ``event`` needs ``modes`` and ``needs``; it sets ``armed`` and ``mode`` (None: unchanged)."""

    event: Event
    modes: tuple[Mode, ...]
    needs: tuple[Need, ...]
    armed: bool | None
    mode: Mode | None

    @property
    def selects(self) -> bool:
        """True if the event selects a mode; while disarmed it has no needs, because arming checks them."""
        return self.event.name.startswith("SELECT_")


FLYABLE = tuple(mode for mode in Mode if mode is not Mode.TERMINATION)
TERMINATED = "the flight was terminated: reboot the vehicle first"
"""Refusal of every event but TERMINATE after a termination, which lasts until a reboot."""

RULES = (
    Rule(Event.ARM, FLYABLE, (Need.STATE, Need.UPRIGHT), True, None),
    Rule(Event.DISARM, FLYABLE, (Need.ON_GROUND,), False, Mode.HOLD),
    Rule(Event.FORCE_DISARM, FLYABLE, (), False, Mode.HOLD),
    Rule(Event.TERMINATE, tuple(Mode), (), False, Mode.TERMINATION),
    Rule(Event.SELECT_TAKEOFF, FLYABLE, (Need.STATE, Need.POSITION, Need.ON_GROUND), None, Mode.TAKEOFF),
    Rule(
        Event.SELECT_MISSION,
        FLYABLE,
        (Need.STATE, Need.POSITION, Need.MISSION, Need.TAKES_OFF),
        None,
        Mode.MISSION,
    ),
    Rule(Event.SELECT_HOLD, FLYABLE, (Need.STATE, Need.POSITION), None, Mode.HOLD),
    Rule(Event.SELECT_RETURN, FLYABLE, (Need.STATE, Need.POSITION, Need.IN_AIR), None, Mode.RETURN),
    Rule(Event.SELECT_LAND, FLYABLE, (Need.STATE, Need.IN_AIR), None, Mode.LAND),
    Rule(
        Event.SELECT_POSITION, FLYABLE, (Need.STATE, Need.POSITION, Need.MANUAL_STREAM), None, Mode.POSITION
    ),
    Rule(Event.SELECT_ALTITUDE, FLYABLE, (Need.STATE, Need.MANUAL_STREAM), None, Mode.ALTITUDE),
    Rule(
        Event.SELECT_OFFBOARD, FLYABLE, (Need.STATE, Need.POSITION, Need.OFFBOARD_STREAM), None, Mode.OFFBOARD
    ),
    Rule(Event.TAKEOFF_REACHED, (Mode.TAKEOFF,), (Need.ARMED,), None, Mode.HOLD),
    Rule(Event.MISSION_FINISHED, (Mode.MISSION,), (), None, Mode.HOLD),
    Rule(Event.MISSION_ASKS_RETURN, (Mode.MISSION,), (Need.ARMED,), None, Mode.RETURN),
    Rule(Event.LANDED_LONG_ENOUGH, FLYABLE, (Need.ON_GROUND,), False, Mode.HOLD),
    Rule(Event.NO_TAKEOFF, FLYABLE, (Need.ON_GROUND,), False, Mode.HOLD),
)


class Outcome(NamedTuple):
    """The status after an event, and the reason of a refusal (None if accepted)."""

    status: Status
    refusal: str | None


def transition(status: Status, facts: Facts, event: Event) -> Outcome:
    """Apply ``event`` by the first rule for it in the present mode."""
    for rule in RULES:
        if rule.event is not event or status.mode not in rule.modes:
            continue
        for need in rule.needs if status.armed or not rule.selects else ():
            if not is_met(need, status, facts):
                return Outcome(status, need.value)
        return Outcome(
            Status(
                status.armed if rule.armed is None else rule.armed,
                status.mode if rule.mode is None else rule.mode,
            ),
            None,
        )
    if status.mode is Mode.TERMINATION:
        return Outcome(status, TERMINATED)
    return Outcome(status, f"not possible in mode {status.mode.name.lower()}")

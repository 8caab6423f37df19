"""An action as a value: the commands to send, and the state of the vehicle that shows their effect. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

from flightstack.mavlink.link import Message
from gcs_cli.autopilots.autopilot import VehicleCommand
from gcs_cli.vehicle.view_types import VehicleView

Condition: TypeAlias = Callable[[VehicleView], bool]

HEARTBEAT_LIMIT_S = 5.0
"""Limit of an effect that the next heartbeat shows."""


class Step(NamedTuple):
    """One command, and its effect."""

    name: str
    """Subject of a refusal: "arming", "takeoff"."""
    command: VehicleCommand
    effect: Condition | None
    """Holds once the effect is reached; None if the vehicle does not report it."""
    missing: str = ""
    """Predicate of an effect that was not reached in time: "is not armed"."""
    limit_s: float = HEARTBEAT_LIMIT_S
    """Time of the vehicle after which the effect counts as missing."""
    is_flight: bool = False
    """True if the time starts anew whenever the vehicle has moved."""
    modes: frozenset[str] = frozenset()
    """Modes that belong to the step: once in one of them, a change to another mode ends the action; empty: any."""
    needs_armed: bool = False
    """True if a disarm before the effect ends the action."""
    instead: Callable[[int, int], Message] | None = None
    """Message to system and component of the same effect, which has no answer, if the command is not supported."""
    reached_before: Condition = lambda _view: False
    """State in which a refusal only says that there is nothing left to do."""
    refusal: str = ""
    """Reason of a refusal that the vehicle does not explain; empty: its answer is the reason."""
    advice: str = ""
    """Follows the reason of a refusal: what else may be the cause, and what to do."""
    restarts: bool = False
    """True if the vehicle restarts: silence does not end the action, and the command is sent once."""


class Action(NamedTuple):
    """A user's request to a vehicle."""

    name: str
    plan: Callable[[VehicleView], tuple[Step, ...]]
    """Returns the steps for a vehicle in this state; raises ``ActionError``."""
    doing: str
    """The action under way: "taking off to 10 m"."""
    done: str
    """The reached effect: "at 10 m"."""
    facts: Mapping[str, Any] = {}
    """Values for programs, with the unit in the key."""
    needs: Condition | None = None
    """State that ``plan`` needs, for example a position."""
    needs_text: str = ""
    """Text of the error if that state is not reached."""
    does_without: Condition = lambda _view: False
    """State in which the action goes on although that state was not reached in time."""
    unseen: str = ""
    """Says why an accepted action ends without its effect: "the vehicle does not report its speed limit"."""
    goes_on_without_link: bool = False
    """True if a vehicle whose heartbeat has timed out gets the command as well: it may still receive."""


class ActionError(Exception):
    """The action is impossible with this vehicle; one sentence."""


class NotReadyError(ActionError):
    """The present state of the vehicle does not permit the action; one sentence."""

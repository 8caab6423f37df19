"""Allowed values of parameters 1 to 4 of each command."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from flightstack.plan.commands import Command, MissionResult
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Fault


class Rule(NamedTuple):
    """Rule for one parameter: its number, meaning, allowed values as text, and predicate."""

    number: int
    meaning: str
    allowed: str
    holds: Callable[[float], bool]


def _default_or_positive(value: float) -> bool:
    return math.isnan(value) or value >= 0.0


_HOLD = Rule(1, "hold time", "0 s or more", _default_or_positive)

_RULES: dict[int, tuple[Rule, ...]] = {
    Command.NAV_WAYPOINT: (
        _HOLD,
        Rule(2, "acceptance radius", "0 m or more", _default_or_positive),
    ),
    Command.NAV_LOITER_TIME: (_HOLD,),
    Command.NAV_DELAY: (
        Rule(1, "delay", "0 s or more; a time of day (-1) is not supported", lambda value: value >= 0.0),
    ),
    Command.CONDITION_YAW: (
        Rule(1, "angle", "-360 to 360 degrees", lambda value: abs(value) <= 360.0),
        Rule(2, "yaw rate", "0 deg/s (the default) or more", _default_or_positive),
        Rule(3, "direction", "-1, 0 or 1", lambda value: math.isnan(value) or value in (-1.0, 0.0, 1.0)),
        Rule(4, "reference", "0 (absolute) or 1 (relative)", lambda value: value in (0.0, 1.0)),
    ),
    Command.DO_CHANGE_SPEED: (
        Rule(1, "speed type", "0 or 1 (horizontal speed)", lambda value: value in (0.0, 1.0)),
        Rule(
            2,
            "speed",
            "above 0 m/s, -1 (no change) or -2 (the default)",
            lambda value: value > 0.0 or value in (-1.0, -2.0),
        ),
    ),
    Command.DO_JUMP: (
        Rule(
            2,
            "repeat count",
            "a whole number, or -1 for ever",
            lambda value: value == -1.0 or (value >= 0.0 and value == math.floor(value)),
        ),
    ),
}  # values are finite or NaN: infinities are refused before


def parameter_fault(item: MissionItem, seq: int, count: int) -> Fault | None:
    """Return the fault of the parameters of item ``seq`` of ``count``, or None."""
    for number, value in enumerate((*item.params, 0.0, 0.0, item.z), start=1):
        if math.isinf(value):
            return Fault(_invalid(number), f"parameter {number} is infinite")
    for rule in _RULES.get(item.command, ()):
        value = item.params[rule.number - 1]
        if not rule.holds(value):
            reason = f"{rule.meaning} {value:g} (parameter {rule.number}) must be {rule.allowed}"
            return Fault(_invalid(rule.number), reason)
    if item.command == Command.DO_JUMP:
        return _jump_fault(item.param1, seq, count)
    return None


def _invalid(number: int) -> MissionResult:
    return MissionResult(MissionResult.INVALID_PARAM1 + number - 1)


def _jump_fault(target: float, seq: int, count: int) -> Fault | None:
    if not 0.0 <= target < count or target != math.floor(target):
        reason = f"jumps to item {target:g}, and the mission's items are 0 to {count - 1}"
        return Fault(MissionResult.INVALID_PARAM1, reason)
    if target == seq:
        return Fault(MissionResult.INVALID_PARAM1, "jumps to itself")
    return None

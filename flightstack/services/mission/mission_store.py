"""Storage of the plans in force, one of each type, and the events of the mission protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

from flightstack.mavlink.mission_messages import mission_id
from flightstack.plan.commands import (
    MAX_FENCE_ITEMS,
    MAX_MISSION_ITEMS,
    MAX_RALLY_POINTS,
    PLAN_NAMES,
    MissionResult,
    MissionType,
)
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Rejection

Items: TypeAlias = tuple[MissionItem, ...]
Check: TypeAlias = Callable[[Items], Rejection | None]

MAX_ITEMS: Mapping[MissionType, int] = {
    MissionType.MISSION: MAX_MISSION_ITEMS,
    MissionType.FENCE: MAX_FENCE_ITEMS,
    MissionType.RALLY: MAX_RALLY_POINTS,
}


class MissionReplaced(NamedTuple):
    """A new plan is in force; ``is_changed`` is False if it equals the old one."""

    mission_type: MissionType
    items: Items
    mission_id: int
    is_changed: bool


class MissionCleared(NamedTuple):
    """The plan was removed."""

    mission_type: MissionType


class CurrentRequested(NamedTuple):
    """A client requests an existing mission item as the current one."""

    seq: int


class MissionRefused(NamedTuple):
    """A request was refused. The reason goes to a STATUSTEXT, since MISSION_ACK has no text."""

    result: MissionResult
    seq: int | None
    reason: str
    mission_type: MissionType = MissionType.MISSION


MissionEvent: TypeAlias = MissionReplaced | MissionCleared | CurrentRequested | MissionRefused


class PlanStore:
    """Stores one plan of each type in ``checks``. A new plan must pass its check."""

    def __init__(self, checks: Mapping[MissionType, Check]) -> None:
        self._checks: dict[int, Check] = {int(kind): check for kind, check in checks.items()}
        self._items: dict[int, Items] = dict.fromkeys(checks, ())
        self._ids: dict[int, int] = dict.fromkeys(checks, 0)

    @property
    def kinds(self) -> tuple[MissionType, ...]:
        """Plan types of the store."""
        return tuple(MissionType(kind) for kind in self._items)

    def has(self, kind: int) -> bool:
        """Return True if plans of this MAV_MISSION_TYPE are supported. Any number is allowed."""
        return kind in self._items

    def items(self, kind: int) -> Items:
        """Return the plan in force; empty for an unsupported type."""
        return self._items.get(kind, ())

    def plan_id(self, kind: int) -> int:
        """Return MAVLink's opaque id of the plan in force, which changes with the plan; 0 for none."""
        return self._ids.get(kind, 0)

    def too_long(self, kind: int, count: int) -> str | None:
        """Return the reason that a plan of ``count`` items is too long, or None."""
        most = MAX_ITEMS[MissionType(kind)]
        if count <= most:
            return None
        return f"the {PLAN_NAMES[MissionType(kind)]} has {count} items, and at most {most} are allowed"

    def replace(self, kind: int, items: Items) -> MissionReplaced | Rejection:
        """Replace the plan in force by a complete one that passes its check."""
        rejection = self._checks[kind](items)
        if rejection is not None:
            return rejection
        is_changed = items != self._items[kind]
        self._items[kind] = items
        self._ids[kind] = mission_id(items)
        return MissionReplaced(MissionType(kind), items, self._ids[kind], is_changed)

    def clear(self, kind: int) -> MissionCleared:
        """Remove a plan."""
        self._items[kind] = ()
        self._ids[kind] = 0
        return MissionCleared(MissionType(kind))

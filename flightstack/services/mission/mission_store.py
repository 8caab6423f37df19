"""The plans in force on the vehicle, one of each type, and what happens to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

from flightstack.mavlink.mission_messages import mission_id
from flightstack.plan.item import MissionItem
from flightstack.plan.rejection import Rejection
from flightstack.plan.vocabulary import (
    MAX_FENCE_ITEMS,
    MAX_MISSION_ITEMS,
    MAX_RALLY_POINTS,
    PLAN_NAMES,
    MissionResult,
    MissionType,
)

Items: TypeAlias = tuple[MissionItem, ...]
Check: TypeAlias = Callable[[Items], Rejection | None]

MAX_ITEMS: Mapping[MissionType, int] = {
    MissionType.MISSION: MAX_MISSION_ITEMS,
    MissionType.FENCE: MAX_FENCE_ITEMS,
    MissionType.RALLY: MAX_RALLY_POINTS,
}


class MissionReplaced(NamedTuple):
    """A new plan is in force. A plan equal to the old one counts, with ``is_changed`` false."""

    mission_type: MissionType
    items: Items
    mission_id: int
    is_changed: bool


class MissionCleared(NamedTuple):
    """The plan was removed."""

    mission_type: MissionType


class CurrentRequested(NamedTuple):
    """A client asks to continue at this item of the mission, which exists."""

    seq: int


class MissionRefused(NamedTuple):
    """A client's wish was refused; the reason is for a STATUSTEXT, since MISSION_ACK has no room for it."""

    result: MissionResult
    seq: int | None
    reason: str
    mission_type: MissionType = MissionType.MISSION


MissionEvent: TypeAlias = MissionReplaced | MissionCleared | CurrentRequested | MissionRefused


class PlanStore:
    """Keeps one plan of each type in ``checks``; a plan is replaced only by a whole one that passed its check."""

    def __init__(self, checks: Mapping[MissionType, Check]) -> None:
        self._checks: dict[int, Check] = {int(kind): check for kind, check in checks.items()}
        self._items: dict[int, Items] = dict.fromkeys(checks, ())
        self._ids: dict[int, int] = dict.fromkeys(checks, 0)

    @property
    def kinds(self) -> tuple[MissionType, ...]:
        """The types of plans that are kept."""
        return tuple(MissionType(kind) for kind in self._items)

    def has(self, kind: int) -> bool:
        """Tell whether plans of this MAV_MISSION_TYPE, any number, are kept."""
        return kind in self._items

    def items(self, kind: int) -> Items:
        """Return the plan in force; empty also for a type that is not kept."""
        return self._items.get(kind, ())

    def plan_id(self, kind: int) -> int:
        """Return MAVLink's opaque id of the plan in force: it changes with every change of it, 0 for none."""
        return self._ids.get(kind, 0)

    def too_long(self, kind: int, count: int) -> str | None:
        """Return why a plan of ``count`` items has no room, or None."""
        most = MAX_ITEMS[MissionType(kind)]
        if count <= most:
            return None
        return f"the {PLAN_NAMES[MissionType(kind)]} has {count} items, and at most {most} are allowed"

    def replace(self, kind: int, items: Items) -> MissionReplaced | Rejection:
        """Put a whole plan in force if it passes its check."""
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

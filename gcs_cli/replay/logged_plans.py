"""Missions, geofences and rally points that a tlog has, from the transfers to and from the vehicle. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from flightstack.mavlink.dialect import mavlink
from flightstack.mavlink.fields import int32
from flightstack.mavlink.link import Message

_COUNTS_AND_ITEMS = ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM")
_E7 = 1e7


class LoggedPlan(NamedTuple):
    """A plan from ``since_s`` on; if ``was_held``, the vehicle had it before."""

    since_s: float
    was_held: bool
    items: tuple[Message, ...]


class _Transfer:
    """The items of one transfer."""

    def __init__(self, count: int, is_upload: bool) -> None:
        self.count = count
        self.is_upload = is_upload
        self.items: dict[int, Message] = {}

    @property
    def is_complete(self) -> bool:
        return all(seq in self.items for seq in range(self.count))

    def plan(self, at_s: float) -> LoggedPlan:
        items = tuple(self.items[seq] for seq in range(self.count))
        return LoggedPlan(at_s, not self.is_upload, items)


class LoggedPlans:
    """Collects the plans of the vehicle with system id ``vehicle``. ``take`` the messages of the log in order."""

    def __init__(self, vehicle: int) -> None:
        self._vehicle = vehicle
        self._transfers: dict[int, _Transfer] = {}
        self._plans: dict[int, list[LoggedPlan]] = {}

    def take(self, message: Message, at_s: float) -> None:
        """Take a message; other messages than those of plans are ignored."""
        kind, is_own = message.get_type(), message.get_srcSystem() == self._vehicle
        if not kind.startswith("MISSION_") or not (
            is_own or getattr(message, "target_system", -1) == self._vehicle
        ):
            return
        if kind in _COUNTS_AND_ITEMS:
            self._take_content(kind, message, at_s, is_upload=not is_own)
        elif kind == "MISSION_ACK" and is_own and message.type == mavlink.MAV_MISSION_ACCEPTED:
            transfer = self._transfers.pop(message.mission_type, None)
            if transfer is not None and transfer.is_upload and transfer.is_complete:
                self._add(message.mission_type, transfer.plan(at_s))
        elif kind == "MISSION_CLEAR_ALL":
            self._transfers[message.mission_type] = _Transfer(0, is_upload=True)

    def _take_content(self, kind: str, message: Message, at_s: float, is_upload: bool) -> None:
        if kind == "MISSION_COUNT":
            self._transfers[message.mission_type] = _Transfer(message.count, is_upload)
        transfer = self._transfers.get(message.mission_type)
        if transfer is None or transfer.is_upload != is_upload:
            return
        if kind != "MISSION_COUNT":
            transfer.items[message.seq] = message
        if not is_upload and transfer.is_complete:
            self._add(message.mission_type, transfer.plan(at_s))
            del self._transfers[message.mission_type]

    def _add(self, kind: int, plan: LoggedPlan) -> None:
        kinds = range(mavlink.MAV_MISSION_TYPE_RALLY + 1) if kind == mavlink.MAV_MISSION_TYPE_ALL else (kind,)
        for each in kinds:
            self._plans.setdefault(each, []).append(plan)

    def at(self, kind: int, at_s: float) -> Sequence[Message]:
        """Return the items that the vehicle had at a time: MISSION_ITEM_INT or MISSION_ITEM messages."""
        plans = self._plans.get(kind, [])
        before = [plan for plan in plans if plan.since_s <= at_s or (plan is plans[0] and plan.was_held)]
        return before[-1].items if before else ()


def item_message(item: Message, target: tuple[int, int]) -> Message:
    """Return MISSION_ITEM_INT with an item of a log, for ``target``."""
    x, y = item.x, item.y
    if item.get_type() == "MISSION_ITEM":
        x, y = int32(_E7 * x), int32(_E7 * y)
    params = item.param1, item.param2, item.param3, item.param4
    return mavlink.MAVLink_mission_item_int_message(
        *target, item.seq, item.frame, item.command, item.current, item.autocontinue, *params, x, y, item.z,
        item.mission_type,
    )  # fmt: skip

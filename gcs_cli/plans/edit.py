"""Edits of a mission: pure functions over a tuple of items.

Targets of DO_JUMP keep their item. A jump to a deleted item goes to the item that takes its number.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, TypeAlias

from flightstack.plan import Command, MissionItem, command_name
from flightstack.plan.item import integer_coordinate

Items: TypeAlias = tuple[MissionItem, ...]

FIELDS = ("latitude", "longitude", *(field.name for field in fields(MissionItem)))
"""Names of the fields that ``change`` accepts; latitude and longitude in degrees."""


def add(items: Items, seq: int, item: MissionItem) -> Items:
    """Insert ``item`` with the number ``seq``, 0 to the number of items."""
    _check(seq, len(items) + 1)
    moved = _retargeted(items, lambda target: target + (target >= seq))
    return (*moved[:seq], item, *moved[seq:])


def delete(items: Items, seq: int) -> Items:
    """Remove item ``seq``."""
    _check(seq, len(items))
    last = len(items) - 2
    moved = _retargeted(items, lambda target: max(0, min(target - (target > seq), last)))
    return (*moved[:seq], *moved[seq + 1 :])


def move(items: Items, seq: int, to: int) -> Items:
    """Move item ``seq`` so that its number is ``to``."""
    _check(seq, len(items))
    _check(to, len(items))
    order = list(range(len(items)))
    order.insert(to, order.pop(seq))
    moved = _retargeted(items, order.index)
    return tuple(moved[index] for index in order)


def change(items: Items, seq: int, **values: Any) -> Items:
    """Change fields of item ``seq``, named as in ``FIELDS``; raise ValueError for a name or value that is not valid."""
    _check(seq, len(items))
    item = items[seq]
    changes = dict(values)
    for name, axis, limit_deg in (("latitude", "x", 90.0), ("longitude", "y", 180.0)):
        if name in changes:
            if not item.is_global:
                raise ValueError(f"item {seq} ({command_name(item.command)}) has no {name}")
            degrees = float(changes.pop(name))
            if not (math.isnan(degrees) or abs(degrees) <= limit_deg):
                raise ValueError(f"{name} {degrees:g} is outside -{limit_deg:g} to {limit_deg:g}")
            changes[axis] = integer_coordinate(degrees, is_global=True)
    unknown = set(changes) - set(FIELDS)
    if unknown:
        raise ValueError(f"{min(unknown)} is not a field of an item; those are {', '.join(FIELDS)}")
    return (*items[:seq], replace(item, **changes), *items[seq + 1 :])


def shifted(items: Items, step: int) -> Items:
    """Return ``items`` with all targets of DO_JUMP changed by ``step``, for a list that begins elsewhere."""
    return _retargeted(items, lambda target: target + step)


def _retargeted(items: Items, number_of: Callable[[int], int]) -> Items:
    return tuple(
        replace(item, param1=float(number_of(int(item.param1)))) if _jumps_within(item, len(items)) else item
        for item in items
    )


def _jumps_within(item: MissionItem, count: int) -> bool:
    return item.command == Command.DO_JUMP and item.param1.is_integer() and 0 <= item.param1 < count


def _check(seq: int, count: int) -> None:
    if not 0 <= seq < count:
        raise ValueError(f"item {seq}: the numbers are 0 to {count - 1}")

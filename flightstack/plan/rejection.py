"""Rejections of missions, geofences and rally points."""

from __future__ import annotations

from typing import NamedTuple

from flightstack.plan.commands import GLOBAL_FRAMES, MissionResult, command_name
from flightstack.plan.item import MissionItem


class Fault(NamedTuple):
    """Fault of an item, without its number."""

    result: MissionResult
    reason: str


class Rejection(NamedTuple):
    """Rejection of a plan."""

    result: MissionResult
    seq: int | None
    """Number of the faulty item; None for the plan as a whole."""
    reason: str
    """One sentence that names the item."""


def item_rejection(seq: int, item: MissionItem, fault: Fault) -> Rejection:
    """Return the rejection of item ``seq``."""
    return Rejection(fault.result, seq, f"item {seq} ({command_name(item.command)}): {fault.reason}")


def place_fault(item: MissionItem) -> Fault | None:
    """Return the fault of the position of an item that requires one, or None."""
    if item.frame not in GLOBAL_FRAMES:
        return Fault(
            MissionResult.UNSUPPORTED_FRAME, f"needs a global frame (0, 3, 5 or 6), not {item.frame}"
        )
    if item.position_deg is None:
        return Fault(MissionResult.INVALID_PARAM5_X, "latitude and longitude must be given")
    return range_fault(*item.position_deg)


def range_fault(latitude_deg: float, longitude_deg: float) -> Fault | None:
    """Return the fault of a latitude or longitude out of range, or None."""
    if not abs(latitude_deg) <= 90.0:
        reason = f"latitude {latitude_deg:.7f} is outside -90 to 90 degrees"
        return Fault(MissionResult.INVALID_PARAM5_X, reason)
    if not abs(longitude_deg) <= 180.0:
        reason = f"longitude {longitude_deg:.7f} is outside -180 to 180 degrees"
        return Fault(MissionResult.INVALID_PARAM6_Y, reason)
    return None

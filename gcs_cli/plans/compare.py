"""Comparison of a plan with the one that a vehicle holds, item by item."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from flightstack.plan import Frame, MissionItem
from flightstack.plan.commands import RALLY_POINT, FenceCommand
from gcs_cli.autopilots.autopilot import Packing
from gcs_cli.plans.names import any_command_name

_EQUIVALENT_FRAMES = {
    Frame.GLOBAL_INT: Frame.GLOBAL,
    Frame.GLOBAL_RELATIVE_ALT_INT: Frame.GLOBAL_RELATIVE_ALT,
    11: 10,  # GLOBAL_TERRAIN_ALT_INT
}

_ALL_KEPT: Packing = {}
_PLACES_ONLY = frozenset(FenceCommand) | {RALLY_POINT}


class Difference(NamedTuple):
    """A field, or a whole item, that differs."""

    seq: int
    field: str
    """``item`` for an item that one of the two lacks."""
    wanted: Any
    found: Any
    """None for a missing item."""
    cannot_be_held: bool = False
    """True if the vehicle's storage has no room for the wanted value: another upload ends alike."""

    @property
    def sentence(self) -> str:
        """The difference in words."""
        if self.field == "item":
            which = "is not on the vehicle" if self.found is None else "is only on the vehicle"
            item = self.wanted if self.found is None else self.found
            return f"item {self.seq} ({any_command_name(item.command)}) {which}"
        why = ", which the vehicle cannot hold" if self.cannot_be_held else ""
        return f"item {self.seq}: {self.field} is {_text(self.found)}, expected {_text(self.wanted)}{why}"


class Tolerance(NamedTuple):
    """Differences that a vehicle's storage makes; none by default."""

    altitude_m: float = 0.0
    degrees_e7: int = 0
    nan_is_zero: bool = False
    """The vehicle stores 0 for NaN."""
    keeps_autocontinue: bool = True
    keeps_idle_frames: bool = True
    """The vehicle stores the frame of an item without a position."""
    packing: Packing = _ALL_KEPT
    """What the vehicle keeps of parameters that it does not store as they are."""


EXACT = Tolerance()
PACKED_ITEMS = Tolerance(  # as ArduPilot
    altitude_m=0.01, degrees_e7=1, nan_is_zero=True, keeps_autocontinue=False, keeps_idle_frames=False
)


def differences(
    wanted: Sequence[MissionItem], found: Sequence[MissionItem], tolerance: Tolerance = EXACT
) -> Iterator[Difference]:
    """Yield the differences of two lists of items as float32, in the order of their numbers."""
    for seq in range(max(len(wanted), len(found))):
        if seq >= len(found):
            yield Difference(seq, "item", wanted[seq], None)
        elif seq >= len(wanted):
            yield Difference(seq, "item", None, found[seq])
        else:
            yield from _field_differences(seq, wanted[seq].on_wire(), found[seq].on_wire(), tolerance)


def _field_differences(
    seq: int, wanted: MissionItem, found: MissionItem, tolerance: Tolerance
) -> Iterator[Difference]:
    if wanted.command != found.command:
        names = any_command_name(wanted.command), any_command_name(found.command)
        yield Difference(seq, "command", *names)
        return  # the fields of another command have other meanings
    if _frame(wanted) != _frame(found) and (tolerance.keeps_idle_frames or wanted.is_global):
        yield Difference(seq, "frame", wanted.frame, found.frame)
    for number, (one, other) in enumerate(zip(wanted.params, found.params, strict=True), start=1):
        if not _same(one, other, 0.0, tolerance):
            cannot = _is_all_kept(tolerance.packing, wanted.command, number, one, other)
            yield Difference(seq, f"parameter {number}", one, other, cannot)
    for name, one_e7, other_e7 in (("latitude", wanted.x, found.x), ("longitude", wanted.y, found.y)):
        if abs(one_e7 - other_e7) > tolerance.degrees_e7:
            shown = (one_e7 / 1e7, other_e7 / 1e7) if wanted.is_global else (one_e7, other_e7)
            yield Difference(seq, name, *shown)
    if not _same(wanted.z, found.z, tolerance.altitude_m, tolerance):
        yield Difference(seq, "altitude", wanted.z, found.z)
    if _has_autocontinue(wanted, tolerance) and wanted.autocontinue != found.autocontinue:
        yield Difference(seq, "autocontinue", wanted.autocontinue, found.autocontinue)


def _is_all_kept(packing: Packing, command: int, number: int, wanted: float, found: float) -> bool:
    """Return True if ``found`` is all that the vehicle can keep of ``wanted``, parameter ``number`` from 1."""
    row = packing.get(command)
    sent = 0.0 if math.isnan(wanted) else wanted
    return (
        row is not None and math.isfinite(sent) and math.isclose(row[number - 1](sent), found, rel_tol=1e-6)
    )


def _has_autocontinue(item: MissionItem, tolerance: Tolerance) -> bool:
    """Return True if autocontinue has a meaning: a geofence and rally points have none, and PX4 stores it as 0."""
    return tolerance.keeps_autocontinue and item.command not in _PLACES_ONLY


def _frame(item: MissionItem) -> int:
    return _EQUIVALENT_FRAMES.get(item.frame, item.frame)


def _same(one: float, other: float, within: float, tolerance: Tolerance) -> bool:
    if tolerance.nan_is_zero:
        one, other = (0.0 if math.isnan(value) else value for value in (one, other))
    return (math.isnan(one) and math.isnan(other)) or abs(one - other) <= within


def _text(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)

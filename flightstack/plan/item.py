"""A mission item, as it is on the wire."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from flightstack.core.float32 import as_float32
from flightstack.core.geodesy import GeoPoint
from flightstack.plan.vocabulary import (
    ALSO_UNSET_E7,
    GLOBAL_FRAMES,
    OPEN_POSITION_COMMANDS,
    PLACE_COMMANDS,
    RELATIVE_FRAMES,
    UNSET_E7,
)

_OUT_OF_RANGE = UNSET_E7 - 1  # no latitude, no longitude, and not the mark of an open one


@dataclass(frozen=True, slots=True, eq=False)
class MissionItem:
    """One item; its number is its place in the mission. NaN in a parameter means "the vehicle's default".

    ``x`` and ``y`` are what MISSION_ITEM_INT carries: 1e-7 degrees of latitude and longitude in the global
    frames (``UNSET_E7`` when left open), plain numbers in frame MISSION. ``z`` is the altitude in metres,
    above home in the relative frames, else above sea level. Two items are equal if they mean the same: NaN
    equals NaN.
    """

    command: int
    frame: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = 0.0
    x: int = 0
    y: int = 0
    z: float = 0.0
    autocontinue: bool = True

    @property
    def params(self) -> tuple[float, float, float, float]:
        """Parameters 1 to 4."""
        return self.param1, self.param2, self.param3, self.param4

    @property
    def is_global(self) -> bool:
        """Tell whether x and y are scaled as latitude and longitude."""
        return self.frame in GLOBAL_FRAMES

    @property
    def altitude_is_relative(self) -> bool:
        """Tell whether the altitude counts from home."""
        return self.frame in RELATIVE_FRAMES

    @property
    def position_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude in degrees; None when the item has none or leaves it open.

        A takeoff or landing at exactly 0, 0 leaves it open too: that is how clients without NaN say it.
        """
        if self.command not in PLACE_COMMANDS or not self.is_global:
            return None
        if is_unset(self.x) or is_unset(self.y):
            return None
        if self.command in OPEN_POSITION_COMMANDS and self.x == 0 and self.y == 0:
            return None
        return self.x / 1e7, self.y / 1e7

    def on_wire(self) -> MissionItem:
        """Return the item after its floats went through MAVLink's 32-bit ones."""
        return replace(
            self,
            param1=as_float32(self.param1),
            param2=as_float32(self.param2),
            param3=as_float32(self.param3),
            param4=as_float32(self.param4),
            z=as_float32(self.z),
        )

    def _key(self) -> tuple[object, ...]:
        floats = (*self.params, self.z)
        return (
            self.command, self.frame, self.x, self.y, self.autocontinue,
            *(None if math.isnan(value) else value for value in floats),
        )  # fmt: skip

    def __eq__(self, other: object) -> bool:
        return self._key() == other._key() if isinstance(other, MissionItem) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key())


def is_unset(x_or_y: int) -> bool:
    """Tell whether a latitude or longitude [1e-7 deg] is left open."""
    return x_or_y in (UNSET_E7, ALSO_UNSET_E7)


def integer_coordinate(value: float, is_global: bool) -> int:
    """Return the wire's integer for a latitude, longitude [deg] or plain number, whatever its value.

    NaN gives ``UNSET_E7``; what no 32-bit integer holds gives a number out of every range.
    """
    if math.isnan(value):
        return UNSET_E7
    scaled = value * 1e7 if is_global else value
    if not -_OUT_OF_RANGE < scaled < _OUT_OF_RANGE:
        return int(math.copysign(_OUT_OF_RANGE, value))
    return round(scaled)


def float_coordinate(value: int, is_global: bool) -> float:
    """Return the latitude, longitude [deg] or plain number of the wire's integer; NaN when left open."""
    if is_unset(value):
        return math.nan
    return value / 1e7 if is_global else float(value)


@dataclass(frozen=True)
class Plan:
    """Mission items in flying order and the planned home.

    ``document`` is the JSON document that the plan was read from (never changed). Every key that we do not
    know lives there, and is written back. ``comments`` are those of a waypoint file,
    each with the number of the line of values before which it stands.
    """

    items: tuple[MissionItem, ...]
    home: GeoPoint | None = None
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    comments: tuple[tuple[int, str], ...] = ()
    fence: tuple[MissionItem, ...] = ()
    """The geofence, as items."""
    rally: tuple[MissionItem, ...] = ()
    """The rally points, as items."""

    @property
    def has_fence_or_rally(self) -> bool:
        """Tell whether there are geofence or rally points, be it of a version that we cannot read."""
        if self.fence or self.rally:
            return True
        fence, rally = self.document.get("geoFence"), self.document.get("rallyPoints")
        lists = [
            part.get(key)
            for part in (fence, rally)
            if isinstance(part, dict)
            for key in ("circles", "polygons", "polygon", "points")
        ]
        return any(lists)

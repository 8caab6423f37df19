"""Mission items as in MAVLink, and plans made of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from flightstack.core.float32 import as_float32
from flightstack.core.geodesy import GeoPoint
from flightstack.plan.commands import (
    ALSO_UNSET_E7,
    OPEN_POSITION_COMMANDS,
    PLACE_COMMANDS,
    RELATIVE_FRAMES,
    SCALED_FRAMES,
    UNSET_E7,
)

_OUT_OF_RANGE = UNSET_E7 - 1  # outside all latitudes and longitudes, and not UNSET_E7


@dataclass(frozen=True, slots=True, eq=False)
class MissionItem:
    """One item, numbered by its position in the plan. A NaN parameter means "the vehicle's default".

    ``x`` and ``y`` are the integers of MISSION_ITEM_INT: latitude and longitude in 1e-7 degrees in the global frames
    (``UNSET_E7`` if not given), plain numbers in frame MISSION. ``z`` is the altitude in metres, above home in the
    relative frames, above the terrain in the terrain frames, else above sea level. NaN equals NaN when items are
    compared.
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
        """True if x and y are a latitude and longitude."""
        return self.frame in SCALED_FRAMES

    @property
    def altitude_is_relative(self) -> bool:
        """True if the altitude is relative to home."""
        return self.frame in RELATIVE_FRAMES

    @property
    def position_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude in degrees, or None without a position.

        A takeoff or landing at exactly 0, 0 has no position either: some clients send this instead of NaN.
        """
        if self.command not in PLACE_COMMANDS or not self.is_global:
            return None
        if is_unset(self.x) or is_unset(self.y):
            return None
        if self.command in OPEN_POSITION_COMMANDS and self.x == 0 and self.y == 0:
            return None
        return self.x / 1e7, self.y / 1e7

    def on_wire(self) -> MissionItem:
        """Return the item with its floats rounded to float32."""
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
    """Return True if a latitude or longitude [1e-7 deg] is not given."""
    return x_or_y in (UNSET_E7, ALSO_UNSET_E7)


def integer_coordinate(value: float, is_global: bool) -> int:
    """Return MAVLink's integer for a latitude, longitude [deg] or plain number.

    NaN gives ``UNSET_E7``; values beyond 32 bits give a number outside every valid range.
    """
    if math.isnan(value):
        return UNSET_E7
    scaled = value * 1e7 if is_global else value
    if not -_OUT_OF_RANGE < scaled < _OUT_OF_RANGE:
        return int(math.copysign(_OUT_OF_RANGE, value))
    return round(scaled)


def float_coordinate(value: int, is_global: bool) -> float:
    """Return the latitude, longitude [deg] or plain number of MAVLink's integer; NaN for an unset one."""
    if is_unset(value):
        return math.nan
    return value / 1e7 if is_global else float(value)


@dataclass(frozen=True)
class Plan:
    """Mission items in flying order and the planned home.

    ``document`` is the JSON document that the plan was read from, never changed; its unknown keys are written back.
    ``comments`` are those of a waypoint file, each with the number of the row that follows it.
    """

    items: tuple[MissionItem, ...]
    home: GeoPoint | None = None
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    comments: tuple[tuple[int, str], ...] = ()
    fence: tuple[MissionItem, ...] = ()
    """Items of the geofence."""
    rally: tuple[MissionItem, ...] = ()
    """Items of the rally points."""

    @property
    def has_fence_or_rally(self) -> bool:
        """True if the plan has a geofence or rally points, even in an unsupported version."""
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

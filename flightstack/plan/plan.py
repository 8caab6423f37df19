"""A plan: what to fly, from where, and all else its file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flightstack.core.geodesy import GeoPoint
from flightstack.plan.item import MissionItem


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

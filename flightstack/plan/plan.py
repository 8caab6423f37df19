"""A plan: what to fly, from where, and all else its file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from flightstack.geodesy import GeoPoint
from flightstack.plan.item import MissionItem


@dataclass(frozen=True)
class Plan:
    """Mission items in flying order and the planned home.

    ``document`` is the JSON document that the plan was read from (never changed). Geofence, rally points and
    every key that we do not know live there, and are written back. ``comments`` are those of a waypoint file,
    each with the number of the line of values before which it stands.
    """

    items: tuple[MissionItem, ...]
    home: GeoPoint | None = None
    document: Mapping[str, Any] = field(default_factory=dict, repr=False)
    comments: tuple[tuple[int, str], ...] = ()

    @property
    def has_fence_or_rally(self) -> bool:
        """Tell whether the document holds geofence or rally points."""
        fence, rally = self.document.get("geoFence"), self.document.get("rallyPoints")
        lists = [
            part.get(key)
            for part in (fence, rally)
            if isinstance(part, dict)
            for key in ("circles", "polygons", "polygon", "points")
        ]
        return any(lists)

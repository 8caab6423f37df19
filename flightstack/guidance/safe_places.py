"""Where the vehicle may fly and where it returns to: geofence, home and rally points. No I/O, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.core.portable_math import distance
from flightstack.guidance.fence import NO_FENCE, Fence
from flightstack.guidance.rally import HOME, NEAREST, RALLY_FIRST, ReturnPlace, choose, rally_points
from flightstack.params.behaviour import Behaviour
from flightstack.plan import (
    DEFAULT_LIMITS,
    Limits,
    MissionItem,
    Rejection,
    check_fence,
    check_mission,
    check_rally,
)


def plan_limits(b: Behaviour) -> Limits:
    """Return what a plan may ask for; without GF_MAX_VER_DIST, the altitude that missions always had."""
    return Limits(
        max_first_distance_m=b.first_waypoint_distance_m,
        max_distance_m=b.waypoint_distance_m,
        max_altitude_m=b.fence_max_altitude_m or DEFAULT_LIMITS.max_altitude_m,
        max_home_distance_m=b.fence_max_distance_m,
    )


FARTHEST_HOME_M = 100_000.0
"""Beyond this a home is a mistake: the local frame is flat."""
GREATEST_HOME_STEP_M = 1_000.0
"""So far above or below the origin home may be: missions and returns measure their heights from it."""
HOME_SPREAD_M = 0.05
"""So far a vehicle may stand from home and be there: the ground gives by less, and home need not follow that."""


class SafePlaces:
    """The geofence and the rally points in force, and the checks of plans against them."""

    def __init__(self, origin: GeoPoint) -> None:
        """Measure in metres from ``origin``, the origin of the local frame."""
        self.frame = LocalFrame(origin)
        self.home_point = origin
        self.fence: Fence = NO_FENCE
        self.home: ReturnPlace = HOME
        """Where home is; it may be set elsewhere than at the origin."""
        self.home_is_chosen = False
        """Whether a user named the place: then it does not follow the vehicle."""
        self.points: tuple[ReturnPlace, ...] = ()
        self._rally_items: tuple[MissionItem, ...] = ()
        self.ids: tuple[int, int, int] = (0, 0, 0)
        """Opaque ids of mission, geofence and rally points; the owner of the stores keeps them."""

    def set_home(self, point: GeoPoint, chosen: bool) -> str | None:
        """Move home; return why not, or None. ``chosen`` is true for a place that a user named."""
        if not all(math.isfinite(number) for number in point):
            return "home has no such position"
        if abs(point.latitude_deg) > 90.0 or abs(point.longitude_deg) > 180.0:
            return "home is not a place on earth"
        local = self.frame.to_ned(point)
        if distance(local.x, local.y) > FARTHEST_HOME_M:
            return f"home is more than {FARTHEST_HOME_M / 1e3:g} km from where the vehicle started"
        if abs(local.z) > GREATEST_HOME_STEP_M:
            return f"home is more than {GREATEST_HOME_STEP_M:g} m above or below where the vehicle started"
        self.home_point, self.home_is_chosen = point, chosen
        self.home = ReturnPlace(local.x, local.y, -local.z)
        self.set_rally(self._rally_items)
        return None

    def has_left_home(self, position_ned_m: Vector3) -> bool:
        """Tell whether a place is another than home."""
        home = self.home
        x, y, z = position_ned_m
        return distance(x - home.north_m, y - home.east_m, z + home.altitude_m) > HOME_SPREAD_M

    def check_mission(
        self, items: Sequence[MissionItem], limits: Limits, home: GeoPoint | None = None
    ) -> Rejection | None:
        """Return why a mission is refused, by itself, by the limits or by the geofence; as seen from ``home``."""
        return check_mission(items, home or self.home_point, limits, self.fence.shape)

    def check_fence(
        self, items: Sequence[MissionItem], vehicle_ne_m: tuple[float, float] | None
    ) -> Rejection | None:
        """Return why a geofence is refused; ``vehicle_ne_m`` is where a flying vehicle is, from the origin."""
        if vehicle_ne_m is not None:
            vehicle_ne_m = (vehicle_ne_m[0] - self.home.north_m, vehicle_ne_m[1] - self.home.east_m)
        return check_fence(items, self.home_point, vehicle_ne_m)

    def check_rally(self, items: Sequence[MissionItem], limits: Limits) -> Rejection | None:
        """Return why a list of rally points is refused."""
        return check_rally(items, self.home_point, limits, self.fence.shape)

    def set_fence(self, items: Sequence[MissionItem]) -> Fence:
        """Take a geofence that was checked, and return it."""
        self.fence = Fence.from_items(items, self.frame) if items else NO_FENCE
        return self.fence

    def set_rally(self, items: Sequence[MissionItem]) -> None:
        """Take rally points that were checked."""
        self._rally_items = tuple(items)
        self.points = rally_points(items, self.frame, self.home_point)

    def return_place(
        self, north_m: float, east_m: float, return_type: float, allows: Callable[[ReturnPlace], bool]
    ) -> ReturnPlace | None:
        """Return where a return from here goes (RTL_TYPE), of the places that the geofence ``allows``, or None."""
        points = [point for point in self.points if allows(point)]
        if allows(self.home):
            return choose((north_m, east_m), self.home, points, return_type)
        return choose((north_m, east_m), self.home, points, RALLY_FIRST) if points else None

    def ground_m(self, north_m: float, east_m: float, stood: ReturnPlace) -> float:
        """Return how high the ground is taken to be, above the origin: as at the nearest place known.

        Where the vehicle ``stood`` counts before a home at the same place, which may have been set to any altitude.
        """
        return choose((north_m, east_m), stood, (self.home, *self.points), NEAREST).altitude_m
